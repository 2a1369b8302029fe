"""Parameters of a fit with units and weak priors, the reasons for these, and estimates with their intervals.

Every parameter is a smooth function of a coordinate z whose prior is the standard normal. Fits and samplers move in z:
all directions have the same scale there, and no bound is ever hit.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import nan
from typing import Any, NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.data_tables import rows_of
from spirillum.envelope import interval, quantity
from spirillum.errors import InputError, check_choice, did_you_mean
from spirillum.fluid.registry import SWIMMER_MODELS, find_swimmer_model
from spirillum.robot.model_options import CALIBRATED
from spirillum.swimming.preparation import AUTO, WALLED


@dataclass(frozen=True)
class LogNormal:
    """A positive number around a median; `spread` is the standard deviation of its logarithm."""

    median: float
    spread: float

    def value(self, z: Samples) -> Samples:
        """The parameter at a standard normal coordinate."""
        return self.median * np.exp(self.spread * np.clip(z, -30.0, 30.0))

    def coordinate(self, value: float) -> float:
        """The coordinate of a parameter's value."""
        return float(np.log(value / self.median) / self.spread)

    def words(self, unit: str) -> str:
        """The prior in words."""
        low, high = (self.median * np.exp(sign * 1.96 * self.spread) for sign in (-1, 1))
        return f"log-normal, 95 % from {low:.3g} to {high:.3g} {unit}".rstrip()


@dataclass(frozen=True)
class Uniform:
    """A number that is anywhere between two ends, or a positive one whose logarithm is."""

    low: float
    high: float
    in_logarithm: bool = False

    def value(self, z: Samples) -> Samples:
        """The parameter at a standard normal coordinate."""
        from scipy.special import ndtr

        share: Samples = ndtr(z)
        if self.in_logarithm:
            return np.asarray(self.low * (self.high / self.low) ** share)
        return self.low + (self.high - self.low) * share

    def coordinate(self, value: float) -> float:
        """The coordinate of a parameter's value."""
        from scipy.special import ndtri

        share = (value - self.low) / (self.high - self.low)
        if self.in_logarithm:
            share = np.log(value / self.low) / np.log(self.high / self.low)
        return float(ndtri(np.clip(share, 1e-6, 1.0 - 1e-6)))

    def words(self, unit: str) -> str:
        """The prior in words."""
        kind = "log-uniform" if self.in_logarithm else "uniform"
        return f"{kind} from {self.low:.3g} to {self.high:.3g} {unit}".rstrip()


Prior = LogNormal | Uniform  #: A prior as a map from a standard normal coordinate.


class FitParameter(NamedTuple):
    """Something that a fit may free."""

    name: str
    unit: str
    scope: str  #: One value for each `channel`, one for `all`, or (friction only) one for each `tail`.
    models: tuple[str, ...]  #: Models that have it.
    needs_motor: bool  #: Whether it acts on the motor's rate, so that the motor has to be predicted.
    replaces: str  #: Field whose value the fit ignores; empty where its prior is around the robot's own value.
    meaning: str
    reason: str  #: Why its prior is as it is.


def _parameters() -> Iterator[FitParameter]:
    """The rows of `parameters.csv`."""
    groups = {"all": tuple(SWIMMER_MODELS), "calibrated": CALIBRATED}
    for row in rows_of("calibration/parameters.csv"):
        name, unit, scope, models, motor, *words = row.values()
        yield FitParameter(name, unit, scope, groups.get(models, (models,)), motor != "", *words)


PARAMETERS = {parameter.name: parameter for parameter in _parameters()}  #: All parameters by name.

UNWALLED = "sbt"  #: Model that is fitted where `auto` can take none with walls: the paper's, with factors on drag.
DEFAULT_FREE = {
    **dict.fromkeys(CALIBRATED, ("body_drag", "body_rotation", "friction")),
    "rft": ("body_drag", "friction"),
    "tube": ("gap", "friction"),
}
"""Free parameters by default: those that the paper fitted (Table III, Figs 5 and 6 i to l), or the gap."""
_FREE_IN_TRIALS = ("friction_coefficient", "shared_friction")
"""Free parameters of a fit of trials by default; without motor rates the first alone."""


ASSUMABLE = {
    "fluid.viscosity": "viscosity",
    "motor.torque_constant": "torque_constant",
    "motor.back_emf_constant": "back_emf_constant",
}
"""Field of the robot to the parameter whose uncertainty may be stated: what (17) and (18) infer B_eff from."""
_LARGEST_UNCERTAINTY = 0.5


@dataclass(frozen=True)
class Coordinate:
    """One free number of a fit."""

    parameter: FitParameter
    channel: int | None  #: Index of its channel; None for all.
    label: str  #: Name, with the channel where there are several.
    prior: Prior


def listed_names(free: str | Sequence[str]) -> tuple[str, ...]:
    """Return the names in a comma-separated text, or in a sequence."""
    return tuple(name.strip() for name in (free.split(",") if isinstance(free, str) else free))


def is_free_in(model: str, free: str | Sequence[str] | None) -> bool:
    """Return whether a model has all these parameters; by default it has its own."""
    return free is None or all(name in PARAMETERS and model in PARAMETERS[name].models for name in listed_names(free))


def free_names(free: str | Sequence[str] | None, model: str, *, released: bool = False) -> tuple[str, ...]:
    """Names of the free parameters, from names or one text with commas; the default ones for None."""
    if free is None:
        return _FREE_IN_TRIALS if released else DEFAULT_FREE[model]
    names = listed_names(free)
    for name in names:
        check_choice("free", name, PARAMETERS)
        if names.count(name) > 1:
            raise InputError(f"free = '{name}' is a duplicate; allowed: once")
        if model not in PARAMETERS[name].models:
            raise InputError(
                f"free = '{name}' with model '{model}'; allowed: "
                f"{', '.join(other for other, item in PARAMETERS.items() if model in item.models)}"
            )
    if "friction" in names and "shared_friction" in names:
        raise InputError("free = 'friction' together with 'shared_friction'; allowed: one of them")
    if "gap" in names and "roughness" in names:
        raise InputError(
            "free = 'gap' together with 'roughness': the height of its asperities decides the gap of a robot that lies "
            "on them; allowed: one of them"
        )
    if "friction_coefficient" in names and "roughness" not in names and not released:
        raise InputError(
            "free = 'friction_coefficient' without 'roughness': dry friction acts where the robot lies on its "
            "asperities, whose height then decides its gap; allowed: roughness too"
        )
    bound = [name for name in names if PARAMETERS[name].needs_motor] if "friction" in names else []
    if bound:
        fields = {name: field for field, name in ASSUMABLE.items()}
        raise InputError(
            f"free = 'friction' together with {' and '.join(repr(name) for name in bound)}: B_eff of each tail takes "
            "up its motor rate, which leaves no observation that distinguishes them; allowed: shared_friction in place "
            f"of friction, or the uncertainty of {fields[bound[0]]} stated (--assume-uncertainty "
            f"{fields[bound[0]]}=5%) in place of freeing it"
        )
    return names


OBSERVED = ("tail.wavelength", "tail.amplitude")  #: Fields whose values are given by the observations.


def check_not_set(
    fields: Iterable[str], free: str | Sequence[str] | None, model: str, *, released: bool = False
) -> None:
    """Refuse set fields of a robot that the observations replace, or a fit, of trials if `released`, ignores."""
    asked = set(fields)
    observed = [field for field in OBSERVED if field in asked]
    if observed:
        raise InputError(
            f"{observed[0]} is set, and the observations say the {observed[0].partition('.')[2]} of each tail; "
            "allowed: other fields"
        )
    possible = [name for name in (WALLED, UNWALLED) if is_free_in(name, free)] or [UNWALLED]
    for known in possible if model == AUTO else [find_swimmer_model(model, AUTO).name]:
        for name in free_names(free, known, released=released and known == WALLED):
            field = PARAMETERS[name].replaces.format(model=known)
            if field in asked:
                raise InputError(
                    f"{field} is set, and the fit of '{name}' ignores it; allowed: one of them (--free names "
                    "what is fitted)"
                )


def assumed_uncertainties(given: Mapping[str, str | float] | None) -> dict[str, float]:
    """Stated uncertainties of what a fit takes from the robot: parameter to half of its relative 95 % interval."""
    found = {}
    for field, share in (given or {}).items():
        if field not in ASSUMABLE:
            raise InputError(
                f"assume-uncertainty = '{str(field)[:40]}'{did_you_mean(str(field), ASSUMABLE)}; allowed: "
                f"{', '.join(ASSUMABLE)}"
            )
        text = str(share).strip()
        try:
            value = float(text.removesuffix("%")) * (0.01 if text.endswith("%") else 1.0)
        except ValueError:
            value = float("nan")
        if isinstance(share, bool) or not 0.0 < value <= _LARGEST_UNCERTAINTY:
            raise InputError(
                f"assume-uncertainty {field} = '{text[:40]}'; allowed: half of its relative 95 % interval, such as "
                f"5%, up to {100 * _LARGEST_UNCERTAINTY:g}%"
            )
        found[ASSUMABLE[field]] = value
    return found


LEVEL = 0.95  #: Level of all intervals.


@dataclass(frozen=True)
class Estimate:
    """A number with its 95 % interval, SI; NaN where the method gives none."""

    value: float
    low: float = nan
    high: float = nan

    def quantity(self, unit: str, **more: Any) -> dict[str, Any]:
        """The number with its interval in JSON, and `more` of it."""
        return quantity(self.value, unit or "1", **interval(self.low, self.high, LEVEL), **more)
