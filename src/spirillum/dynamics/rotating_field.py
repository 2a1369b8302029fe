"""A rotating magnetic field: its rate, axis and strength over time, and one-piece swimmers against its rate.

Held to the axis about which the field turns, the answer is a closed form (see `spirillum.swimming.balance`). A free
robot finds its own attitude: at low rates it may turn about a short axis or wobble, at higher ones its axis comes
near that of the field and it swims as a corkscrew, until the field turns faster than it can follow (K. I. Morozov and
A. M. Leshansky, Nanoscale 6:1580, 2014; Y. Man and E. Lauga, Phys. Fluids 25:071904, 2013). Here every rate is a run
in time that continues from the attitude of the one before, as when the field is slowly sped up.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.free_robot import FreeRobot, TwoLinks, two_links
from spirillum.dynamics.integration import Reach, integrate
from spirillum.dynamics.run_file import rotation_matrix
from spirillum.dynamics.timing import Switch
from spirillum.errors import InputError, check_range
from spirillum.fluid.registry import find_swimmer_model
from spirillum.kernels import core
from spirillum.notes import Note, note_attributes
from spirillum.progress import Progress, tell
from spirillum.quantities import attributes
from spirillum.robot.arguments import Options
from spirillum.robot.batch import RobotBatch
from spirillum.robot.fields import MagneticField, Pitch, Rate, Yaw
from spirillum.robot.limits import body_reynolds, reynolds_limits, reynolds_warnings, stokes_flow_problem, tail_reynolds
from spirillum.robot.load import load, with_resolution
from spirillum.robot.model_options import Resolution
from spirillum.robot.robot import Robot, without_reynolds_bound
from spirillum.swimming.motions import Swimming, check_full
from spirillum.swimming.prediction import Prediction, predict_steady
from spirillum.swimming.preparation import AUTO, NO_CHANNEL, UNBOUNDED, ModelChoice
from spirillum.swimming.steady import swim
from spirillum.units import KINDS, parse_option, show
from spirillum.version import versions

if TYPE_CHECKING:
    import xarray as xr


_A = TypeVar("_A", bound=FreeRobot)


class Field(Options, argument="field", prefixed=True):
    """Settings of the coils from now on; what is not given stays as it was."""

    rotation_rate: Rate | None = None  #: Rotation rate of the field about its axis.
    yaw: Yaw | None = None
    """Angle to +y of the field's axis of rotation, up to 45 degrees; along the lab's +x without it."""
    pitch: Pitch | None = None  #: Elevation of that axis from the horizontal.
    strength: MagneticField | None = None  #: Flux density, at right angles to the axis.


@dataclass(frozen=True)
class TurningField:
    """A uniform field that turns about an axis, at right angles to it; SI."""

    rotation_rate: float
    strength: float
    yaw: float = 0.0  #: Of the axis, rad.
    pitch: float = 0.0  #: Of the axis, rad.
    phase: float = 0.0  #: Angle at time 0 at this rate, from up, rad.

    @classmethod
    def of(cls, links: FreeRobot) -> TurningField | None:
        """The field of a robot's file; None for another drive."""
        if links.drive[core.DRIVE_KIND] != core.MAGNETIC:
            return None
        return cls(float(links.drive[core.DRIVE_FIELD_RATE]), float(links.drive[core.DRIVE_FIELD]))

    @property
    def axis(self) -> Samples:
        """Direction of the axis in the lab, (3,)."""
        level = np.cos(self.pitch)
        return np.array([level * np.cos(self.yaw), level * np.sin(self.yaw), np.sin(self.pitch)])

    def changed(self, requested: Field, time: float) -> TurningField:
        """The field from a time on; its angle does not jump."""
        given = requested.model_dump(exclude_none=True)
        rate = given.get("rotation_rate", self.rotation_rate)
        return replace(self, **given, phase=self.phase + (self.rotation_rate - rate) * time)

    def on(self, links: _A) -> _A:
        """A robot in this field."""
        drive = links.drive.copy()
        drive[core.DRIVE_FIELD_RATE], drive[core.DRIVE_FIELD] = self.rotation_rate, self.strength
        drive[core.DRIVE_AXIS_Y : core.DRIVE_FIELD_PHASE] = self.axis[1:]
        drive[core.DRIVE_FIELD_PHASE] = self.phase
        return replace(links, drive=drive)


def in_tilted_field(links: _A, requested: Field) -> _A:
    """A robot in the field of its file, which rotates about an axis of given yaw and pitch, by default 0."""
    given = requested.model_dump(exclude_none=True)
    if not given:
        return links
    own = TurningField.of(links)
    if own is None:
        raise InputError(f"field.{next(iter(given))} without a field; allowed: with drive.kind = 'magnetic'")
    for name in ("rotation_rate", "strength"):
        if name in given:
            field = "magnetic.field" if name == "strength" else f"magnetic.{name}"
            raise InputError(f"field.{name} of a run; allowed: {field} of the robot")
    return own.changed(requested, 0.0).on(links)


_TILT = 0.1  # Angle by which the robot is pushed before every rate, rad: else it could stay in an unstable balance.
_SAMPLES = 64
_SETTLED = 1e-3  # Largest relative change of the velocity from one stretch to the next.
_STILL = 1e-4  # Largest change of the wobble from one stretch to the next, rad.
_MOST_STRETCHES = 25
_MOST_RATES = 2000
_MOST_WORK = 3e7
"""Turns of all stretches, each over the share of the step-out rate at which it is turned: a quarter of an hour."""


class _Mean(NamedTuple):
    """Averages over one stretch of a run at one rate."""

    forward_velocity: float  #: Along the axis of the field, m/s.
    tail_rotation_rate: float
    wobble_angle: float
    least_wobble_angle: float
    largest_wobble_angle: float
    phase_lag: float  #: NaN where the robot slips.
    state: Samples  #: At the end.

    @property
    def follows(self) -> bool:
        """Whether the robot follows the field."""
        return bool(np.isfinite(self.phase_lag))

    def agrees(self, other: _Mean) -> bool:
        """Whether nothing has changed any more."""
        here, there = self.forward_velocity, other.forward_velocity
        same = abs(here - there) <= _SETTLED * max(abs(here), abs(there))
        return same and abs(self.wobble_angle - other.wobble_angle) <= _STILL and self.follows == other.follows


def magnetic_sweep(
    robot: str | Path | Mapping[str, Any] | Robot,
    rates: Sequence[str | float] | Samples | None = None,
    *,
    model: str = AUTO,
    turns: float = 30.0,
    resolution: Resolution | Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Speed, lag and wobble of a one-piece swimmer against the field's rate; floats are in SI units, rates in rad/s.

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot, with a `magnetic` drive.
        rates: rotation rates of the field in increasing size, each with its unit (``"2 Hz"``) or a float in rad/s;
            None: 40 rates up to one and a half times the step-out rate of the held robot.
        model: `slender` or `rft`; or `auto`: `slender` for a robot without a channel. A robot in a channel needs the
            name of a model: a sweep leaves the walls out.
        turns: turns of the field in a stretch; stretches follow each other until speed and wobble no longer change,
            at most 25, and the last is averaged, over whole slips where the robot slips.
        resolution: of the model `slender`: `accuracy`, `standard` or `high`; None: the robot's own.
        progress: called with stage, number done, and total.

    Returns:
        Dataset over `field_rate` (rad/s): `forward_velocity` along the field's axis, `tail_rotation_rate` about it,
        `wobble_angle` with its least and largest, `phase_lag` (NaN where the robot slips), `settled` (0 where they
        still change), and the same of the held robot in closed form; `step_out_rate` of the held robot as a scalar.

    Raises:
        InputError: for another drive, wrong rates, a model without all entries, or a rate at which the robot moves far
            outside Stokes flow.
    """
    from scipy.spatial.transform import Rotation

    loaded = load(robot)
    if model == AUTO and loaded.channel is not None and loaded.magnetic is not None:
        raise InputError(
            f"{loaded.name} has a channel, whose walls a sweep omits; allowed: model 'slender' or 'rft', which "
            "leave them out, or `simulate` at each rate"
        )
    choice = ModelChoice(UNBOUNDED, NO_CHANNEL) if model == AUTO else ModelChoice(model)
    check_full(find_swimmer_model(choice.model))
    check_range("turns", turns, 4, 10_000)
    given = None if rates is None else _parse_rates(rates)
    own = with_resolution(loaded, resolution, choice.model)
    # The rates of the sweep decide whether there is an answer, not the robot's own.
    held = replace(predict_steady(without_reynolds_bound(own), model=choice, calibrated=False), robot=own)
    if held.batch.drive != "magnetic":
        raise InputError(f"drive.kind = '{held.batch.drive}'; allowed: 'magnetic' for a sweep of the field")
    requested = _usual_rates(held) if given is None else given
    _check_work(requested, turns, held.step_out_rate)
    batch = replace(held.batch, options=own.model)
    closed = swim(held.batch.with_values({"magnetic.rotation_rate": requested}), held.model, calibrated=False)
    inertia = _check_stokes(batch, requested, closed.forward_velocity, closed.tail_rotation_rate)
    links = two_links(held, None, weight=False)
    level: Samples = np.array([1.0, 0.0, 0.0, 0.0])
    attitude: Samples = level
    found, settled = [], []
    for done, rate in enumerate(requested):
        tell(progress, f"field at {rate / (2 * np.pi):.3g} Hz", done, requested.size)
        pushed = Rotation.from_rotvec([0.0, 0.0, _TILT]) * Rotation.from_quat(attitude, scalar_first=True)
        mean, still = _settled(links, float(rate), pushed.as_quat(scalar_first=True), turns)
        attitude = mean.state[core.STATE_ATTITUDE : core.STATE_ATTITUDE + 4] if mean.follows else level
        found.append(mean)
        settled.append(still)
        moving = np.array([mean.forward_velocity]), np.array([mean.tail_rotation_rate])
        inertia |= _check_stokes(batch, np.array([rate]), *moving)
    notes = [] if held.robot.channel is None else [Note.named("sweep-without-walls", model=held.model.name)]
    notes += [*held.robot.warnings, *inertia.values()]
    if not all(settled):
        open_ = np.abs(requested[~np.array(settled)])
        least, most = (show(float(rate), "Hz") for rate in (open_.min(), open_.max()))
        notes.append(
            Note.named(
                "sweep-still-changes", count=open_.size, rates=requested.size, least=least, most=most,
                stretches=_MOST_STRETCHES, turns=turns,
            )
        )  # fmt: skip
    return _dataset(held, closed, requested, found, np.array(settled, dtype=float), turns, notes)


def _check_stokes(batch: RobotBatch, rates: Samples, speed: Samples, turning: Samples) -> dict[str, Note]:
    """Notes where the motion at some rates of the field leaves Stokes flow, by limit: that of the last rate."""
    found: dict[str, Note] = {}
    for rate, one, turned in zip(rates.tolist(), speed, turning, strict=True):
        limits = reynolds_limits(batch, body_reynolds(batch, one), tail_reynolds(batch, turned))
        if problem := stokes_flow_problem(batch, limits):
            raise InputError(f"at a field of {show(rate, 'Hz')} (--rate) {problem}")
        where = f"at a field of {show(rate, 'Hz')} "
        found |= {flag: note.prefixed(where) for flag, note in reynolds_warnings(limits).items()}
    return found


def _usual_rates(held: Prediction) -> Samples:
    """Forty rates up to one and a half times the step-out rate."""
    angle = float(held.batch.moment_angle[0])
    if np.sin(angle) < 1e-6:
        raise InputError(
            f"magnetic.moment_angle = {show(angle, 'deg')}: a moment along the motor axis has no step-out rate; "
            "allowed: a moment across it, or rates (--rate)"
        )
    return float(np.sign(held.batch.field_rate[0]) or 1.0) * np.linspace(0.0, 1.5, 41)[1:] * held.step_out_rate


def _parse_rates(rates: Sequence[str | float] | Samples) -> Samples:
    """Rates as a caller has given them, rad/s."""
    given: Any = [rates] if isinstance(rates, str) else rates
    if not isinstance(given, (Sequence, np.ndarray)) or np.ndim(given) != 1:
        raise InputError(f"rates = {str(rates)[:40]}; allowed: a list of rates")
    requested = np.array(
        [parse_option("rates", float(r) if isinstance(r, np.floating) else r, KINDS["rate"]) for r in given]
    )
    if not 1 <= requested.size <= _MOST_RATES:
        raise InputError(f"rates has {requested.size} values; allowed: 1 to {_MOST_RATES}")
    before = np.concatenate([[0.0], requested[:-1]])
    wrong = np.flatnonzero((np.abs(requested) <= np.abs(before)) | (requested * requested[0] <= 0))
    if wrong.size:
        first = int(wrong[0])
        after = f" after {show(float(before[first]), 'Hz')}" if first else ""
        raise InputError(
            f"rates: {show(float(requested[first]), 'Hz')}{after} does not increase in size from above 0 in one sense; "
            "allowed: increasing rates, all > 0 or < 0"
        )
    return requested


def _check_work(rates: Samples, turns: float, step_out: float) -> None:
    """Refuse a sweep that takes hours: steps are those of step-out, and slower turns take more of them."""
    slowness = np.maximum(step_out / np.abs(rates), 1.0) if np.isfinite(step_out) else np.ones(rates.size)
    work = turns * float(np.sum(slowness))
    if work > _MOST_WORK:
        raise InputError(
            f"rates from {show(float(np.abs(rates).min()), 'Hz')} on, {turns:g} turns each, take as long as {work:.2g} "
            f"turns near step-out ({show(step_out, 'Hz')}); allowed: {_MOST_WORK:.0e}, as with higher or fewer rates"
        )


def _settled(links: TwoLinks, rate: float, attitude: Samples, turns: float) -> tuple[_Mean, bool]:
    """The robot in a field that turns at one rate, from an attitude on until nothing changes, or given up."""
    drive = links.drive.copy()
    drive[core.DRIVE_FIELD_RATE] = rate
    here = replace(links, drive=drive)
    start: Samples = np.zeros(core.STATE_SIZE)
    start[core.STATE_ATTITUDE : core.STATE_ATTITUDE + 4] = attitude
    whole = float(max(round(turns), 1))  # so that every stretch begins with the field pointing up
    time = np.linspace(0.0, whole * 2.0 * np.pi / abs(rate), int(whole * _SAMPLES) + 1)
    before = None
    for _ in range(_MOST_STRETCHES):
        try:
            run = integrate(here, start, time, [Switch(0.0, 1.0)], Reach()).require_completion()
        except InputError as error:
            raise InputError(
                f"rates: at {show(rate, 'Hz')} {str(error).partition(';')[0]}; allowed: rates nearer to step-out"
            ) from error
        mean = _averaged(here, rate, run.time, run.states)
        if before is not None and mean.agrees(before):
            return mean, True
        before, start = mean, mean.state
    return mean, False


def _averaged(links: TwoLinks, rate: float, time: Samples, states: Samples) -> _Mean:
    rotation = rotation_matrix(states[:, core.STATE_ATTITUDE : core.STATE_ATTITUDE + 4])
    moment = rotation @ links.drive[core.DRIVE_MOMENT : core.DRIVE_FIELD]
    behind = np.unwrap(0.5 * np.pi + rate * time - np.arctan2(moment[:, 2], moment[:, 1])) * np.sign(rate)
    slipped = behind - behind[0]
    follows = abs(float(slipped[-1])) < 0.5 * np.pi
    slips = int(slipped[-1] // (2.0 * np.pi))
    last = time.size - 1 if slips < 1 else int(np.searchsorted(slipped, 2.0 * np.pi * slips))
    wobble = np.arccos(np.clip(np.abs(rotation[: last + 1, 0, 0]), 0.0, 1.0))
    span = float(time[last])
    return _Mean(
        forward_velocity=float(states[last, 0] - states[0, 0]) / span,
        tail_rotation_rate=rate - float(np.sign(rate) * slipped[last]) / span,
        wobble_angle=float(np.mean(wobble)),
        least_wobble_angle=float(np.min(wobble)),
        largest_wobble_angle=float(np.max(wobble)),
        phase_lag=float(np.angle(np.mean(np.exp(1j * behind)))) if follows else np.nan,
        state=states[-1],
    )


def _dataset(
    held: Prediction,
    closed: Swimming,
    rates: Samples,
    found: Sequence[_Mean],
    settled: Samples,
    turns: float,
    notes: Sequence[Note],
) -> xr.Dataset:
    import xarray as xr

    meanings = {
        "forward_velocity": "mean velocity along the axis of the field",
        "tail_rotation_rate": "mean rate at which the moment turns about it",
        "wobble_angle": "mean angle between the motor axis and the axis of the field",
        "phase_lag": "mean angle of the moment behind the field; NaN where it slips",
    }
    free = {name: np.array([getattr(mean, name) for mean in found]) for name in _Mean._fields if name != "state"}
    source = "two rigid links, one piece, m x B"
    data: dict[str, Any] = {
        name: ("field_rate", values, attributes(name, meaning=meanings.get(name), source=source))
        for name, values in (free | {"settled": settled}).items()
    }
    for name in ("forward_velocity", "tail_rotation_rate", "phase_lag"):
        values = np.broadcast_to(getattr(closed, name), rates.shape)
        meaning = f"{name.replace('_', ' ')} of the held robot, closed form"
        data[f"held_{name}"] = ("field_rate", values, attributes(name, meaning=meaning, source="m B sin(lag)"))
    reason = held.answered_by.get("model_reason", "")
    data["step_out_rate"] = ((), held.step_out_rate, attributes("step_out_rate"))
    return xr.Dataset(
        data,
        coords={"field_rate": ("field_rate", rates, attributes("field_rate"))},
        attrs={
            "title": f"{held.robot.name} in a rotating field",
            "robot": held.robot.name,
            "model": held.model.name,
            **({"model_reason": reason} if reason else {}),
            "turns": float(turns),
            "settings": json.dumps(held.robot.model_dump(), sort_keys=True),
            "known_error": held.known_error,
            "integrator": TwoLinks.integrator(),
            "references": " ".join(held.references),
            **note_attributes(notes),
            "versions": versions(),
        },
    )
