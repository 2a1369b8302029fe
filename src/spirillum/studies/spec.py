"""The form of `STUDY.toml`: which robots, which models, which friction models."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from spirillum.dynamics.tube_robot import FRICTION_COEFFICIENT
from spirillum.fluid.registry import SWIMMER_MODELS
from spirillum.robot.arguments import in_range
from spirillum.robot.fields import Length, Rate, Section, Text, Time, refuse
from spirillum.robot.placement import Placement
from spirillum.robot.tables import FrictionModel
from spirillum.swimming.band import left_open
from spirillum.swimming.preparation import AUTO
from spirillum.units import Hz, show_height

_MOST_ROBOTS = 100_000  # most robots that are loaded one by one
LARGEST_STORED = 500_000_000
"""Most results of a study (robots times models times friction models times rates), written into a store in pieces."""
_Name = Annotated[Text, Field(min_length=1, max_length=200)]


class TailGrid(Section):
    """Every wavelength with every amplitude in every channel."""

    channels: Annotated[dict[_Name, _Name], Field(min_length=1, max_length=1000)]
    """Name of each channel to its robot (preset or file), which carries channel, body, motor and calibration."""
    wavelengths: Annotated[list[Length], Field(min_length=1)]  #: Wavelengths of the tails.
    amplitudes: Annotated[list[Length], Field(min_length=1)]  #: Amplitudes of the tails.


_Share = Annotated[float, BeforeValidator(in_range(0.0, 1.0)), Field(ge=0.0, le=1.0)]
_Coefficient = Annotated[float, BeforeValidator(in_range(0.0, 10.0)), Field(ge=0.0, le=10.0)]


class LaidDown(Section):
    """Factors of release, each with its low and its high level; all of it assumed."""

    gap: tuple[Length, Length] = (1e-4, 1e-3)  #: Smallest distance of body and glass at release, low and high.
    pitch: tuple[_Share, _Share] = (0.0, 0.5)
    """Nose up, over the steepest pitch that gap and tail allow, at which the tail is at the glass."""
    wait: tuple[Time, Time] = (0.0, 60.0)  #: Waiting time until the motor is switched on.
    roughness: tuple[Length, Length] = (1e-6, 3e-5)
    """Height of the asperities: of a smooth hull, and of glued and printed stripes."""
    friction_coefficient: tuple[_Coefficient, _Coefficient] = (0.0, 0.3)
    """Of dry friction where asperities touch; between lubricated surfaces 0.05 to 0.15, allowed 0 to 10."""
    duration: Time = 12.0  #: Length of each run with the motor on.

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        problems = []
        texts = {"gap": show_height, "wait": "{:g} s".format, "roughness": show_height}
        for name in ("gap", "pitch", "wait", "roughness", "friction_coefficient"):
            low, high = getattr(self, name)
            if low >= high:
                words = " to ".join(texts.get(name, "{:.4g}".format)(value) for value in (low, high))
                problems.append(f"laid_down.{name} goes from {words}; allowed: a low level below the high one")
        for name, value, least, most in (("duration", self.duration, 1.0, 600.0), ("wait", self.wait[1], 0.0, 3600.0)):
            if not least <= value <= most:
                problems.append(f"laid_down.{name} = {value:g} s; allowed: {least:g} s to {most:g} s")
        if self.roughness[1] >= 2.0 * self.gap[0]:
            problems.append(
                f"laid_down.roughness goes up to {show_height(self.roughness[1])} with a gap from "
                f"{show_height(self.gap[0])}: asperities would carry more than the weight; allowed: a roughness below "
                "twice the gap"
            )
        if problems:
            raise refuse(*problems)
        return self


class Contact(Section):
    """What robots rest on that are followed to their steady motions; assumed."""

    roughness: Length | None = None  #: Height of the asperities; unset: 1e-4 of the body's radius.
    friction_coefficient: _Coefficient = FRICTION_COEFFICIENT
    """Of dry friction where asperities touch; between lubricated surfaces 0.05 to 0.15."""


_READ_BY = {"laid_down": ("predicted",), "contact": ("settled", "trial")}
"""Tables of a study and the switches without which nothing reads them."""
_Values = Annotated[list[Any], Field(min_length=1, max_length=10_000)]


class Study(Section):
    """A study: a grid or a list of robots, answered by some models under some friction models."""

    title: _Name = "Study"  #: Title of report and figures.
    note: Annotated[Text, Field(max_length=5000)] = ""  #: Remarks on the study, such as assumptions.
    models: Annotated[tuple[str, ...], Field(min_length=1)] = (AUTO,)
    """Hydrodynamic models; `auto`: that of the posterior or calibration, else `tube` for robots in channels (missing
    tables are made first), and `slender` for robots without."""
    friction: Annotated[tuple[FrictionModel, ...], Field(min_length=1)] = ("none", "rotor", "paper")
    """Friction models."""
    claims: Literal["none", "biorob2012"] = "none"  #: Whose statements to hold the results against.
    assumed_motor_rates: Annotated[tuple[Rate, ...], Field(max_length=1000)] = ()
    """Motor rates at which B_eff is inferred as a curve, where no rates were observed."""
    grid: TailGrid | None = None  #: A grid of robots.
    robots: Annotated[list[_Name], Field(min_length=1, max_length=_MOST_ROBOTS)] | None = None
    """A list of robots (presets or files) instead of a grid."""
    vary: Annotated[dict[_Name, _Values], Field(default_factory=dict, max_length=20)]
    """Fields of the robot file with their values, such as `"tail.length" = ["40 mm", "60 mm"]`: every combination, for
    each of `robots`."""
    placement: Placement = Placement()  #: Poses of the robots in their channels, for models that compute the walls.
    band: Annotated[bool, Field(strict=True)] = False
    """Compute such models over the poses that `placement` leaves open too: seconds with tables, else many minutes."""
    predicted: Annotated[bool, Field(strict=True)] = False
    """Also simulate release from rest in the tubes, with nothing fitted: minutes."""
    laid_down: LaidDown = LaidDown()  #: Levels of the factors of release.
    settled: Annotated[bool, Field(strict=True)] = False
    """Also find the steady state of each robot after release in its tube: some seconds a robot."""
    trial: Annotated[bool, Field(strict=True)] = False
    """Also simulate a trial of each robot in its tube, as `spirillum predict`: some seconds a robot."""
    interval: Annotated[bool, Field(strict=True)] = False
    """Also give the 90 % interval of each trial over its unknowns: half a minute a robot; a rerun resumes."""
    contact: Contact = Contact()  #: Contact of released robots, in steady states and trials.

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
            lists |= {"grid.wavelengths": tuple(self.grid.wavelengths), "grid.amplitudes": tuple(self.grid.amplitudes)}
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
        problems += [
            f"{table} without {' or '.join(by)}, which reads it; allowed: {by[0]} = true or false beside it, or no "
            f"[{table}]"
            for table, by in _READ_BY.items()
            if table in self.model_fields_set and not self.model_fields_set.intersection(by)
        ]
        if self.interval and not self.trial:
            problems.append("interval without trial, of which it is; allowed: trial = true beside it")
        problems += self._problems_of_the_band()
        varied = len(self.robots or ()) * math.prod(len(values) for values in self.vary.values())
        if self.vary and varied > _MOST_ROBOTS:
            problems.append(f"vary makes {varied} robots; allowed: at most {_MOST_ROBOTS}, or a [grid]")
        elif self.size > LARGEST_STORED:
            problems.append(f"the study requests {self.size} results; allowed: at most {LARGEST_STORED}")
        if problems:
            raise refuse(*problems)
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
