"""Release of a robot: where and how, and its initial state, in unbounded fluid and in its tube."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import BeforeValidator

from spirillum.arrays import Samples
from spirillum.dynamics.free_robot import TwoLinks
from spirillum.dynamics.integration import Reach
from spirillum.dynamics.tube_robot import TubeRobot
from spirillum.errors import InputError
from spirillum.fitted.calibration_file import FittedContact
from spirillum.fluid.tube.library import THINNEST_GAP
from spirillum.formats.tables import read_series
from spirillum.kernels import core
from spirillum.robot.arguments import Options, file_path, in_range
from spirillum.robot.fields import Angle, Time
from spirillum.robot.geometry import Channel
from spirillum.robot.links import outlines_of
from spirillum.robot.load import with_resolution
from spirillum.robot.model_options import Resolution
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.robot.tube_pose import TubePose, gap_of, largest_gap
from spirillum.swimming.prediction import Prediction
from spirillum.units import KINDS, parse_option, show

TRIAL_WAIT = 60.0  #: Default time from release until the motor is switched on, s; assumed.
FLOW_COLUMNS = ("time_s", "flow_mm_s")
"""Columns of a flow file; between its rows the flow changes evenly, before and after them it is constant."""
_WHAT = "a flow file (CSV with the columns time_s and flow_mm_s)"
_LARGEST = 64 << 20
_LIMITS = dict(zip(FLOW_COLUMNS, ((0.0, 1e9), (-1e6, 1e6)), strict=True))


class InTube(Options, argument="in_tube", prefixed=True):
    """Start, surroundings and contact of a run in a tube, beside its placement."""

    azimuth: Angle = 0.0
    """Azimuth of the body's centre about +x from the lowest point of the tube.
    """
    wait: Time | None = None
    """Waiting time after release with the drive off, before the run; None: 60 s, as in a trial, in a flow none."""
    friction_coefficient: Annotated[float | None, BeforeValidator(in_range(0.0, 10.0))] = None
    """Coefficient of dry friction where asperities touch; None: 0.1, assumed; plausible 0 to 0.3, allowed 0 to 10."""
    flow: Annotated[str | Path | None, file_path("a flow file; a constant flow is placement.flow")] = None
    """File of the mean flow over time, CSV with the columns `time_s`, `flow_mm_s`, instead of `placement.flow`."""
    continued: Annotated[str | Path | None, file_path("the file of a run in a tube, by `spirillum simulate`")] = None
    """File of a run of the robot that ended early, continued after its last sample as if it had not ended."""

    def of_trial(self, placed: Placement) -> InTube:
        """These settings with the waiting time of a trial where none is given."""
        given = self.wait is not None or self.continued is not None
        moved = self.flow is not None or placed.flow is not None
        return self if given else self.model_copy(update={"wait": 0.0 if moved else TRIAL_WAIT})


class Release(NamedTuple):
    """Where and how a robot is released in its tube."""

    placement: Placement
    in_tube: InTube
    roughness: float | None = None  #: Height of the asperities, m; None: 1e-4 of the body's radius.
    weight: bool = True  #: Whether weight and buoyancy act.

    @classmethod
    def of(
        cls,
        placement: Placement | Mapping[str, Any] | None,
        in_tube: InTube | Mapping[str, Any] | None,
        roughness: str | float | None,
        *,
        weight: bool = True,
    ) -> Release:
        """From what a caller gives; a roughness with its unit, or a float in m."""
        height = None if roughness is None else parse_option("roughness", roughness, KINDS["length"])
        return cls(Placement.of(placement), InTube.of(in_tube), height, weight)

    def with_contact(self, contact: FittedContact) -> Release:
        """The release with fitted values in place of those that are not given."""
        requested = self.in_tube
        if requested.friction_coefficient is None and contact.friction_coefficient is not None:
            requested = requested.model_copy(update={"friction_coefficient": contact.friction_coefficient})
        return self._replace(
            in_tube=requested, roughness=contact.roughness if self.roughness is None else self.roughness
        )


def without_resolution(robot: Robot, resolution: Resolution | Mapping[str, Any] | None) -> Robot:
    """The robot with the form of its table; a resolution is refused in free motion, which reads it at every phase."""
    found = with_resolution(robot, resolution, "tube")  # a wrong value has a sentence of its own
    for name, value in Resolution.of(resolution).model_dump(exclude_none=True).items():
        if (name, value) not in (("form", "auto"), ("form", "table")):
            raise InputError(
                f"{name} = {value!r} with model 'tube' and motion 'free', which reads the robot's table at every phase "
                "of the tail; allowed: motion 'held'"
            )
    return found


def read_flow(path: str | Path) -> Samples:
    """Read and check a flow file: times, s, and velocities, m/s, (n, 2)."""
    found = read_series(path, _WHAT, _LIMITS, _LARGEST)
    return np.array(found) * (1.0, 1e-3)


def start_phase(robot: Robot) -> float:
    """Initial phase of the tail, rad: 0, of a left-handed one its mirror image unless it is one piece with the body."""
    return np.pi if robot.hand < 0 and robot.drive is not None and robot.drive.joint == "revolute" else 0.0


def _check(robot: Robot, placement: Placement) -> None:
    unset = Placement()
    kinds = {"yaw": "deg", "tail_drop": "mm", "ends": "", "flow": "mm/s"}
    for name, unit in kinds.items():
        value = getattr(placement, name)
        if value != getattr(unset, name):
            stated = show(value, unit) if unit else f"'{value}'"
            raise InputError(
                f"placement.{name} = {stated} has no effect in a free run without walls; allowed: gap or "
                "eccentricity, and pitch, or model 'tube'"
            )
    if robot.channel is None and (placement.gap is not None or placement.eccentricity is not None):
        name = "gap" if placement.gap is not None else "eccentricity"
        raise InputError(f"placement.{name} is set, but the robot has no channel; allowed: a pitch, or a [channel]")


def _pose(robot: Robot, placement: Placement, channel: Channel, *, lying: bool) -> TubePose:
    robot.check_body("motion beside the wall of a channel, with lubrication films,", ", or channel = 'none'")
    radius, body, pitch = 0.5 * channel.diameter, outlines_of(robot)["body"], placement.pitch or 0.0
    if placement.eccentricity is not None:
        return TubePose.of(placement, body, robot.body.diameter, radius)
    most = largest_gap(body, radius, pitch)
    if placement.gap is not None and placement.gap > most:
        raise InputError(f"placement.gap = {show(placement.gap, 'mm')}; allowed: at most {show(most, 'mm')}")
    if placement.gap is None and not lying:
        pose = TubePose(radius, 0.0, pitch)
        fits = pose.clearance(body) > 0
    else:
        gap = min(gap_of(placement, robot.body.diameter, radius), most)
        pose = TubePose.at_gap(body, radius, gap, pitch)
        fits = bool(np.isfinite(pose.offset))
    if not fits:
        raise InputError(f"placement.pitch = {show(pitch, 'deg')}: the body does not fit; allowed: a smaller pitch")
    return pose


def reach_of(robot: Robot) -> Reach:
    """How far a robot can go and be driven."""
    half = 0.5 * robot.body.length
    length = robot.channel.length if robot.channel is not None else None
    charge = robot.battery.capacity if robot.battery is not None else None
    return Reach(
        nose=half,
        tip=-half - robot.coupling.length - robot.tail.length,
        channel=np.inf if length is None else 0.5 * length,
        middle=-0.5 * (robot.coupling.length + robot.tail.length),  # where the robot's own middle is at first
        charge=np.inf if charge is None else charge,
    )


def turning_rate(steady: Prediction) -> float:
    """Steady rate of the tail, or of the field, rad/s, positive."""
    rate = steady.tail_rotation_rate
    if steady.robot.magnetic is not None:
        rate = steady.robot.magnetic.rotation_rate
    if rate == 0:
        kind = "duty" if steady.batch.drive == "dc-motor" else steady.batch.drive
        field = "magnetic.rotation_rate" if kind == "magnetic" else f"drive.{kind}"
        raise InputError(f"{field} = 0: the tail does not turn; allowed: any other, and `on` for switching off")
    return abs(rate)


def resting_state(robot: Robot, links: TwoLinks, placement: Placement) -> Samples:
    """The state of a robot at rest at its initial pose, (19,); a heavy one without a given gap starts low."""
    _check(robot, placement)
    offset, lying = 0.0, float(links.weight[: core.WEIGHT_MOMENT_BODY].sum()) > 0
    if robot.channel is not None:
        offset = _pose(robot, placement, robot.channel, lying=lying).offset
    start = state_at(offset, start_phase(robot), placement.pitch or 0.0)
    if not links.spots.size:
        return start
    film, rough = float(links.gaps(start)[0]), links.roughness
    if film > 0:
        return start
    gap = film + rough
    if gap > 0:
        raise InputError(
            f"roughness = {show(rough, 'um')} with a gap of {show(gap, 'um')} at the start; allowed: a roughness below "
            "the gap, or a larger placement.gap"
        )
    if placement.pitch:
        raise InputError(
            f"placement.pitch = {show(placement.pitch, 'deg')}: body or tail would cut into the wall; allowed: a "
            "smaller pitch, or a larger placement.gap"
        )
    raise InputError(
        f"the robot would start at the wall of channel.diameter = {show(2 * links.wall[core.WALL_RADIUS], 'mm')}; "
        "allowed: a larger placement.gap or a smaller placement.eccentricity"
    )


def state_at_release(robot: Robot, links: TubeRobot, placed: Placement, azimuth: float = 0.0) -> Samples:
    """The state of a robot at rest at a pose, (19,)."""
    radius, body, pitch = float(links.tube[core.TUBE_RADIUS]), outlines_of(robot)["body"], placed.pitch or 0.0
    offset = TubePose.of(placed, body, robot.body.diameter, radius).offset
    if not offset >= -1e-12 * radius:
        gap, most = gap_of(placed, robot.body.diameter, radius), largest_gap(body, radius, pitch, placed.yaw)
        raise InputError(
            f"placement.gap = {show(gap, 'mm')}: the body does not fit with that pitch and yaw; allowed: at most "
            f"{show(max(most, 0.0), 'mm')}, or a smaller pitch or yaw"
        )
    state = state_at(max(offset, 0.0), start_phase(robot), pitch, placed.yaw, azimuth)
    gaps = links.gaps(state)
    if gaps.min() <= 0.0:
        name = links.names[int(np.argmin(gaps))]
        raise InputError(
            f"placement: the {name} would cut {show(-float(gaps.min()), 'mm')} into the wall; allowed: a larger gap, a "
            "smaller pitch or yaw"
        )
    return state


def check_roughness(roughness: float, gap: float, diameter: float) -> None:
    """Refuse asperities that films thinner than a table holds would cover, or pressed by more than the weight."""
    if roughness < THINNEST_GAP * diameter:
        raise InputError(
            f"roughness = {show(roughness, 'um')}; allowed: at least {show(THINNEST_GAP * diameter, 'um')}, because "
            "thinner films are not resolved"
        )
    if gap < 0.5 * roughness:
        raise InputError(
            f"roughness = {show(roughness, 'um')} with a gap of {show(gap, 'um')} at the start: asperities would "
            "carry more than its weight; allowed: a roughness below twice the gap, or a larger gap"
        )


def released_state(robot: Robot, links: TubeRobot, placed: Placement, azimuth: float) -> Samples:
    """The state of a robot at rest at a pose that its asperities allow and its table holds, (19,)."""
    state = state_at_release(robot, links, placed, azimuth)
    gap = float(links.gaps(state).min())
    check_roughness(links.roughness, gap, robot.body.diameter)
    if links.observe_state(state)[core.SEEN_OUTSIDE]:
        raise InputError(
            f"placement: a gap of {show(gap, 'mm')} with that pitch and yaw lies outside the robot's table; allowed: a "
            "pose nearer to level"
        )
    return state


def state_at(offset: float, phase: float, pitch: float, yaw: float = 0.0, azimuth: float = 0.0) -> Samples:
    """The state, (19,), of a robot at rest whose body's mid-length is at an offset, m, and its angles, rad."""
    from scipy.spatial.transform import Rotation

    state = np.zeros(core.STATE_SIZE)
    # The azimuth is that of the body's mid-length about +x from the lowest point of the tube, where the pitch raises
    # the nose from the wall, and the yaw turns it to +y.
    turned = Rotation.from_euler("XZY", [azimuth, yaw, -pitch])
    state[core.STATE_ATTITUDE : core.STATE_ATTITUDE + 4] = turned.as_quat(scalar_first=True)
    state[core.STATE_PHASE] = phase
    state[core.STATE_POSITION + 1] = offset * np.sin(azimuth)
    state[core.STATE_POSITION + 2] = -offset * np.cos(azimuth)
    return state
