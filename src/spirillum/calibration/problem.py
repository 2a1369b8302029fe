"""A fit set up: the experiment, the model, and the free numbers, from coordinates to what is predicted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from spirillum.arrays import Samples
from spirillum.calibration.experiment import Experiment, Quantity, Ratio
from spirillum.calibration.forward_models import (
    Forward,
    Ranges,
    TrialSurfaces,
    check_free,
    kinematics,
    place_ranges,
    trial_surfaces,
    tube_forward,
)
from spirillum.calibration.parameters import (
    ASSUMABLE,
    PARAMETERS,
    Coordinate,
    FitParameter,
    LogNormal,
    Prior,
    Uniform,
)
from spirillum.errors import InputError
from spirillum.fluid.closed.perrin import body_axial
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.registry import find_swimmer_model
from spirillum.progress import Progress, tell
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import all_hold
from spirillum.robot.placement import gap_on_asperities
from spirillum.swimming.motions import HELD, RELEASED
from spirillum.swimming.sampled_resistance import AxialTable, Draws, chebyshev_points


class UnexplainedError(InputError):
    """Observations that no plausible values of a model's free numbers explain."""


_FACTOR_SPREADS = {"body_drag": (2.0, 1.0), "body_rotation": (1.0, 1.0)}
_COEFFICIENT_SPREAD = 0.5
_TOLERANCE_SPREAD = 0.1
_FRICTION_SPREAD = 1.5
_LOG_NORMAL = {**_FACTOR_SPREADS, "friction_coefficient": (0.1, 0.8)}
"""Medians of log-normal priors that are the same for all robots, and standard deviations of the logarithm."""
_REACH = 2.5  # standard deviations of a prior to either side over which trials are made
_WIRE_POINTS = 9
_WIRE_RANGE = 5.0  # standard deviations that the table reaches to either side


@dataclass(frozen=True)
class Problem:
    """An experiment, a model, and the free coordinates."""

    experiment: Experiment
    model: SwimmerModel
    free: tuple[str, ...]
    coordinates: tuple[Coordinate, ...]  #: Free numbers; friction tail by tail is none, for it follows from the others.
    forward: Forward
    interpolation_error: float
    """Relative error of interpolated resistances, that no prediction is taken to be better than; 0 without any."""
    fixed_friction: Samples  #: B_eff of each robot where it is not free, N m s/rad; the rotor's own where unset.
    trials: TrialSurfaces | None = None  #: Observables of trials, where these are fitted; None: held motion is.
    assumed: Mapping[str, float] = field(default_factory=dict)
    """Parameter to its stated uncertainty, half of a relative 95 % interval: a prior where it is free, else a share of
    the interval of B_eff alone."""

    @cached_property
    def by_motor_rate(self) -> bool:
        """Whether the motor's rate is predicted and compared too."""
        return any(PARAMETERS[name].needs_motor for name in self.free)

    @cached_property
    def quantities(self) -> tuple[Quantity, ...]:
        """What is compared with the observations."""
        names: tuple[Quantity, ...] = ("advance", "turning", "motor_rate")
        kept = names if self.by_motor_rate else names[:2]
        return tuple(name for name in kept if np.any(self.ratio(name).is_observed))

    def ratio(self, quantity: Quantity) -> Ratio:
        """What was observed of a quantity."""
        found: Ratio = getattr(self.experiment, quantity)
        return found

    def draws(self, z: Samples) -> dict[str, Samples]:
        """Parameters at coordinates, (draws, robots), or (draws, 1) where all robots share one."""
        values = self._all_values(z)
        found = {name: values[:, places] for name, places in self._places.items()}
        if "roughness" in found:  # a robot that rests on its asperities
            found["gap"] = gap_on_asperities(found["roughness"])
        return found

    @cached_property
    def _places(self) -> dict[str, np.ndarray]:
        """Parameter to the column of each robot's number; one column where all robots share it."""
        found = {}
        for name in dict.fromkeys(item.parameter.name for item in self.coordinates):
            places = np.array([n for n, item in enumerate(self.coordinates) if item.parameter.name == name])
            by_channel = self.coordinates[int(places[0])].channel is not None
            found[name] = places[self.experiment.channel] if by_channel else places
        return found

    def _all_values(self, z: Samples) -> Samples:
        """Every free parameter, (draws, parameters); log-normal ones at once, for speed."""
        medians, spreads = self._log_normal
        found: Samples = medians * np.exp(spreads * np.clip(z[:, : medians.size], -30.0, 30.0))
        for place, item in enumerate(self.coordinates):
            if not isinstance(item.prior, LogNormal):
                found[:, place] = item.prior.value(z[:, place])
        return found

    @cached_property
    def _log_normal(self) -> tuple[Samples, Samples]:
        """Medians and spreads of the log-normal priors; 1 and 0 for others."""
        pairs = [
            (item.prior.median, item.prior.spread) if isinstance(item.prior, LogNormal) else (1.0, 0.0)
            for item in self.coordinates
        ]
        table = np.array(pairs, dtype=float).reshape(-1, 2)
        return table[:, 0], table[:, 1]

    def values(self, z: Samples) -> dict[str, Samples]:
        """Free numbers by label at coordinates, (draws,) each."""
        found = self._all_values(z)
        return {item.label: found[:, n] for n, item in enumerate(self.coordinates)}

    def predicted(self, z: Samples) -> dict[Quantity, Samples]:
        """What is compared, (draws, robots)."""
        draws = self.draws(z)
        shape = (z.shape[0], self.experiment.size)
        answer: dict[Quantity, Samples] = {}
        if self.trials is not None:
            advance, turning, answer["motor_rate"] = self.trials.at(draws)
        else:
            balance = self.forward.balance(draws)
            found = kinematics(balance)
            advance, turning = found.advance, found.turning
            if self.by_motor_rate:
                friction = draws.get("shared_friction", self.fixed_friction[None])
                answer["motor_rate"] = self.forward.motor_rate(balance, draws, friction)
        over_motor = np.where(self.experiment.by_motor, advance / (1.0 - turning), advance)
        answer |= {"advance": over_motor, "turning": turning}
        # What does not depend on any free number comes back once for all draws.
        return {name: np.broadcast_to(answer[name], shape) for name in self.quantities}

    def values_at(self, z: Samples) -> dict[str, float]:
        """Free parameters by label at one point of the coordinates, (parameters,)."""
        return {label: float(values[0]) for label, values in self.values(z[None]).items()}

    def predicted_at(self, z: Samples) -> dict[Quantity, Samples]:
        """Compared quantities, (robots,), at one point of the coordinates, (parameters,)."""
        return {name: values[0] for name, values in self.predicted(z[None]).items()}

    def friction(self, z: Samples, motor_rate: Samples, reading: str = "rotor", scaled: Draws | None = None) -> Samples:
        """B_eff of every robot at motor rates, N m s/rad, (draws, robots)."""
        seen = self.experiment
        constants = {"viscosity": self.forward.viscosity}
        own = {
            name: factor * (constants[name] if name in constants else getattr(self.forward.electrics, name))
            for name, factor in (scaled or {}).items()
        }
        with np.errstate(invalid="ignore"):
            share = seen.tail_rate / seen.motor_rate.mean
            return self.forward.friction({**self.draws(z), **own}, motor_rate, share, reading)

    def printed_turning(self, z: Samples) -> Samples:
        """Omega/omega of every robot by (19) as printed, at its observed motor rate, (draws, robots)."""
        seen = self.experiment
        with np.errstate(invalid="ignore"):
            share = seen.tail_rate / seen.motor_rate.mean
            return self.forward.printed_turning(self.draws(z), seen.motor_rate.mean[None], share)

    @property
    def start(self) -> Samples:
        """Coordinates at the middle of every prior."""
        return np.zeros(len(self.coordinates))

    def coordinate_of(self, values: Draws) -> Samples:
        """Coordinates of given values by label: the inverse of `values`."""
        return np.array([item.prior.coordinate(float(values[item.label])) for item in self.coordinates])


def posed(
    experiment: Experiment,
    model: str,
    free: Sequence[str],
    progress: Progress | None = None,
    assumed: Mapping[str, float] | None = None,
    *,
    prepare: bool = False,
    answer: str = HELD,
) -> Problem:
    """Set a fit up: check that the model holds for every robot, compute resistances, lay out the free numbers."""
    stated = dict(assumed or {})
    free = _with_assumed(free, stated)
    chosen = find_swimmer_model(model)
    batch = RobotBatch.of(experiment.robots)
    _check_domain(experiment, chosen, batch)
    if answer == RELEASED:
        check_free(free, chosen.name)
    _check_motor(experiment, free, batch)
    parameters = [PARAMETERS[name] for name in free if PARAMETERS[name].scope != "tail"]
    ranges: Ranges = {}
    if chosen.placed:
        ranges = place_ranges(batch, chosen, [name for name in free if name in ("gap", "pitch", "roughness")])
        bound = () if answer == RELEASED else free  # in a trial the run has the dry friction
        forward, error = tube_forward(experiment, batch, bound, progress, prepare=prepare)
    else:
        forward, error = _forward(experiment, chosen, batch, parameters, progress)
    rotor = batch.electrics.joint_rotor_friction if batch.electrics else np.zeros(1)
    friction = np.where(np.isnan(batch.effective_friction), rotor, batch.effective_friction)
    problem = Problem(
        experiment=experiment,
        model=chosen,
        free=tuple(free),
        coordinates=(),
        forward=forward,
        interpolation_error=error,
        fixed_friction=np.broadcast_to(friction, (experiment.size,)),
        assumed=stated,
    )
    laid: dict[str, list[Coordinate]] = {}
    for parameter in sorted(parameters, key=lambda item: item.name == "shared_friction"):
        # The prior of B_eff rests on the torque at the middle of all other priors: they come first.
        before = replace(problem, coordinates=tuple(item for items in laid.values() for item in items))
        laid[parameter.name] = _coordinates(before, parameter, batch, ranges)
    problem = replace(problem, coordinates=tuple(item for parameter in parameters for item in laid[parameter.name]))
    if answer == HELD:
        return problem
    found = {}
    for item in problem.coordinates:
        low, high = (float(item.prior.value(np.array([end]))[0]) for end in (-_REACH, _REACH))
        found[item.parameter.name] = (low, high)
    trials = trial_surfaces(experiment, found, progress, prepare=prepare)
    return replace(problem, trials=trials, interpolation_error=max(error, trials.error))


def _with_assumed(free: Sequence[str], assumed: Mapping[str, float]) -> tuple[str, ...]:
    """Free parameters, with those of stated uncertainty where the motor's rate is compared."""
    if any(PARAMETERS[name].needs_motor for name in free):
        return (*free, *(name for name in assumed if name not in free))
    if assumed and "friction" not in free:
        fields = ", ".join(field for field, name in ASSUMABLE.items() if name in assumed)
        raise InputError(
            f"assume-uncertainty = '{fields}' with free = '{', '.join(free)}': none of these depends on it; allowed: "
            "with friction, shared_friction or a constant of the motor free"
        )
    return tuple(free)


def _check_domain(experiment: Experiment, model: SwimmerModel, batch: RobotBatch) -> None:
    limits = model.requirements(batch)
    outside = np.flatnonzero(~all_hold(limits))
    if not outside.size:
        return
    place = int(outside[0])
    first = next(limit for limit in limits if not np.broadcast_to(limit.holds, (batch.size,))[place])
    raise InputError(
        f"{experiment.source}, row {experiment.rows[place][0]}: no robot has this tail with model '{model.name}': "
        f"{first.sentence(place)}"
    )


def _check_motor(experiment: Experiment, free: Sequence[str], batch: RobotBatch) -> None:
    needing = [name for name in free if PARAMETERS[name].needs_motor or name == "friction"]
    if not needing:
        return
    if batch.electrics is None or batch.drive != "dc-motor" or batch.joint != "revolute":
        raise InputError(
            f"free = '{needing[0]}', but robot {experiment.robots[0].name} has no dc-motor; allowed: a robot with "
            "drive.kind = 'dc-motor', [motor] and [battery]"
        )
    if not np.any(experiment.motor_rate.is_observed):
        raise InputError(
            f"{experiment.source} has no motor rates, which free = '{needing[0]}' needs; allowed: a column "
            "motor_rate_Hz, or tail_rate_Hz and body_rate_Hz"
        )


def _forward(
    experiment: Experiment,
    model: SwimmerModel,
    batch: RobotBatch,
    parameters: Sequence[FitParameter],
    progress: Progress | None,
) -> tuple[Forward, float]:
    """Resistances, over a table where the wire is free, and the largest error of its interpolation."""
    coefficients = any(item.name in ("normal_factor", "tangential_factor") for item in parameters)
    own_factors = batch.calibration.get(model.name)
    factors = {name: getattr(own_factors, name) for name in _FACTOR_SPREADS} if own_factors else {}

    def over(there: RobotBatch, wires: Samples | None = None) -> Forward:
        def told(done: int, total: int) -> None:
            words = "" if wires is None else f", wire of {wires[done] * 1e3:.3g} mm"
            tell(progress, f"{model.name}, {experiment.size} robots{words}", done, total)

        silent = wires is None and model.closed_form
        table = AxialTable.of(
            there, model, wires=wires, coefficients=coefficients, on_progress=None if silent else told
        )
        return Forward(table, batch.electrics, batch.viscosity, body_axial(there), factors)

    if not any(item.name == "wire_diameter" for item in parameters):
        return over(batch), 0.0
    own = float(batch.wire_diameter[0])
    reach = np.exp(_WIRE_RANGE * _TOLERANCE_SPREAD)
    forward = over(batch, chebyshev_points(_WIRE_POINTS, own / reach, own * reach))
    between = own * float(np.exp(0.31 * np.log(reach)))
    exact = over(batch.with_values({"tail.wire_diameter": between}))
    return forward, forward.largest_difference(exact, {"wire_diameter": np.full((1, 1), between)})


def _coordinates(problem: Problem, parameter: FitParameter, batch: RobotBatch, ranges: Ranges) -> list[Coordinate]:
    prior = _prior(problem, parameter, batch, ranges)
    if parameter.scope == "all":
        return [Coordinate(parameter, None, parameter.name, prior)]
    channels = problem.experiment.channels
    names = [parameter.name if len(channels) == 1 else f"{parameter.name}[{c * 1e3:g} mm]" for c in channels]
    return [Coordinate(parameter, place, name, prior) for place, name in enumerate(names)]


def _prior(problem: Problem, parameter: FitParameter, batch: RobotBatch, ranges: Ranges) -> Prior:
    name = parameter.name
    if name in _LOG_NORMAL:
        return LogNormal(*_LOG_NORMAL[name])
    if name in ("normal_factor", "tangential_factor"):
        return LogNormal(float(getattr(batch.options.rft, name)), _COEFFICIENT_SPREAD)
    if name in ("gap", "roughness"):
        return Uniform(*ranges[name], in_logarithm=True)
    if name == "pitch":
        return Uniform(*ranges[name])
    if name == "shared_friction":
        ratio = problem.experiment.motor_rate
        middle = problem.draws(problem.start[None])
        found = problem.forward.predict(middle)
        with_load = problem.forward.friction(middle, ratio.mean)[0]
        all_of_it = with_load + found.load[0] / (1.0 - found.turning[0])
        return LogNormal(float(0.5 * np.median(all_of_it[ratio.is_observed])), _FRICTION_SPREAD)
    source = batch if name in ("viscosity", "wire_diameter") else batch.electrics
    spread = stated_spread(problem.assumed[name]) if name in problem.assumed else _TOLERANCE_SPREAD
    return LogNormal(float(getattr(source, name)[0]), spread)


def stated_spread(uncertainty: float) -> float:
    """Standard deviation of the logarithm of a number, given half of its relative 95 % interval."""
    return float(np.log1p(uncertainty) / 1.96)
