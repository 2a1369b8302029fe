"""`STUDY.toml`: which robots, which models, which readings of the friction."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator
from pydantic_core import PydanticCustomError

from spirillum.errors import InputError
from spirillum.files import read_toml
from spirillum.fitted.calibration_file import (
    CalibrationFile,
    FittedFriction,
    calibrated_robot,
    placement_in,
    read_calibration,
)
from spirillum.fitted.posterior_file import PosteriorFile, read_posterior
from spirillum.fitted.warnings import Fitted, fitted_of
from spirillum.fluid.registry import SWIMMER_MODELS, check_placement
from spirillum.robot.actuation import FrictionReading
from spirillum.robot.arguments import in_range
from spirillum.robot.fields import Length, Rate, Section, Text, Time
from spirillum.robot.load import load
from spirillum.robot.placement import Placement
from spirillum.robot.problems import problems_in
from spirillum.robot.robot import Robot
from spirillum.swimming.band import left_open
from spirillum.swimming.model_choice import AUTO, WALLED, choose_model
from spirillum.units import Hz, show

__all__ = ["LARGEST_STORED", "LARGEST_STUDY", "Grid", "LaidDown", "LoadedStudy", "Study", "load_study"]

_MOST_ROBOTS = 100_000
"""Most robots that are loaded one by one."""
LARGEST_STUDY = 5_000_000
"""Most results (robots times models times friction readings times rates) of one study."""
LARGEST_STORED = 500_000_000
"""Most results of a study that is written into a store, a region after the other."""
LARGEST_WITH_INTERVALS = 10_000
"""Most robots of a study with a posterior, each of which swims a thousand times."""

_WHAT = "a study file (TOML, see `spirillum schema study`)"
_Name = Annotated[Text, Field(min_length=1, max_length=200)]


class Grid(Section):
    """Every wavelength with every amplitude in every channel."""

    channels: Annotated[dict[_Name, _Name], Field(min_length=1, max_length=1000)]
    """Name of each channel to its robot (preset or file), which carries channel, body, motor and calibration."""
    wavelengths: Annotated[list[Length], Field(min_length=1)]
    """Wavelengths of the tails."""
    amplitudes: Annotated[list[Length], Field(min_length=1)]
    """Amplitudes of the tails."""


_Share = Annotated[float, BeforeValidator(in_range(0.0, 1.0)), Field(ge=0.0, le=1.0)]
_Coefficient = Annotated[float, BeforeValidator(in_range(0.0, 10.0)), Field(ge=0.0, le=10.0)]


class LaidDown(Section):
    """Between what robots are laid down and let go, each factor from its low to its high level; all of it assumed."""

    gap: tuple[Length, Length] = (1e-4, 1e-3)
    """Smallest distance of body and glass where it is laid down, low and high."""
    pitch: tuple[_Share, _Share] = (0.0, 0.5)
    """Nose up, over the steepest pitch that gap and tail allow, at which the tail is at the glass."""
    wait: tuple[Time, Time] = (0.0, 60.0)
    """Time for which it lies there before its motor is switched on."""
    roughness: tuple[Length, Length] = (1e-6, 3e-5)
    """Height of the asperities: of a smooth hull, and of glued and printed stripes."""
    friction_coefficient: tuple[_Coefficient, _Coefficient] = (0.0, 0.3)
    """Of dry friction where asperities touch; between lubricated surfaces 0.05 to 0.15."""
    duration: Time = 12.0
    """Length of each run with the motor on."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        problems = []
        units = {"gap": "mm", "wait": "s", "roughness": "um"}
        for name in ("gap", "pitch", "wait", "roughness", "friction_coefficient"):
            low, high = getattr(self, name)
            if low >= high:
                words = " to ".join(show(value, units.get(name, "1")) for value in (low, high))
                problems.append(f"laid_down.{name} goes from {words}; allowed: a low level below the high one")
        for name, value, least, most in (("duration", self.duration, 1.0, 600.0), ("wait", self.wait[1], 0.0, 3600.0)):
            if not least <= value <= most:
                problems.append(f"laid_down.{name} = {value:g} s; allowed: {least:g} s to {most:g} s")
        if self.roughness[1] >= 2.0 * self.gap[0]:
            problems.append(
                f"laid_down.roughness goes up to {show(self.roughness[1], 'um')} with a gap from "
                f"{show(self.gap[0], 'um')}: asperities would carry more than the weight; allowed: a roughness below "
                "twice the gap"
            )
        if problems:
            raise PydanticCustomError("assembly", "{sentences}", {"sentences": "\n".join(problems)})
        return self


_Values = Annotated[list[Any], Field(min_length=1, max_length=10_000)]


class Study(Section):
    """A study: a grid or a list of robots, answered by some models under some friction readings."""

    title: _Name = "Study"
    """Title of report and figures."""
    note: Annotated[Text, Field(max_length=5000)] = ""
    """What a reader has to know about the study, such as assumptions."""
    models: Annotated[tuple[str, ...], Field(min_length=1)] = (AUTO,)
    """Hydrodynamic models; `auto`: that of the posterior or calibration, else `tube` if every robot has a table for its
    tube (see `spirillum prepare`), and `slender` if not."""
    friction: Annotated[tuple[FrictionReading, ...], Field(min_length=1)] = ("none", "rotor", "paper")
    """Readings of the friction."""
    claims: Literal["none", "biorob2012"] = "none"
    """Whose statements to hold the results against."""
    assumed_motor_rates: Annotated[tuple[Rate, ...], Field(max_length=1000)] = ()
    """Motor rates at which B_eff is inferred as a curve, where no rates were observed."""
    grid: Grid | None = None
    """A grid of robots."""
    robots: Annotated[list[_Name], Field(min_length=1, max_length=_MOST_ROBOTS)] | None = None
    """A list of robots (presets or files) instead of a grid."""
    vary: Annotated[dict[_Name, _Values], Field(default_factory=dict, max_length=20)]
    """Fields of the robot file with their values, such as `"tail.length" = ["40 mm", "60 mm"]`: every combination, for
    each of `robots`."""
    placement: Placement = Placement()
    """Where in their channels the robots lie, for models that compute the walls."""
    band: Annotated[bool, Field(strict=True)] = False
    """Compute such models over the places that `placement` leaves open too: seconds with tables, else many minutes."""
    predicted: Annotated[bool, Field(strict=True)] = False
    """Lay the robots down in their tubes and let them go too, with nothing fitted: minutes."""
    laid_down: LaidDown = LaidDown()
    """Between what they are laid down."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        problems = []
        if (self.grid is None) == (self.robots is None):
            problems.append("grid and robots: allowed: exactly one of a [grid] table and a `robots` list")
        problems += [
            f"models = '{name}' is unknown; allowed: {', '.join((AUTO, *SWIMMER_MODELS))}"
            for name in self.models
            if name not in (AUTO, *SWIMMER_MODELS)
        ]
        lists: dict[str, tuple[Any, ...]] = {
            "models": self.models,
            "friction": self.friction,
            "assumed_motor_rates": self.assumed_motor_rates,
        }
        if self.grid is not None:
            lists |= {
                "grid.wavelengths": tuple(self.grid.wavelengths),
                "grid.amplitudes": tuple(self.grid.amplitudes),
            }
        problems += [
            f"{name} holds a value twice; allowed: each once"
            for name, items in lists.items()
            if len(set(items)) < len(items)
        ]
        if self.vary and self.robots is None:
            problems.append("vary without `robots`; allowed: with a list of robots, whose fields it sets")
        problems += [
            f"vary.{path} holds a value twice; allowed: each once"
            for path, values in self.vary.items()
            if len({repr(value) for value in values}) < len(values)
        ]
        if any(not 1e-3 * Hz <= abs(rate) <= 1e4 * Hz for rate in self.assumed_motor_rates):
            problems.append("assumed_motor_rates holds a rate out of range; allowed: 0.001 Hz to 10000 Hz")
        problems += self._problems_of_the_band()
        varied = len(self.robots or ()) * math.prod(len(values) for values in self.vary.values())
        if self.vary and varied > _MOST_ROBOTS:
            problems.append(f"vary makes {varied} robots; allowed: at most {_MOST_ROBOTS}, or a [grid]")
        if self.size > LARGEST_STORED:
            problems.append(f"the study asks for {self.size} results; allowed: at most {LARGEST_STORED}")
        if problems:
            raise PydanticCustomError("assembly", "{sentences}", {"sentences": "\n".join(problems)})
        return self

    def _problems_of_the_band(self) -> list[str]:
        models = [SWIMMER_MODELS[name] for name in self.models if name in SWIMMER_MODELS]
        if not self.band or AUTO in self.models or any(left_open(self.placement, model) for model in models):
            return []
        if any(model.placed for model in models):
            return ["band = true, but the placement leaves nothing open; allowed: a placement without gap or pitch"]
        walled = ", ".join(name for name, model in SWIMMER_MODELS.items() if model.placed)
        names = ", ".join(self.models)
        return [f"band = true with models {names}; allowed: only with a model that computes the walls ({walled})"]

    @property
    def size(self) -> int:
        """Number of results."""
        grid = self.grid
        robots = len(self.robots or ()) * math.prod(len(values) for values in self.vary.values())
        if grid is not None:
            robots = len(grid.channels) * len(grid.wavelengths) * len(grid.amplitudes)
        return robots * len(self.models) * len(self.friction) * (1 + len(self.assumed_motor_rates))


@dataclass(frozen=True)
class LoadedStudy:
    """A checked study with its robots."""

    study: Study
    robots: tuple[Robot, ...]
    """One robot a channel of the grid, or the listed robots."""
    question: Mapping[str, Any]
    """All that decides the answer, for the fingerprint and the dataset's attributes."""
    fitted: Fitted = field(default_factory=Fitted)
    """B_eff of tails that a calibration knows, and what it rests on."""
    posterior: PosteriorFile | None = None
    """Draws over which answers have intervals."""
    cautions: tuple[str, ...] = ()
    """What to be careful about in the choice of the models, a sentence each."""
    placements: tuple[Placement, ...] = ()
    """Where each of `robots` lies by a calibration; none where the study says it."""

    def placement_of(self, number: int) -> Placement:
        """Where one of `robots` lies."""
        return self.placements[number] if self.placements else self.study.placement

    @property
    def friction(self) -> tuple[FittedFriction, ...]:
        """B_eff of tails that a calibration knows."""
        return self.fitted.friction

    @property
    def fingerprint(self) -> str:
        """Hash of the question."""
        text = json.dumps(self.question, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

    @property
    def count(self) -> int:
        """Number of robots."""
        grid = self.study.grid
        return len(self.robots) * (1 if grid is None else len(grid.wavelengths) * len(grid.amplitudes))

    def robot_at(self, index: int) -> Robot:
        """The robot at an index in the flat order of the study."""
        grid = self.study.grid
        if grid is None:
            return self.robots[index]
        robot, tail = divmod(index, len(grid.wavelengths) * len(grid.amplitudes))
        wavelength, amplitude = divmod(tail, len(grid.amplitudes))
        own = self.robots[robot]
        changed = {"wavelength": grid.wavelengths[wavelength], "amplitude": grid.amplitudes[amplitude]}
        return own.model_copy(update={"tail": own.tail.model_copy(update=changed)})

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the channels, or of the robots."""
        if self.study.grid is not None:
            return tuple(self.study.grid.channels)
        return tuple(robot.name for robot in self.robots)


def load_study(
    source: str | Path | Mapping[str, Any],
    overrides: Mapping[str, Any] | None = None,
    *,
    models: Sequence[str] | None = None,
    band: bool | None = None,
    predicted: bool | None = None,
    calibration: str | Path | None = None,
    posterior: str | Path | None = None,
    largest: int = LARGEST_STUDY,
) -> LoadedStudy:
    """Load a study and its robots.

    Args:
        source: study file or the same tables as a mapping;
        overrides: dotted robot fields, applied to every robot.
        models: hydrodynamic models instead of the study's; None: the study's.
        band: whether to compute bands, instead of what the study says; None: what it says.
        predicted: whether to lay the robots down and let them go, instead of what the study says; None: what it says.
        calibration: calibration file, applied to every robot.
        posterior: file of a calibration's posterior: its middle is applied to every robot.
        largest: most results that it may ask for.

    Raises:
        InputError: if the study or one of its robots is wrong.
    """
    folder = Path()
    if isinstance(source, Mapping):
        table, name = dict(source), "the study"
    else:
        table, name, folder = read_toml(Path(source), _WHAT), str(source), Path(source).parent
    instead = {"models": None if models is None else list(models), "band": band, "predicted": predicted}
    table |= {field: value for field, value in instead.items() if value is not None}
    study = problems_in(Study, table)
    if isinstance(study, list):
        more = f" (and {len(study) - 1} more)" if len(study) > 1 else ""
        raise InputError(f"{name}: {study[0]}{more}", [f"{name}: {problem}" for problem in study])
    if study.size > largest:
        store = f", or {LARGEST_STORED} in a store (--store study.zarr)" if largest < LARGEST_STORED else ""
        raise InputError(f"{name}: the study asks for {study.size} results; allowed: at most {largest}{store}")
    asked = list(_robots_of(study))
    sources = [entry for entry, _ in asked]
    robots = tuple(_robot(entry, folder, {**(overrides or {}), **varied}) for entry, varied in asked)
    robots = _named_apart(robots, asked)
    _check_drives(study, sources, robots, name)
    if study.predicted and not (calibration is None and posterior is None):
        raise InputError(
            f"{name}: predicted together with a calibration or posterior; allowed: one of them, for what is predicted "
            "is predicted with nothing fitted"
        )
    fitted, drawn = _fitted(study, calibration, posterior)
    robots = tuple(_fitted_robot(robot, fitted, drawn) for robot in robots)
    _check_varied(study, overrides or {}, name)
    study, cautions = _with_models(study, robots, calibration, drawn)
    try:
        check_placement(study.placement, *(SWIMMER_MODELS[model] for model in study.models))
    except InputError as error:
        raise InputError(f"{name}: {error}") from error
    placements = _fitted_places(study, robots, fitted, str(calibration))
    known = fitted_of(fitted, drawn, "" if calibration is None else str(calibration))
    friction = known.friction
    question = {"study": study.model_dump(), "robots": [robot.model_dump() for robot in robots]}
    if friction:
        question["friction"] = [item.model_dump() for item in friction]
    if placements:
        question["placements"] = [place.model_dump() for place in placements]
    if drawn:
        question["posterior"] = {"source": drawn.source, "sha256": drawn.sha256}
    loaded = LoadedStudy(study, robots, question, known, drawn, cautions, placements)
    if drawn and loaded.count > LARGEST_WITH_INTERVALS:
        raise InputError(f"{name}: {loaded.count} robots with a posterior; allowed: at most {LARGEST_WITH_INTERVALS}")
    return loaded


def _robots_of(study: Study) -> Iterator[tuple[str, dict[str, Any]]]:
    """Source and varied fields of every robot that is to be loaded."""
    sources = list(study.grid.channels.values()) if study.grid else study.robots or []
    for source in sources:
        for values in product(*study.vary.values()):
            yield source, dict(zip(study.vary, values, strict=True))


def _named_apart(robots: tuple[Robot, ...], asked: Sequence[tuple[str, Mapping[str, Any]]]) -> tuple[Robot, ...]:
    """The robots with what is varied in their names; the robot's own name only where there are several."""
    several = len({robot.name for robot in robots}) > 1
    found = []
    for robot, (_, varied) in zip(robots, asked, strict=True):
        words = [f"{path.rpartition('.')[2]} {value}" for path, value in varied.items()]
        name = ", ".join([robot.name, *words] if several or not words else words)
        found.append(robot.model_copy(update={"name": name[:200]}) if words else robot)
    return tuple(found)


def _fitted(
    study: Study, calibration: str | Path | None, posterior: str | Path | None
) -> tuple[CalibrationFile | None, PosteriorFile | None]:
    if calibration is not None and posterior is not None:
        raise InputError("posterior together with a calibration; allowed: one of them")
    file = None if calibration is None else read_calibration(calibration)
    asked = () if AUTO in study.models else study.models
    drawn = None if posterior is None else read_posterior(posterior, *asked)
    if drawn is not None and drawn.places_robots:
        raise InputError(
            f"{drawn.source} has a place of its own for the robots of each channel, and a study one for all; allowed: "
            "`predict` of each robot with it, or the study without"
        )
    return file, drawn


_VARIED = ("tail.wavelength", "tail.amplitude")
"""Fields of a robot that a grid sets."""


def _check_varied(study: Study, overrides: Mapping[str, Any], name: str) -> None:
    """Refuse to set what the grid varies.

    Raises:
        InputError: if that is asked for.
    """
    twice = [path for path in study.vary if path in overrides]
    if twice:
        raise InputError(f"{twice[0]} is set and varied by vary of {name}, which would win; allowed: one of them")
    both = [path for path in _VARIED if path in overrides] if study.grid is not None else []
    if both:
        own = f"grid.{both[0].removeprefix('tail.')}s"
        raise InputError(
            f"{both[0]} is set and varied by {own} of {name}, which would win; allowed: other fields, or another {own}"
        )


def _fitted_places(
    study: Study, robots: Sequence[Robot], file: CalibrationFile | None, source: str
) -> tuple[Placement, ...]:
    """Where a calibration places each robot, as `predict` takes it; none where the study says it, or no model asks.

    Raises:
        InputError: for a fitted place or dry friction that the study cannot take.
    """
    if file is None or not any(SWIMMER_MODELS[model].placed for model in study.models):
        return ()
    if file.contact.friction_coefficient:
        raise InputError(
            f"{source} has a friction_coefficient, and a study knows no dry friction; allowed: `predict` of each robot "
            "with it"
        )
    if study.placement.is_given:
        return ()
    found = [placement_in(file, robot) for robot in robots]
    if not any(found):
        return ()
    placements = tuple(place or Placement() for place in found)
    walled = next(SWIMMER_MODELS[model] for model in study.models if SWIMMER_MODELS[model].placed)
    if study.band and not all(left_open(place, walled) for place in placements):
        raise InputError(f"band = true, but {source} says where the robots lie; allowed: the study without a band")
    return placements


def _with_models(
    study: Study, robots: Sequence[Robot], calibration: str | Path | None, posterior: PosteriorFile | None
) -> tuple[Study, tuple[str, ...]]:
    """The study with a model in place of `auto`, the same for all robots, and what to be careful about in it."""
    if AUTO not in study.models:
        return study, ()
    own = LoadedStudy(study, tuple(robots), {})
    for index in range(own.count):  # until the first robot without a table: one model answers for all
        choice = choose_model(
            AUTO,
            own.robot_at(index),
            placement=study.placement,
            calibration=calibration,
            posterior=posterior,
            tables_only=True,
        )
        if choice.fitted or choice.model != WALLED:
            break
    models = dict.fromkeys(choice.model if model == AUTO else model for model in study.models)
    cautions = (choice.caution,) if choice.caution else ()
    return study.model_copy(update={"models": tuple(models)}), cautions


def _fitted_robot(robot: Robot, file: CalibrationFile | None, posterior: PosteriorFile | None) -> Robot:
    """The robot with what a calibration or the middle of a posterior says."""
    if posterior is not None:
        return posterior.central(robot)
    return robot if file is None else calibrated_robot(robot, file)


def _check_drives(study: Study, sources: Sequence[str], robots: Sequence[Robot], name: str) -> None:
    """Every robot needs a drive to swim by, and a joint that turns where motor rates are assumed."""
    for source, robot in zip(sources, robots, strict=True):
        if robot.drive is None:
            raise InputError(f"{name}: robot {source} has no [drive]; allowed: robots with a drive, by which they swim")
        if study.assumed_motor_rates and robot.drive.joint == "fixed":
            raise InputError(
                f"{name}: robot {source} has drive.joint = 'fixed', but the study names assumed_motor_rates; "
                "allowed: 'revolute', or no assumed_motor_rates"
            )


def _robot(entry: str, folder: Path, overrides: Mapping[str, Any]) -> Robot:
    """A robot of the study; a file stands relative to the study's folder."""
    beside = folder / entry
    return load(beside if Path(entry).suffix and not Path(entry).is_absolute() else entry, **overrides)
