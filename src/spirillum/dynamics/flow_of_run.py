"""The flow around a robot at a moment of its run in the tube, with pose and rates of the run."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast, get_args

import numpy as np

from spirillum.dynamics.run_file import attitudes_of, numbers_of, open_run, robot_of, rotation_matrix
from spirillum.errors import InputError, check_choice
from spirillum.fields.flow import Flow, Frame
from spirillum.fields.in_tube import tube_flow_field
from spirillum.fluid.registry import quickest
from spirillum.fluid.tube.progress_messages import OF_A_RUN, solution_message
from spirillum.fluid.tube.tube import Tube
from spirillum.notes import Note, note_attributes, notes_in
from spirillum.progress import Progress, tell
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import broken
from spirillum.robot.load import with_resolution
from spirillum.robot.model_options import Resolution
from spirillum.robot.placement import Placement
from spirillum.swimming.balance import find_friction_model
from spirillum.swimming.motions import STEADY, Swimming
from spirillum.swimming.prediction import Prediction
from spirillum.swimming.preparation import check_domain, least_gap
from spirillum.units import KINDS, parse_option, show

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr

_SCALARS = (
    *("azimuth", "wall_pitch", "wall_yaw", "wall_gap", "mean_flow"),
    *("tail_phase", "motor_rotation_rate", "body_rotation_rate", "tail_rotation_rate"),
)
_VECTORS = ("velocity", "angular_velocity")
_NEEDED = ("time", *_SCALARS, *_VECTORS, "attitude")  # What a run in a tube has, and what its flow follows from.

_OWN_NAMES = {"gap": "wall_gap", "pitch": "wall_pitch", "yaw": "wall_yaw", "flow": "mean_flow"}
"""Variables of a run by the fields of a placement that they become."""

_SAME_TIME = 1e-3  # Share of the time between two samples within which a moment is that of a sample.
_TOLERANCE = 0.03
_THINNEST = 0.02
"""Thinnest film that is resolved, in diameters of the body: thinner ones of a yawed robot take many minutes."""


class RunSnapshot(NamedTuple):
    """A robot in its tube at a moment of a run, in axes of the body that do not roll, SI; not solved for yet."""

    prediction: Prediction  #: Its motion as an answer, and the pose.
    phase: float
    body: np.ndarray
    rotor: np.ndarray
    mean_flow: float
    lifted: float  #: How much further from the wall than in the run it is resolved, m.


def flow_of_run(
    run: str | Path | xr.Dataset,
    time: str | float,
    *,
    frame: str = "lab",
    resolution: Resolution | Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> Flow:
    """The flow around a robot at a moment of a run by `simulate` with the model `tube`.

    Axes are those of the body where it lies against the wall, not rolled: x along the robot, z away from the nearest
    wall. No force and torque but weight, contact and a field act on the robot. A film thinner than a fiftieth of the
    body's diameter is computed as thick as that, with the same velocities: to resolve it would take many minutes. The
    sideways force is then not given, with a warning. A yawed robot takes one to three minutes, as it has no
    mirror image.

    Args:
        run: its file, or its dataset.
        time: the moment, with its unit (``"0.5 s"``) or a float in s; of the run's samples the nearest is taken.
        frame: `lab` (that of the channel), or `body` (moving with the robot's velocity along the channel).
        resolution: `accuracy` and `tolerance` of the model; None: the robot's own, but a tolerance of 0.03.
        progress: called when the flow is solved for, after the run is checked.

    Raises:
        InputError: for another run, a moment outside it, or a pose that cannot be resolved.
    """
    check_choice("frame", frame, get_args(Frame))
    at = moment_of_run(run, time, resolution)
    tell(progress, solution_message(OF_A_RUN), 0, 1)
    field = tube_flow_field(at.prediction.batch, at.body, at.rotor, at.phase, at.mean_flow)
    flow = Flow(at.prediction, field, at.phase, cast("Frame", frame), lifted=at.lifted)
    return replace(flow, held_force=float("nan")) if at.lifted > 0.0 else flow.with_held_force()


def moment_of_run(
    run: str | Path | xr.Dataset, time: str | float, resolution: Resolution | Mapping[str, Any] | None = None
) -> RunSnapshot:
    """A moment of a run by `simulate` with the model `tube`, checked before anything is solved."""
    dataset = open_run(run) if isinstance(run, str | Path) else run
    moment = parse_option("time", time, KINDS["time"])
    missing = [name for name in _NEEDED if name not in dataset]
    if missing:
        raise InputError(
            f"the run has no {missing[0]}; allowed: a free run in a tube, by `spirillum simulate --model tube`"
        )
    times = numbers_of(dataset, "time")
    if not times.size or np.any(np.diff(times) <= 0.0):
        raise InputError("time of the run has no values, or does not increase; allowed: samples one after the other")
    if not times[0] <= moment <= times[-1]:
        raise InputError(
            f"time = {show(moment, 's')} is outside the run; allowed: {show(times[0], 's')} to {show(times[-1], 's')}"
        )
    now = _sample(dataset, int(np.argmin(np.abs(times - moment))))
    nearest = float(now["time"])
    if abs(nearest - moment) > _SAME_TIME * float(np.min(np.diff(times), initial=np.inf)):
        note = Note.named("nearest-sample", time=moment, nearest=nearest)
        now = now.assign_attrs(note_attributes([note, *notes_in(now.attrs)]))
    return _motion(now, resolution)


def _sample(dataset: xr.Dataset, index: int) -> xr.Dataset:
    """A run at one of its samples, with what its flow follows from checked."""
    one = dataset.isel(time=[index])
    for name in _SCALARS:
        numbers_of(one, name)
    for name in _VECTORS:
        numbers_of(one, name, ("axis",), (3,))
    attitude = attitudes_of(one)[0]
    if float(one["wall_gap"][0]) < 0.0:
        stated = show(float(one["wall_gap"][0]), "um")
        raise InputError(f"the run's variable 'wall_gap' is {stated}; allowed: at least 0 m, a body inside its tube")
    texts = {name: one.attrs.get(name, "") for name in ("warnings", "fitted_by")}
    texts |= note_attributes(notes_in(one.attrs)) if isinstance(texts["warnings"], str) else {}
    for name, text in texts.items():
        if not isinstance(text, str):
            raise InputError(f"the run's attribute {name!r} = {text!r}; allowed: text")
    return one.isel(time=0).assign(attitude=("quaternion", attitude)).assign_attrs(texts)


def _motion(now: xr.Dataset, resolution: Resolution | Mapping[str, Any] | None) -> RunSnapshot:
    """The motion at a sample."""
    from scipy.spatial.transform import Rotation

    wanted = {"form": "direct", "tolerance": _TOLERANCE} | Resolution.of(resolution).model_dump(exclude_none=True)
    robot = with_resolution(robot_of(now), wanted, "tube")
    azimuth, pitch, yaw, gap = (float(now[name]) for name in ("azimuth", "wall_pitch", "wall_yaw", "wall_gap"))
    axes = Rotation.from_euler("XZY", [azimuth, yaw, -pitch]).as_matrix()
    turned = axes.T @ rotation_matrix(now["attitude"].values)
    phase = (np.arctan2(turned[2, 1], turned[1, 1]) + float(now["tail_phase"])) % (2.0 * np.pi)
    velocity, spin = axes.T @ now["velocity"].values, axes.T @ now["angular_velocity"].values
    body = np.concatenate([velocity, spin])
    rotor = body + float(now["motor_rotation_rate"]) * np.eye(6)[3]
    mean_flow = float(now["mean_flow"])
    drawn = max(gap, _THINNEST * robot.body.diameter)
    requested = {"gap": drawn, "pitch": pitch, "yaw": yaw, "flow": mean_flow}
    try:
        friction = find_friction_model(str(now.attrs.get("friction", robot.friction.reading)))
        batch = RobotBatch.of(robot, Placement.of(requested))
        if broken(Tube().requirements(batch)):
            drawn = float(np.fmax(least_gap(batch, Tube()), drawn))
        batch = RobotBatch.of(robot, Placement.of({**requested, "gap": drawn}))
        check_domain(robot, quickest(Tube(), batch), batch)
    except InputError as error:  # in terms of the run, not of a placement
        own = re.sub(r"placement\.(\w+)", lambda found: _OWN_NAMES.get(found[1], found[0]), str(error))
        raise InputError(f"the run: {own}") from error
    notes = list(notes_in(now.attrs))
    if gap < drawn:
        notes.append(Note.named("lifted-off-film", film=show(gap, "um"), lift=show(drawn - gap, "um")))
    nothing: dict[str, Any] = {item.name: np.array([np.nan]) for item in STEADY}
    known = {
        "forward_velocity": float(now["velocity"].values[0]),
        "body_rotation_rate": float(now["body_rotation_rate"]),
        "tail_rotation_rate": float(now["tail_rotation_rate"]),
        "plug_velocity": mean_flow,
    }
    swimming = Swimming(
        **(nothing | {name: np.array([value]) for name, value in known.items()}), valid=np.array([True])
    )
    found = Prediction(
        robot,
        Tube(),
        friction,
        calibrated=False,
        batch=batch,
        swimming=swimming,
        error_estimate=float("nan"),
        warnings=tuple(notes),
        motion="free",
        fitted_by=now.attrs["fitted_by"],
    )
    return RunSnapshot(found, phase, body, rotor, mean_flow, max(drawn - gap, 0.0))
