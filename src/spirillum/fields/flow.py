"""The fluid's velocity and pressure around a swimming robot, at points and on grids, and their summary."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from dataclasses import field as repr_field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast, get_args

import numpy as np

from spirillum.answer_entries import answer_of
from spirillum.arrays import Samples
from spirillum.display import DisplayMixin
from spirillum.envelope import quantity, with_notes_last
from spirillum.errors import InputError, check_choice, did_you_mean
from spirillum.fields.fluid_field import FluidField, checked_points, flow_field
from spirillum.fields.grid import PLANE_RESOLUTION, VOLUME_RESOLUTION, PointGrid, box_around, dataset_on, plane_around
from spirillum.fields.in_tube import tube_flow_field
from spirillum.fluid.tube.domain import pose_of
from spirillum.notes import Note, note_attributes
from spirillum.progress import Progress
from spirillum.quantities import unit_of
from spirillum.robot.load import load
from spirillum.robot.model_options import Resolution
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.robot.tube_pose import TubePose
from spirillum.swimming.prediction import Prediction, predict_steady
from spirillum.swimming.preparation import AUTO, ModelChoice, choose_model, prepared
from spirillum.units import KINDS, parse_option
from spirillum.version import versions

if TYPE_CHECKING:
    import xarray as xr


FLOW_MODELS = ("slender", "tube")  #: The models whose tractions give a flow: in unbounded fluid, and in the channel.
Frame = Literal["lab", "body"]
_MOTION = ("forward_velocity", "tail_rotation_rate", "body_rotation_rate")


@dataclass(frozen=True, repr=False)
class Flow(DisplayMixin):
    """The fluid around a swimming robot at one phase of its tail.

    SI; axes of the body, origin at its mid-length on the motor axis, x forward. The body's frame moves with the
    robot's forward velocity and does not turn; at the instant shown its origin and axes are those of the lab.
    """

    prediction: Prediction
    field: FluidField = repr_field(repr=False)  #: The flow in the lab frame.
    phase: float
    frame: Frame
    """`lab` (that of the channel; unbounded fluid rests far away) or `body` (moving with the forward velocity)."""
    held_force: float = 0.0
    """Sideways force on the robot from outside, N.

    Of a robot whose lateral motion is held: what holds it at this phase; far away in unbounded fluid the flow is its.
    At a moment of a free run: weight, contact and a field; NaN where the robot is shown `lifted`.
    """
    lifted: float = 0.0
    """Increase of the wall distance for the flow around a robot on a thin lubrication film in a run, m."""

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.prediction.robot

    @property
    def seat(self) -> TubePose | None:
        """The tube and the robot's pose in it; None for unbounded fluid."""
        return _tube_pose(self.prediction)

    @property
    def heading(self) -> Samples:
        """Unit vector along which the robot swims, in its axes, (3,): the channel's axis."""
        return np.array([1.0, 0.0, 0.0]) if self.seat is None else self.seat.forward

    @property
    def warnings(self) -> tuple[Note, ...]:
        """What to be careful about, a sentence each."""
        if self.robot.channel is None or self.seat is not None:
            return self.prediction.warnings
        return (*self.prediction.warnings, Note.named("flow-without-walls"))

    def to_dict(self) -> dict[str, Any]:
        """The motion and its settings, as data."""
        return answer_of(self, is_lifted=self.lifted != 0.0)

    def with_held_force(self) -> Flow:
        """This flow with the sideways force that the fluid's traction amounts to."""
        force = self.field.wrench()[:3]
        sideways = force - (force @ self.heading) * self.heading
        return replace(self, held_force=float(np.linalg.norm(sideways)))

    def inside(self, points: Samples) -> np.ndarray:
        """Whether each point is inside body, coupling or tail, or outside the tube, (n,).

        Args:
            points: (n, 3), m.

        Raises:
            InputError: if they have another shape or are not finite.
        """
        return np.asarray(self.field.inside(checked_points(points)), dtype=bool)

    def velocity(self, points: Samples) -> Samples:
        """Velocity of the fluid in the chosen frame, m/s, (n, 3); arguments as for `fields`."""
        return self.fields(points)[0]

    def pressure(self, points: Samples) -> Samples:
        """Pressure, Pa, (n,), above that far away, in a tube above the mean of both ends; arguments as for `fields`."""
        return self.fields(points)[1]

    def fields(self, points: Samples) -> tuple[Samples, Samples]:
        """Velocity (n, 3) and pressure (n,) together, which costs as much as one of them.

        Args:
            points: (n, 3), m.

        Raises:
            InputError: if one of them lies inside a solid or outside the tube (the sentence names point and part), is
                not finite, or has another shape.
        """
        velocity, pressure = self.field.fields(checked_points(points))
        if self.frame == "body":
            velocity = velocity - self.prediction.forward_velocity * self.heading
        return velocity, pressure

    def plane(
        self,
        plane: str = "xz",
        *,
        offset: str | float = 0.0,
        extent: str | float | None = None,
        resolution: int = PLANE_RESOLUTION,
        progress: Progress | None = None,
    ) -> xr.Dataset:
        """Velocity and pressure on a plane through or beside the robot.

        Args:
            plane: `xz` (side view), `xy` (from above) or `yz` (across the axis).
            offset: position of the plane on the axis across it, with its unit (``"-50 mm"``) or a float in m.
            extent: how far the plane reaches beyond the robot on every side, with its unit or a float in m;
                None: a little more than the robot's largest diameter. In a tube it ends at the glass.
            resolution: points along the plane's longer side.
            progress: called with stage, number done, and total.

        Returns:
            Dataset over two of `x`, `y`, `z` (m; the third is a scalar) with `velocity_x`, `velocity_y`,
            `velocity_z` (m/s), `pressure` (Pa), all NaN inside solids and outside the tube, and `inside`; settings in
            the attributes.

        Raises:
            InputError: for an unknown plane, a wrong length, or a grid too small or too large.
        """
        return self._on(plane_around(self.robot, plane, offset, extent, resolution, self.seat), progress)

    def volume(
        self,
        *,
        extent: str | float | None = None,
        resolution: int = VOLUME_RESOLUTION,
        progress: Progress | None = None,
    ) -> xr.Dataset:
        """Velocity and pressure in a box around the robot; arguments and result as for `plane`, over all of x, y, z.

        Raises:
            InputError: for a wrong length, or a grid too small or too large.
        """
        return self._on(box_around(self.robot, extent, resolution, self.seat), progress)

    def _on(self, grid: PointGrid, progress: Progress | None) -> xr.Dataset:
        dataset = dataset_on(grid, self.inside, self.fields, self.frame, progress, self.seat)
        return dataset.assign_attrs(_attributes(self))


def flow(
    robot: str | Path | Mapping[str, Any] | Robot,
    *,
    model: str = AUTO,
    tail_rate: str | float | None = None,
    friction: str | None = None,
    calibrated: bool = False,
    resolution: Resolution | Mapping[str, Any] | None = None,
    placement: Placement | Mapping[str, Any] | None = None,
    phase: str | float = 0.0,
    frame: str = "lab",
) -> Flow:
    """The flow around a robot that swims as `slender` or `tube` predicts; floats are in SI units, rates in rad/s.

    Lateral motion and tilt are held: the sideways force and torque that this takes at the given phase are in the flow.
    With `slender` nothing pushes along the axis, and the fluid is unbounded, even where the robot has a channel. With
    `tube` the fluid is that in the channel, the motion is the average over `model.tube.phases`, and the torque of the
    wire's own spin is left out. Closer to the wire than its radius the flow is that of a line of blobs.

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot.
        model: `slender` (unbounded fluid), `tube` (in the channel), or `auto`: `tube` for a robot in a channel.
        tail_rate: lab rotation rate of the tail, with its unit (``"1.2 Hz"``) or a float in rad/s; without it
            the robot's drive decides.
        friction: friction model, `none`, `rotor`, `body` or `paper`; None: the robot's own.
        calibrated: apply calibration factors to the motion. They represent walls that are not in the flow, which
            then pulls at the robot; without them it swims free of force.
        resolution: of the model: `accuracy`, and with `tube` also `tolerance` and `phases`; None: the robot's own, but
            accuracy `high` with `slender`. The flow of `standard` leaves out the torque of the wire's spin.
        placement: with `tube`, where in the channel the robot lies: `gap`, `eccentricity`, `pitch`, `yaw`,
            `tail_drop`, `ends`, `flow`, each a quantity with its unit or a float in SI.
        phase: phase phi of the tail, with its unit (``"90 deg"``) or a float in rad.
        frame: `lab` (that of the channel; unbounded fluid rests far away) or `body` (moving with the robot's forward
            velocity, not turning).

    Raises:
        InputError: for wrong input, or a robot outside the model's domain.
    """
    angle = parse_option("phase", phase, KINDS["angle"])
    check_choice("frame", frame, get_args(Frame))
    robot = load(robot)
    choice = _choice(model, robot, placement)
    wanted = Resolution.of(resolution)
    if wanted.accuracy is None and choice.model == "slender":
        wanted = wanted.model_copy(update={"accuracy": "high"})
        difference = "solved at accuracy 'high', where `predict` takes 'standard'"
        choice = replace(choice, reason=f"{choice.reason}, {difference}" if choice.reason else difference)
    prediction = predict_steady(
        robot,
        model=choice.model,
        tail_rate=tail_rate,
        friction=friction,
        calibrated=calibrated,
        resolution=wanted,
        placement=placement,
        band=False,
    )
    prediction = replace(prediction, choice=choice)
    around = Flow(prediction, _field(prediction, angle), angle, cast("Frame", frame))
    return around.with_held_force()


def _choice(model: str, robot: Robot, placement: Placement | Mapping[str, Any] | None) -> ModelChoice:
    """One of `FLOW_MODELS`, and why it is taken."""
    allowed = (AUTO, *FLOW_MODELS)
    if model not in allowed:
        raise InputError(
            f"model = {model!r}{did_you_mean(str(model), allowed)}; allowed: {', '.join(allowed)}, whose tractions "
            "give a flow"
        )
    return choose_model(model, robot, placement=Placement.of(placement))


def _field(prediction: Prediction, phase: float) -> FluidField:
    """The flow of the predicted motion."""
    seat = _tube_pose(prediction)
    forward = prediction.forward_velocity * (np.array([1.0, 0.0, 0.0]) if seat is None else seat.forward)
    body, rotor = (
        np.concatenate([forward, [rate, 0.0, 0.0]])
        for rate in (prediction.body_rotation_rate, prediction.tail_rotation_rate)
    )
    if seat is None:
        return flow_field(prediction.batch, body, rotor, phase)
    return tube_flow_field(prediction.batch, body, rotor, phase, prediction.plug_velocity)


def _tube_pose(prediction: Prediction) -> TubePose | None:
    return pose_of(prediction.batch) if prediction.model.name == "tube" else None


def find_tube_pose(
    robot: Robot,
    model: str,
    placement: Placement | Mapping[str, Any] | None = None,
    resolution: Resolution | Mapping[str, Any] | None = None,
) -> TubePose | None:
    """The tube and the robot's pose in it, before anything is solved; None with the model `slender`."""
    chosen = _choice(model, robot, placement).model
    if chosen != "tube":
        return None
    return pose_of(prepared(robot, chosen, placement=Placement.of(placement), resolution=resolution)[2])


def _attributes(flow: Flow) -> dict[str, Any]:
    """Provenance of the flow, as attributes of a file."""
    motion = flow.prediction
    return {
        "title": f"Flow around {motion.robot.name}",
        "robot": motion.robot.name,
        "model": motion.model.name,
        "friction": motion.friction,
        "calibrated": int(motion.calibrated),
        "frame": flow.frame,
        "phase": flow.phase,
        **{name: getattr(motion, name) for name in _MOTION},
        **({} if flow.seat is None else {"plug_velocity": motion.plug_velocity}),
        "held_force": flow.held_force,
        **({} if flow.lifted == 0.0 else {"lifted": flow.lifted}),
        "placement": json.dumps(motion.placement),
        "settings": json.dumps(motion.robot.model_dump(), sort_keys=True),
        "references": " ".join(motion.references),
        **note_attributes(flow.warnings),
        "versions": versions(),
        "Conventions": "CF-1.11",
    }


def flow_answer(flow: Flow, written: Mapping[Path, xr.Dataset]) -> dict[str, Any]:
    """The flow around a robot and what was computed of it, as `spirillum flow` prints them."""
    return with_notes_last(flow.to_dict(), files=[_file(path, dataset) for path, dataset in written.items()])


def _file(path: Path, dataset: xr.Dataset) -> dict[str, Any]:
    axes = [str(name) for name in dataset["inside"].dims]
    across = [axis for axis in "xyz" if axis not in axes]
    step = float(dataset[axes[0]][1] - dataset[axes[0]][0])
    found = {
        "file": str(path),
        "grid": {
            "points": {axis: int(dataset.sizes[axis]) for axis in axes},
            "spacing": quantity(step, "m"),
            **{axis: quantity(np.array([dataset[axis].min(), dataset[axis].max()]), "m") for axis in axes},
            **{axis: quantity(float(dataset[axis]), "m") for axis in across},
        },
        "points_inside": int(dataset["inside"].sum()),
        **dict(extremes(dataset)),
    }
    if across:
        through = float(dataset[f"velocity_{across[0]}"].fillna(0.0).integrate(axes))  # solids count as at rest
        unit = unit_of("flow_rate_through_plane")
        found["flow_rate_through_plane"] = quantity(through, unit, direction=f"+{across[0]}")
    return found


def extremes(dataset: xr.Dataset) -> Iterator[tuple[str, Any]]:
    """Largest speed, lowest and highest pressure on a grid, with their positions; empty if all of it is solid."""
    parts = [dataset[f"velocity_{axis}"] ** 2 for axis in "xyz"]
    speed = (parts[0] + parts[1] + parts[2]) ** 0.5
    if not bool(np.isfinite(speed).any()):
        return  # every point lies inside a solid
    for name, values, place in (
        ("largest_speed", speed, speed.argmax(...)),
        ("lowest_pressure", dataset["pressure"], dataset["pressure"].argmin(...)),
        ("highest_pressure", dataset["pressure"], dataset["pressure"].argmax(...)),
    ):
        there = values.isel(place)
        yield name, quantity(float(there), unit_of(name), at=quantity([float(there[axis]) for axis in "xyz"], "m"))
