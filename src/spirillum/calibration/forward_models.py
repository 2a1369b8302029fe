"""Forward models: from draws of parameters to what is observed, of held robots by their balances, and in tubes.

There each robot answers by its own table at the pose of every draw, or by trials through smooth surfaces.

A table (`spirillum prepare`) answers for any gap and pitch in microseconds, so that a fit takes seconds. Its error at
places that were not used for it stands in it: no prediction is taken to be better.

A trial takes a second, a fit asks for many thousands of them. Each robot makes some trials that fill the ranges of the
priors evenly (Sobol' points in the logarithms); between them its advance, turning and motor rate are interpolated by
thin-plate splines (`scipy.interpolate.RBFInterpolator`). How far a surface through three quarters of them misses the
others is their error: no prediction is taken to be better.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from spirillum.arrays import PerRobot, Samples, Values
from spirillum.calibration.experiment import Experiment
from spirillum.dynamics.release import InTube, Release
from spirillum.dynamics.trial import quick_run, trial_means
from spirillum.errors import InputError
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.tube.library import TabledTube, prepared_tables, tables_of
from spirillum.fluid.tube.stages import StageName
from spirillum.kernels.native import thread_count
from spirillum.progress import Progress, tell
from spirillum.robot.batch import Electrics, RobotBatch
from spirillum.robot.placement import Placement, gap_on_asperities
from spirillum.robot.robot import Robot, with_numbers
from spirillum.swimming.balance import (
    TorqueBalance,
    body_per_tail,
    force_free,
    friction_torques,
    rates_per_torque,
    steady_current,
    with_body_factors,
)
from spirillum.swimming.band import band_poses
from spirillum.swimming.preparation import (
    WALLED,
    checked_geometries,
    has_table,
    preparation_time,
    prepare_all,
    table_for,
)
from spirillum.swimming.sampled_resistance import DrawnResistance, Draws, TubeResistance
from spirillum.swimming.steady import weights_in_fluid, with_dry_friction

if TYPE_CHECKING:
    from scipy.interpolate import RBFInterpolator

    from spirillum.fluid.tube.table import TubeTable


@dataclass(frozen=True)
class Predicted:
    """Predictions at draws of the parameters, (draws, robots)."""

    advance: Samples
    turning: Samples  #: Omega/omega.
    load: Samples  #: T_h/omega: torque that turns the rotor against the fluid, N m s.


@dataclass(frozen=True)
class DryContact:
    """Quantities on which dry friction under the robots depends, beside its coefficient."""

    weight: PerRobot  #: Weight in the fluid, N.
    radius: PerRobot  #: Of the body, m.
    tail_rate: PerRobot  #: Observed rate of the tail, rad/s.


@dataclass(frozen=True)
class Forward:
    """The robots of an experiment, prepared for evaluation."""

    resistance: DrawnResistance
    electrics: Electrics | None  #: Motor and battery of the robots.
    viscosity: Samples  #: The robots' own, Pa s.
    isolated: tuple[Values, Values] = (np.zeros(1), np.zeros(1))
    """D_x, N s/m, and E_x, N m s, of each robot's body alone at its own viscosity, on which the factors act."""
    factors: Mapping[str, Samples] = field(default_factory=dict)
    """The robots' own factors, where they are not free; 1 where they have none."""
    contact: DryContact | None = None  #: Ranges of dry friction under the robots.

    def matrices(self, draws: Draws) -> Samples:
        """Balance matrices, (draws, robots, 3, 3), with all factors and dry friction in them."""
        scale = np.asarray(draws["viscosity"]) / self.viscosity if "viscosity" in draws else 1.0
        own = (np.asarray(draws.get(name, self.factors.get(name, 1.0))) for name in ("body_drag", "body_rotation"))
        (on_drag, on_rotation), (drag, rotation) = own, self.isolated
        full = with_body_factors(self.resistance.whole(draws), (on_drag, on_rotation), (scale * drag, scale * rotation))
        if self.contact is None or "friction_coefficient" not in draws:
            return full
        force = np.asarray(draws["friction_coefficient"]) * self.contact.weight
        return with_dry_friction(full, force, self.contact.radius, self.contact.tail_rate)

    def balance(self, draws: Draws) -> TorqueBalance:
        """Force-free torque balances, (draws, robots)."""
        return force_free(self.matrices(draws))

    def predict(self, draws: Draws) -> Predicted:
        """Kinematics (15) at the draws."""
        return kinematics(self.balance(draws))

    def motor_rate(self, balance: TorqueBalance, draws: Draws, friction: Samples) -> Samples:
        """omega_m at full throttle with B_eff in the joint, from (15), (17) and (18), rad/s, (draws, robots)."""
        motor = self._motor(draws)
        body, tail = rates_per_torque(balance, friction_torques("rotor", friction, friction))
        per_current = motor.joint_torque_constant * (tail - body)
        current = steady_current(motor, np.zeros(1), motor.joint_back_emf_constant * per_current)
        return motor.polarity * per_current * current

    def friction(
        self, draws: Draws, motor_rate: Samples, tail_share: Samples | None = None, reading: str = "rotor"
    ) -> Samples:
        """B_eff of (18) at given motor rates, (draws, robots); `paper`: the body's torque row holds -K_m I."""
        # `tail_share` is the observed omega/omega_m of each robot; None or NaN: as the model turns the body.
        s = self.balance(draws)
        turning = kinematics(s).turning
        torque, tail, rate = self._at_motor_rate(turning, draws, motor_rate, tail_share)
        body = turning * tail if reading == "rotor" else s.body_rate_as_printed(torque, tail)
        return (torque - s.rotor_load(body, tail)) / rate

    def printed_turning(self, draws: Draws, motor_rate: Samples, tail_share: Samples) -> Samples:
        """Omega/omega by (19) as printed, E_x Omega = -K_m I, at given motor rates, (draws, robots)."""
        s = self.balance(draws)
        torque, tail, _ = self._at_motor_rate(kinematics(s).turning, draws, motor_rate, tail_share)
        return s.body_rate_as_printed(torque, tail) / tail

    def _at_motor_rate(
        self, turning: Samples, draws: Draws, motor_rate: Samples, tail_share: Samples | None
    ) -> tuple[Samples, Samples, Samples]:
        """K_m I of (17), the tail's rate and the motor's, all in the motor's own sense."""
        motor = self._motor(draws)
        own = 1.0 / (1.0 - turning)
        share = own if tail_share is None else np.where(np.isnan(tail_share), own, tail_share)
        rate = np.abs(motor_rate)
        torque = motor.joint_torque_constant * steady_current(motor, motor.joint_back_emf_constant * rate, np.zeros(1))
        return torque, share * rate, rate

    def _motor(self, draws: Draws) -> Electrics:
        if self.electrics is None:
            raise InputError("the robots have no dc-motor; allowed: robots with [motor], [battery] and drive.kind")
        known = [name for name in ("torque_constant", "back_emf_constant") if name in draws]
        return replace(self.electrics, **{name: np.asarray(draws[name], dtype=float) for name in known})

    def largest_difference(self, other: Forward, draws: Draws) -> float:
        """Largest relative difference of what both predict at draws."""
        ours, theirs = self.predict(draws), other.predict(draws)
        pairs = ((ours.advance, theirs.advance), (ours.turning, theirs.turning), (ours.load, theirs.load))
        return max(float(np.max(np.abs(a / b - 1.0))) for a, b in pairs)


def kinematics(balance: TorqueBalance) -> Predicted:
    """Kinematics (15) without an imposed flow: the motion per rate of the tail, from zero force and torque."""
    turning, _ = body_per_tail(balance)
    return Predicted(
        advance=balance.u_b * turning + balance.u_r, turning=turning, load=balance.rb * turning + balance.rr
    )


ROUGHNESS_BAND = (1e-4, 1e-2)
"""Least and largest height of asperities over the body's radius: from polished surfaces (1 um for the paper's robot) to
burrs and seams of moulded parts (0.1 mm)."""
_NAMED = 6

Ranges = dict[str, tuple[float, float]]


def place_ranges(batch: RobotBatch, model: SwimmerModel, names: Sequence[str]) -> Ranges:
    """Gaps, pitches and roughnesses that every robot of a batch allows: ends of their priors, m and rad."""
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in names}
    for _, one in batch.blocks(1):
        radius = 0.5 * float(one.body_diameter[0])
        rough = (ROUGHNESS_BAND[0] * radius, ROUGHNESS_BAND[1] * radius)
        known = {"gap": float(gap_on_asperities(rough[0]))} if "roughness" in names else {}
        places = band_poses(one.placed(Placement().model_copy(update=known)), model)
        gaps = [place.gap or 0.0 for place in places]
        # The steepest pitch depends on the gap; what holds at every gap is the least of them.
        steepest = min(max(place.pitch or 0.0 for place in places if place.gap == gap) for gap in gaps)
        own = {"gap": (min(gaps), max(gaps)), "pitch": (0.0, steepest), "roughness": rough}
        for name in names:
            found[name].append(own[name])
    ranges = {name: (max(low for low, _ in ends), min(high for _, high in ends)) for name, ends in found.items()}
    for name, (low, high) in ranges.items():
        if not low < high:
            raise InputError(
                f"free = '{name}': the robots share no range of it; allowed: robots that fit their channels"
            )
    return ranges


def tube_forward(
    experiment: Experiment,
    batch: RobotBatch,
    free: Sequence[str],
    progress: Progress | None,
    *,
    prepare: bool,
) -> tuple[Forward, float]:
    """The forward model, and the largest relative error of the robots' tables in speed and body rate."""
    model = _tables(experiment, batch, progress, prepare=prepare)
    level = replace(batch, placement=Placement().model_copy(update={"pitch": 0.0}))
    contact = _contact(experiment, batch) if "friction_coefficient" in free else None
    forward = Forward(TubeResistance.of(level, model), batch.electrics, batch.viscosity, contact=contact)
    errors: list[Mapping[str, float]] = [model.table_of(batch, index).error_without_yaw for index in range(batch.size)]
    return forward, max(error[name] for error in errors for name in ("forward_velocity", "body_rotation_rate"))


def _tables(experiment: Experiment, batch: RobotBatch, progress: Progress | None, *, prepare: bool) -> TabledTube:
    """The robots' tables."""
    found: Sequence[TubeTable | None] = tables_of(batch)
    lacking = [label for label, table in zip(experiment.labels(), found, strict=True) if table is None]
    if lacking and not prepare:
        otherwise = ", or model 'sbt', which leaves out the walls"
        raise without_tables(experiment, lacking, "model 'tube' asks a table", "straight", otherwise)
    if lacking:
        found = prepared_tables(checked_geometries(experiment.robots), stage="straight", workers=1, progress=progress)
    return TabledTube({table.key: table for table in found if table is not None})


def without_tables(
    experiment: Experiment, lacking: Sequence[str], need: str, stage: StageName, otherwise: str = ""
) -> InputError:
    """The error of a fit some of whose robots lack the stage of a table that it needs."""
    first = experiment.robots[experiment.labels().index(lacking[0])]
    more = f" and {len(lacking) - _NAMED} more" if len(lacking) > _NAMED else ""
    return InputError(
        f"{experiment.source}: {need} of every robot, and {len(lacking)} of {len(experiment.robots)} have none "
        f"({'; '.join(lacking[:_NAMED])}{more}); allowed: --prepare, which makes them first, each in "
        f"{preparation_time(RobotBatch.of(first), stage)}{otherwise}"
    )


def _contact(experiment: Experiment, batch: RobotBatch) -> DryContact:
    """Parameters of dry friction."""
    weight = weights_in_fluid(experiment.robots)
    if not np.all(weight > 0):
        place = int(np.argmin(weight > 0))
        raise InputError(
            f"free = 'friction_coefficient', but robot {experiment.robots[place].name} has no weight in the fluid that "
            "would press it onto the floor; allowed: robots with body.mass and tail.density that sink"
        )
    if not np.all(np.isfinite(experiment.tail_rate)):
        place = int(np.argmin(np.isfinite(experiment.tail_rate)))
        raise InputError(
            f"{experiment.source}, row {experiment.rows[place][0]}, column tail_rate_Hz: empty; allowed: a tail rate, "
            "which dry friction is balanced at (free = 'friction_coefficient')"
        )
    return DryContact(weight, np.broadcast_to(0.5 * batch.body_diameter, (batch.size,)), experiment.tail_rate)


FREE = ("shared_friction", "friction_coefficient", "roughness")
"""Parameters that a fit of trials may free: the pose follows from the run."""
_RUNS = {1: 16, 2: 32, 3: 64}  # trials of each robot, by the number of free parameters
_FEWEST = 0.75  # share of a robot's trials that have to have an answer
Ends = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class TrialSurfaces:
    """Observables of the trials of an experiment as functions of the free parameters."""

    names: tuple[str, ...]
    ends: Ends  #: Least and largest value of each parameter at which trials were made.
    surfaces: tuple[RBFInterpolator, ...]
    """For each robot U/omega, Omega/omega and the motor's rate over the logarithms of the parameters."""
    scales: Samples  #: Sizes of these three of each robot, (robots, 3).
    error: float  #: Median relative error of advance and motor rate at trials that were left out.

    def at(self, draws: Draws) -> tuple[Samples, Samples, Samples]:
        """U/omega, m/rad, Omega/omega and omega_m, rad/s, (draws, robots) each; beyond the ends as at these."""
        logs = [np.log(np.clip(draws[name], *self.ends[name])) for name in self.names]
        found = []
        for place, surface in enumerate(self.surfaces):
            x = np.stack([column[:, min(place, column.shape[1] - 1)] for column in logs], axis=-1)
            found.append(surface(x) * self.scales[place])
        stacked = np.stack(found, axis=1)
        return stacked[..., 0], stacked[..., 1], stacked[..., 2]


def check_free(free: Sequence[str], model: str) -> None:
    """Refuse parameters that a trial does not have, and models without one."""
    if model != WALLED:
        raise InputError(f"answer = 'trial' with model '{model}', which has no trials; allowed: model '{WALLED}'")
    wrong = [name for name in free if name not in FREE]
    if wrong:
        raise InputError(f"free = '{wrong[0]}' with answer = 'trial'; allowed: {', '.join(FREE)}")


def trial_surfaces(experiment: Experiment, ends: Ends, progress: Progress | None, *, prepare: bool) -> TrialSurfaces:
    """Make the trials of all robots and lay surfaces through them."""
    known = [has_table(RobotBatch.of(robot), "yaw") for robot in experiment.robots]
    lacking = [label for label, has in zip(experiment.labels(), known, strict=True) if not has]
    if lacking and not prepare:
        raise without_tables(experiment, lacking, "a trial asks a table with yawed poses", "yaw")
    if lacking:
        prepare_all(experiment.robots, stage="yaw", progress=progress)
    return surfaces_of(experiment.robots, ends, progress)


def surfaces_of(robots: Sequence[Robot], ends: Ends, progress: Progress | None) -> TrialSurfaces:
    """Make the trials of robots with tables, and lay surfaces through them."""
    from scipy.stats import qmc

    names, count = tuple(ends), _RUNS[len(ends)]
    shares = qmc.Sobol(len(ends), rng=np.random.default_rng(1)).random(count)
    low, high = (np.log([pair[end] for pair in ends.values()]) for end in (0, 1))
    logs: Samples = low + (high - low) * shares
    surfaces, scales, errors = [], [], []
    for place, robot in enumerate(robots):
        seen = np.full((count, 3), np.nan)
        values = [dict(zip(names, row.tolist(), strict=True)) for row in np.exp(logs)]
        table = table_for(RobotBatch.of(robot))
        with ThreadPoolExecutor(thread_count()) as pool:  # the compiled loops release the GIL
            for number, measured in enumerate(pool.map(partial(_measured, robot, table), values)):
                tell(progress, "trials of the robots", place * count + number, len(robots) * count)
                seen[number] = measured
        known = np.isfinite(seen).all(axis=1)
        if known.mean() < _FEWEST:
            raise InputError(
                f"{robot.with_tail}: {count - int(known.sum())} of {count} trials have no answer; allowed: robots that "
                "stay in their tables"
            )
        scale = np.abs(seen[known]).max(axis=0)
        surfaces.append(_surface(logs[known], seen[known] / scale))
        scales.append(scale)
        errors.append(_cross_validation_error(logs[known], seen[known] / scale))
    return TrialSurfaces(names, ends, tuple(surfaces), np.array(scales), float(np.max(errors)))


def _measured(robot: Robot, table: TubeTable, values: Mapping[str, float]) -> tuple[float, float, float]:
    """U/omega, Omega/omega and the motor's rate of a trial; NaN where there is none."""
    placed = Placement()
    asked = InTube().model_copy(update={"friction_coefficient": values.get("friction_coefficient")}).of_trial(placed)
    if "shared_friction" in values:
        robot = with_numbers(robot, {"friction.effective": values["shared_friction"]})
    try:
        trial = trial_means(quick_run(robot, table, Release(placed, asked, values.get("roughness")))).values
    except InputError:
        return (np.nan, np.nan, np.nan)
    tail = trial["tail_rotation_rate"]
    return trial["forward_velocity"] / tail, trial["body_rotation_rate"] / tail, trial["motor_rotation_rate"]


def _surface(x: Samples, values: Samples) -> RBFInterpolator:
    from scipy.interpolate import RBFInterpolator

    return RBFInterpolator(x, values, kernel="thin_plate_spline", degree=1)


def _cross_validation_error(x: Samples, values: Samples) -> float:
    """Median relative error of advance and motor rate at every fourth trial, by a surface through the others."""
    apart = np.arange(len(x)) % 4 == 3
    missed = _surface(x[~apart], values[~apart])(x[apart]) - values[apart]
    relative = np.median(np.abs(missed / values[apart]), axis=0)
    return float(max(relative[0], relative[2]))
