"""A posterior on disk (`posterior.nc` of `spirillum calibrate`): its draws, checked, for one robot after another."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.files import netcdf_file, open_netcdf, read_bytes
from spirillum.files.limits import LARGEST_NETCDF
from spirillum.files.netcdf import group_of
from spirillum.fitted.calibration_file import (
    CalibrationFile,
    FittedContact,
    FittedFriction,
    FittedValues,
    calibrated_robot,
    fitted_model,
    friction_of_tails,
    nearest_channel,
)
from spirillum.robot.model_options import Calibration, FittedTo
from spirillum.robot.placement import Placement, gap_on_asperities
from spirillum.robot.robot import Robot

if TYPE_CHECKING:
    import xarray as xr

SCHEMA = "spirillum.posterior/1"
_DRAWS = 1000
_WHAT = "posterior.nc of `spirillum calibrate --method posterior`"
_SMALLEST, _GREATEST = 1e-15, 1e12  # of a draw, SI
_LARGEST_DISCREPANCY = 100.0
_MAY_BE_ZERO = ("pitch",)
_PLACE = ("gap", "pitch")


_Length = Annotated[float, Field(gt=1e-9, lt=1e3)]
_Number = Annotated[float, Field(gt=-1e12, lt=1e12)]
_Name = Annotated[str, Field(min_length=1, max_length=200)]
_Names = Annotated[str, Field(max_length=10_000)]


class _Table(BaseModel):
    model_config = ConfigDict(frozen=True, allow_inf_nan=False)


class _Parameter(_Table):
    label: _Name
    parameter: _Name
    channel: Annotated[int, Field(ge=0, lt=1000)] | None


class _OfTail(_Table):
    channel_diameter: _Length
    wavelength: _Length
    amplitude: Annotated[float, Field(ge=0, lt=1e3)]

    @property
    def sizes(self) -> tuple[float, float, float]:
        """Diameter of the channel, wavelength and amplitude, which identify a tail in its channel, m."""
        return self.channel_diameter, self.wavelength, self.amplitude


class _Friction(_OfTail):
    value: _Number
    low: Annotated[float, Field(allow_inf_nan=True)]
    high: Annotated[float, Field(allow_inf_nan=True)]


class _Seen(_Table):
    mean: _Number
    trials: Annotated[float, Field(gt=0, lt=1e9)]
    scale: Annotated[float, Field(gt=1e-12, lt=1e12)]
    stated: Annotated[float, Field(ge=0, lt=1e9)] = 0.0


_Quantity = Literal["advance", "turning", "motor_rate"]


class ObservedTail(_OfTail):
    """Observations of a robot."""

    tail_rate: _Number | None = None
    seen: dict[_Quantity, _Seen]
    by_motor: bool
    correlation: Annotated[float, Field(gt=-1, lt=1)]  #: Of the errors of advance and turning.
    floor: Annotated[float, Field(ge=1e-9, lt=1e3)]  #: Of all relative errors.


class _Body(_Table):
    diameter: _Length
    length: _Length


class _Robot(_Table):
    body: _Body


class _Fitted(_Table):
    """Model, robots and observations of a posterior."""

    model: Annotated[str, Field(min_length=1), AfterValidator(fitted_model)]
    observations: _Names
    synthetic: bool
    channels: Annotated[tuple[_Length, ...], Field(min_length=1, max_length=1000)]
    friction: Annotated[tuple[_Friction, ...], Field(max_length=100_000)]  #: B_eff tail by tail.
    friction_reading: Literal["", "rotor", "paper"]  #: Reading of the friction under which it was inferred.
    tails: Annotated[tuple[ObservedTail, ...], Field(max_length=100_000)] = ()
    """Observations of every robot; none in older files."""
    answer: Literal["held", "trial"] = "held"  #: Motion that was fitted: `held`, or a `trial`.


_JSON = ("channels", "parameters", "friction", "quantities", "settings", "tails")  # attributes that are texts in a file


class PosteriorAttributes(_Fitted):
    """Attributes of a posterior's file."""

    converged: bool
    parameters: Annotated[tuple[_Parameter, ...], Field(min_length=1, max_length=1000)]
    quantities: Annotated[tuple[_Quantity, ...], Field(max_length=10)]
    settings: Annotated[tuple[_Robot, ...], Field(min_length=1, max_length=100_000)]

    @classmethod
    def of(cls, attributes: dict[str, Any]) -> PosteriorAttributes:
        """Attributes as they were read, with numbers of numpy as those of Python."""
        single = (name for name, value in attributes.items() if hasattr(value, "item") and value.size == 1)
        tables = {name: json.loads(attributes[name]) for name in _JSON if name in attributes}
        return cls.model_validate({**attributes, **{name: attributes[name].item() for name in single}, **tables})


class PosteriorFile(_Fitted):
    """Draws of a posterior, thinned, with what they were fitted to."""

    model_config = ConfigDict(arbitrary_types_allowed=True)

    source: str
    sha256: str
    body: tuple[float, float]  #: Diameter and length of the fitted body, m.
    draws: Mapping[str, Samples]  #: Parameter to (draws, channels), or (draws, 1).
    middle: Mapping[str, Samples]  #: Their medians before thinning, (channels,) or (1,), as in `calibration.toml`.
    discrepancy: Mapping[str, Samples]  #: Quantity to (draws,).
    error: Mapping[str, Samples]  #: Relative error of a trial, quantity to (draws,).

    def measured(self, robot: Robot) -> ObservedTail | None:
        """Return the observations of a robot; None without any."""
        diameter = robot.channel.diameter if robot.channel else np.inf
        own = (diameter, robot.tail.wavelength, robot.tail.amplitude, robot.body.diameter, robot.body.length)
        alike = (tail for tail in self.tails if np.allclose(own, (*tail.sizes, *self.body), rtol=1e-6, atol=0.0))
        return next(alike, None)

    @property
    def count(self) -> int:
        """Number of draws."""
        return int(next(iter(self.draws.values())).shape[0])

    @property
    def places_robots(self) -> bool:
        """Whether the pose of a robot in its channel is among the draws."""
        return any(name in self.draws for name in (*_PLACE, "roughness"))

    @property
    def tail_rate(self) -> float | None:
        """Median of the observed tail rates, rad/s, without sign; None where none is in the file."""
        rates = [abs(rate) for tail in self.tails if (rate := tail.tail_rate) is not None]
        return float(np.median(rates)) if rates else None

    def acts_on(self, robot: Robot, *, walls: bool, friction: bool) -> bool:
        """Whether a fitted number acts on a robot's motion; the model's discrepancy, which widens intervals, aside."""
        of_lying = {*_PLACE, *FittedContact.model_fields}
        lies = walls and (bool(self._of_place(robot, self.middle)) or "friction_coefficient" in self.draws)
        rubs = friction and friction_of_tails(robot, self.frictions) != (None, ())
        return lies or rubs or not of_lying.issuperset(self.draws)

    def placed(self, robot: Robot, placement: Placement, draw: int | None = None) -> Placement:
        """A placement with the fitted gap and pitch where it leaves them open; level if only the gap was fitted."""
        if placement.eccentricity is not None:
            return placement
        middle = {name: float(value) for name, value in self._of_place(robot, self._at_draw(draw)).items()}
        if middle and placement.gap is None and placement.pitch is None:
            middle.setdefault("pitch", 0.0)
        update = {name: value for name, value in middle.items() if getattr(placement, name) is None}
        return placement.model_copy(update=update)

    def contact(self, draw: int | None = None) -> FittedContact:
        """Roughness and dry friction, of one draw or their middles."""
        values = self._at_draw(draw)
        known: dict[str, Any] = {name: float(values[name][0]) for name in FittedContact.model_fields if name in values}
        return FittedContact.model_construct(**known)

    def _at_draw(self, draw: int | None) -> Mapping[str, Samples]:
        return self.middle if draw is None else {name: values[draw] for name, values in self.draws.items()}

    def _of_place(self, robot: Robot, values: Mapping[str, Samples]) -> dict[str, Samples]:
        """Gap and pitch of a robot among draws, whose last axis are channels."""
        diameter = robot.channel.diameter if robot.channel else np.inf
        own = [place for place, fitted in enumerate(self.channels) if np.isclose(diameter, fitted, rtol=1e-6, atol=0.0)]
        found = {name: values[name][..., own[0]] for name in _PLACE if name in values and own}
        if "roughness" in values and robot.channel is not None:  # a robot that rests on its asperities
            found["gap"] = gap_on_asperities(values["roughness"][..., 0])
        return found

    def central(self, robot: Robot) -> Robot:
        """The robot with the posterior median in place of its own values."""
        channel = nearest_channel(robot, self.channels)
        middle = {name: float(self._column(name, channel, self.middle)) for name in self.draws}
        return self._at(middle, robot, self.frictions)

    def sampled_robots(self, robot: Robot, count: int, rng: np.random.Generator) -> list[Robot]:
        """The robot with the values of some draws in place of its own, evenly spaced among them."""
        draws = self.of(robot, rng)
        return [self._at({name: float(values[n]) for name, values in draws.items()}, robot) for n in self.places(count)]

    def at(self, places: Sequence[int]) -> PosteriorFile:
        """The posterior with some of its draws, by their numbers."""
        kept = list(places)
        draws, discrepancy, error = (
            {name: values[kept] for name, values in part.items()} for part in (self.draws, self.discrepancy, self.error)
        )
        return self.model_copy(update={"draws": draws, "discrepancy": discrepancy, "error": error})

    def places(self, count: int) -> list[int]:
        """Indices of some draws, evenly spaced among them."""
        found: list[int] = np.linspace(0, self.count - 1, min(count, self.count)).round().astype(int).tolist()
        return found

    def _at(self, values: Mapping[str, float], robot: Robot, tails: tuple[FittedFriction, ...] = ()) -> Robot:
        """The robot with some fitted numbers, and B_eff of `tails`, in place of its own."""
        own = robot.calibration.get(self.model)
        factors: dict[str, Any] = {
            name: values.get(name, getattr(own, name, 1.0)) for name in ("body_drag", "body_rotation")
        }
        entry = Calibration.model_construct(
            **factors,
            source=self.source,
            fitted_to=FittedTo.model_construct(
                channel_diameter=self.channels[nearest_channel(robot, self.channels)],
                body_diameter=self.body[0],
                body_length=self.body[1],
            ),
        )
        friction = values.get("friction", values.get("shared_friction"))
        fields: dict[str, Any] = {name: value for name, value in values.items() if name in FittedValues.model_fields}
        file = CalibrationFile.model_construct(
            calibration={self.model: (entry,)} if factors.keys() & values.keys() else {},
            fitted=FittedValues.model_construct(**(fields | {"friction": friction})),
            friction=tails,
        )
        return calibrated_robot(robot, file)

    @property
    def frictions(self) -> tuple[FittedFriction, ...]:
        """The middle of B_eff, tail by tail."""
        names = set(_OfTail.model_fields)
        return tuple(
            FittedFriction.model_construct(**item.model_dump(include=names), effective=max(item.value, 0.0))
            for item in self.friction
        )

    def _column(self, name: str, channel: int, values: Mapping[str, Samples] | None = None) -> Samples:
        columns = (self.draws if values is None else values)[name]
        return columns[..., min(channel, columns.shape[-1] - 1)]

    def of(self, robot: Robot, rng: np.random.Generator) -> dict[str, Samples]:
        """Draws for one robot: those of the nearest channel, with their median (`central`), its pose, and B_eff."""
        diameter = robot.channel.diameter if robot.channel else np.inf
        nearest = nearest_channel(robot, self.channels)
        found = {name: self._column(name, nearest) for name in self.draws if name not in _PLACE}
        found |= self._of_place(robot, self.draws)
        # B_eff is that of its own tail where it was fitted; else around the middle of the fitted tails of its channel,
        # with the spread from tail to tail (Student's t, of logarithms: one more tail like these).
        for item in self.friction:
            keys = (diameter, robot.tail.wavelength, robot.tail.amplitude)
            if np.allclose(keys, item.sizes, rtol=1e-6, atol=0.0) and np.isfinite(item.high - item.low):
                spread = (item.high - item.low) / (2.0 * 1.96)
                found["friction"] = np.maximum(item.value + spread * rng.normal(size=self.count), 0.0)
        own, others = friction_of_tails(robot, self.frictions)
        if own is None and others:
            found["friction"] = _of_another_tail(others, self.count, rng)
        return found


_ALONE = 0.3  # standard deviation of log B_eff from tail to tail where a single tail does not constrain it; assumed
_FACTOR = 20.0  # factor from the median within which B_eff of another tail is assumed


def _of_another_tail(others: Sequence[float], size: int, rng: np.random.Generator) -> Samples:
    """Draws of B_eff of one more tail, given those of some."""
    middle = float(np.median(others))
    if middle <= 0:
        return np.zeros(size)
    logs = np.log(np.maximum(others, middle / _FACTOR))
    count = len(others)
    off = _ALONE * rng.normal(size=size)
    if count > 1:
        off = float(logs.std(ddof=1)) * np.sqrt(1.0 + 1.0 / count) * rng.standard_t(count - 1, size=size)
    return middle * np.exp(np.clip(off, -np.log(_FACTOR), np.log(_FACTOR)))


def posterior_checksum(attributes: Mapping[str, Any], values: Mapping[str, Samples]) -> str:
    """Checksum over a posterior's draws and metadata."""
    found = hashlib.sha256()
    for name in sorted(set(attributes) - {"checksum"}):
        found.update(f"{name}={attributes[name]}\n".encode(errors="surrogatepass"))
    for name in sorted(values):
        found.update(
            f"{name}\n".encode(errors="surrogatepass") + np.ascontiguousarray(values[name], dtype="<f8").tobytes()
        )
    return found.hexdigest()


def read_posterior(path: str | Path, *models: str, answer: str | None = "held") -> PosteriorFile:
    """Read a posterior that a calibration has written, of `held` motion, of a `trial`, or (None) of either."""
    path = Path(path)
    with open_netcdf(path, _WHAT) as file:
        attributes = {str(name): item for name, item in file.attrs.items()}
        if str(attributes.get("schema")) != SCHEMA:
            raise InputError(f"{path} is no posterior of a calibration; allowed: {_WHAT}")
        draws = group_of(file, "posterior")
        values = {str(name): np.asarray(item.values, float) for name, item in draws.data_vars.items()}
    try:
        content = PosteriorAttributes.of(attributes)
        found = _read(path, content, values, hashlib.sha256(read_bytes(path, _WHAT, LARGEST_NETCDF)).hexdigest())
    except (ValueError, KeyError, TypeError, IndexError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path} is no posterior, or damaged; allowed: {_WHAT}") from error
    if attributes.get("checksum") != posterior_checksum(attributes, values):
        raise InputError(f"{path} is no posterior, or damaged (its checksum is another); allowed: {_WHAT}")
    if not content.converged:
        raise InputError(
            f"{path} has not converged, so that its intervals mean nothing; allowed: {_WHAT}, with exit code 0; "
            "`spirillum calibrate` with more --doublings samples for longer"
        )
    if answer is not None and found.answer != answer:
        raise InputError(
            f"{path} is of trials, whose draws no held motion follows; allowed: the calibration.toml beside it, as "
            "--calibration, or with `predict`, `simulate` in the tube and `suggest --as trial`"
            if answer == "held"
            else f"{path} is of held motion; allowed: as held, or a posterior by `calibrate --as trial`"
        )
    if models and found.model not in models:
        asked = ", ".join(f"'{name}'" for name in models)
        raise InputError(f"{path} is of model '{found.model}', not {asked}; allowed: --model {found.model}")
    return found


def _read(path: Path, content: PosteriorAttributes, values: Mapping[str, Samples], sha256: str) -> PosteriorFile:
    flat = {name: array.reshape(-1) for name, array in values.items()}
    size = min(array.size for array in flat.values())
    kept = np.linspace(0, size - 1, min(size, _DRAWS)).round().astype(int)
    draws: dict[str, Samples] = {}
    middle: dict[str, Samples] = {}
    for name in dict.fromkeys(item.parameter for item in content.parameters):
        columns = sorted(
            (item for item in content.parameters if item.parameter == name), key=lambda item: item.channel or 0
        )
        draws[name] = np.stack([flat[item.label][kept] for item in columns], axis=1)
        middle[name] = np.array([np.median(flat[item.label]) for item in columns])
    body = content.settings[0].body
    least = {name: 0.0 if name in _MAY_BE_ZERO else _SMALLEST for name in draws}
    if size < 2 or not all(np.all((array >= least[name]) & (array < _GREATEST)) for name, array in draws.items()):
        raise InputError(f"{path} holds draws that are no numbers, or impossible ones; allowed: {_WHAT}")
    sizes = [flat[f"{kind}_{name}"] for kind in ("discrepancy", "error") for name in content.quantities]
    if not all(np.all((array >= 0) & (array < _LARGEST_DISCREPANCY)) for array in sizes):
        raise InputError(f"{path} holds a discrepancy or an error that is none; allowed: {_WHAT}")
    return PosteriorFile.model_construct(
        **{name: getattr(content, name) for name in _Fitted.model_fields},
        source=f"{path.name} ({content.observations})",
        sha256=sha256,
        body=(body.diameter, body.length),
        draws=draws,
        middle=middle,
        discrepancy={name: flat[f"discrepancy_{name}"][kept] for name in content.quantities},
        error={name: flat[f"error_{name}"][kept] for name in content.quantities},
    )


def write_posterior(tree: xr.DataTree, path: Path) -> None:
    """Write a posterior as NetCDF-4, whole or not at all."""
    from xarray.backends import H5NetCDFStore

    squeezed = {"zlib": True, "complevel": 4}
    with netcdf_file(path) as file:
        for node in tree.subtree:
            names = node.data_vars if node.name in ("posterior", "log_likelihood") else ()
            store = H5NetCDFStore(file if node.path == "/" else file.create_group(node.path))
            node.to_dataset(inherit=False).dump_to_store(store, encoding={str(name): squeezed for name in names})
