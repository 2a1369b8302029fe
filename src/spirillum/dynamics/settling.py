"""Settling of a robot after release in its tube: drainage of its film, and its steady state.

It is the free motion of `spirillum.predict` with the trajectory: the same run, the same steady motion.

The film under a level robot: what resists its sinking, and what pushes it sideways as it swims.
In thin films the resistance to sinking approaches 3 sqrt(2) pi mu L (a_e/h)^(3/2), 1/a_e = 1/a - 1/R, for a cylinder
of length L and radius a (the limit of Jeffrey and Onishi, Q. J. Mech. Appl. Math. 34:129, 1981), so that the gap of a
level cylinder falls as 1/time^2. A body that turns is pushed in the direction of its lowest line, as a
journal is in its bearing (W. J. Harrison, Trans. Cambridge Philos. Soc. 22:39, 1913).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from spirillum.answer_entries import answer_of
from spirillum.arrays import Samples
from spirillum.display import DisplayMixin
from spirillum.dynamics.free_motion import FreeMotion, free_motion
from spirillum.dynamics.release import InTube
from spirillum.dynamics.run_summary import state_of
from spirillum.errors import InputError
from spirillum.fitted.fit import read_fit
from spirillum.fluid.tube.library import find_table
from spirillum.fluid.tube.table import TubeTable
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.kernels import core
from spirillum.notes import Note
from spirillum.progress import Progress
from spirillum.robot.load import load
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.swimming.motions import SteadyState
from spirillum.swimming.prediction import Prediction, predict_steady
from spirillum.swimming.preparation import IN_CHANNEL
from spirillum.units import KINDS, parse_option

_U, _SIDE, _UP, _ROLL, _JOINT = 0, 1, 2, 3, 6
_PHASES = 8


class LubricationFilm(NamedTuple):
    """What the fluid does to a level robot that swims at one gap, held to its course; SI, means over phases."""

    gap: float  #: Smallest distance of body and wall, m.
    normal_resistance: float
    """Resistance to sinking of a robot that is free along the tube and in its body's rotation, N s/m."""
    sideways_force: float  #: Along the wall, towards a positive azimuth, N.


def film_at(motion: Prediction, table: TubeTable, gap: float, offset: float) -> LubricationFilm:
    """The film under a level robot."""
    phases = 2.0 * np.pi * np.arange(_PHASES) / _PHASES
    matrices = [table.at(offset, phase=float(phase))[0][:7, :7] for phase in phases]
    full: Samples = motion.robot.fluid.viscosity * np.mean(matrices, axis=0)
    free = [_U] if motion.batch.joint == "fixed" else [_U, _ROLL]
    inner = np.linalg.solve(full[np.ix_(free, free)], full[np.ix_(free, [_UP])])
    resistance = float(full[_UP, _UP] - (full[np.ix_([_UP], free)] @ inner)[0, 0])
    rates = np.zeros(7)
    rates[_U], rates[_ROLL], rates[_JOINT] = (
        motion.forward_velocity,
        motion.body_rotation_rate,
        motion.motor_rotation_rate,
    )
    return LubricationFilm(gap, resistance, -float(full[_SIDE] @ rates))


def lubrication_resistance(viscosity: float, length: float, radius: float, tube_radius: float, gap: float) -> float:
    """S_z of a long cylinder in a thin film at the wall of a round tube, 3 sqrt(2) pi mu L (a_e/h)^(3/2), N s/m."""
    curvature = 1.0 / radius - 1.0 / tube_radius
    return float(3.0 * np.sqrt(2.0) * np.pi * viscosity * length * (curvature * gap) ** -1.5)


_SHARE = 0.2  # Gap until which drainage is timed over that at the start, where none is given.
_TURNS = 30  # Turns of the tail that the path shows at least.
_FILMS = 5  # Gaps at which the film is stated.
_SAMPLES = 400  # Samples of the trajectory in an answer.


@dataclass(frozen=True, repr=False)
class Settling(DisplayMixin):
    """Settling of a robot, SI; azimuths about +x from the lowest point of the tube."""

    prediction: Prediction  #: The steady motion that it reaches, means over a turn of the tail.
    until: float  #: Gap to which the drainage is timed, m.
    films: tuple[LubricationFilm, ...]
    """The film under the level robot, at gaps from the start to `until`; none where it starts on the axis."""
    _free: FreeMotion = field(repr=False)

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.prediction.robot

    @property
    def steady_state(self) -> SteadyState:
        """The steady state."""
        return self._free.run.lying

    @property
    def weight(self) -> float:
        """Submerged weight that acts, N; negative for a robot that floats."""
        return float(self._free.robot.weight[: core.WEIGHT_MOMENT_BODY].sum())

    @property
    def weight_uncertainty(self) -> float | None:
        """Uncertainty of that weight where mass and volume are each known to 1 %, N; None without masses."""
        found = self.robot.derived().get("weight_uncertainty")
        return None if found is None or not self.weight else found.value

    @property
    def roughness(self) -> float:
        """Height of the asperities, m."""
        return self._free.robot.roughness

    @property
    def friction_coefficient(self) -> float:
        """Coefficient of dry friction."""
        return float(self._free.robot.tube[core.TUBE_COEFFICIENT])

    def trajectory(self, name: str) -> Samples:
        """The time, gap, azimuth, pitch, yaw, contact_force, x or roll at every step of the run."""
        return self._free.run.path.of(name)

    @property
    def drainage_time(self) -> float:
        """Time until the gap first falls to `until`, s; NaN where it was not seen to."""
        return self._free.run.path.first_below(self.until)

    @property
    def passing(self) -> dict[str, float]:
        """Azimuth, pitch and yaw (rad), and speed (m/s) and body rate (rad/s) over a turn, as it passes `until`."""
        moment, time = self.drainage_time, self.trajectory("time")
        half = 0.5 * self._free.run.turn.time
        names = {"azimuth": "azimuth", "wall_pitch": "pitch", "wall_yaw": "yaw"}
        found = {name: float(np.interp(moment, time, self.trajectory(way))) for name, way in names.items()}
        ends = np.clip([moment - half, moment + half], time[0], time[-1])
        for name, way in (("forward_velocity", "x"), ("body_rotation_rate", "roll")):
            found[name] = float(np.diff(np.interp(ends, time, self.trajectory(way)))[0] / np.diff(ends)[0])
        return found if np.isfinite(moment) else dict.fromkeys(found, np.nan)

    @property
    def lubrication_ratios(self) -> Samples:
        """Resistance to sinking over that of the straight side in a thin film; NaN for a body without one."""
        robot = self._free.robot
        body = robot.sites[robot.sites[:, core.SITE_ROTOR] == 0]
        length = float(np.ptp(body[:, core.SITE_X]))
        a, viscosity = 0.5 * self.robot.body.diameter, self.robot.fluid.viscosity
        radius = float(robot.tube[core.TUBE_RADIUS])
        thin = [lubrication_resistance(viscosity, length, a, radius, film.gap) for film in self.films]
        return np.array([f.normal_resistance for f in self.films]) / thin if length > 0 else np.full(len(thin), np.nan)

    @property
    def warnings(self) -> tuple[Note, ...]:
        """What to be careful about, a sentence each."""
        return self.prediction.warnings

    def to_dict(self) -> dict[str, Any]:
        """The answer of `spirillum settle --json`."""
        count = self.trajectory("time").size
        shown = np.unique(np.linspace(0, count - 1, min(_SAMPLES, count)).astype(int))
        names = {name: name for name in ("time", "gap", "azimuth")} | {"wall_pitch": "pitch", "wall_yaw": "yaw"}
        names |= {"contact_force": "contact_force"}
        film: dict[str, Any] = {
            name: [getattr(film, name) for film in self.films] for name in ("gap", "normal_resistance")
        }
        film["over_lubrication"] = self.lubrication_ratios
        film["sideways_force"] = [film.sideways_force for film in self.films]
        return answer_of(
            self,
            model_reason=IN_CHANNEL,
            state=state_of(self.steady_state, self.warnings),
            path={name: self.trajectory(way)[shown] for name, way in names.items()},
            film=film,
            error_estimate=self.prediction.to_dict()["error_estimate"],
        )


def settle(
    robot: str | Path | Mapping[str, Any] | Robot,
    *,
    tail_rate: str | float | None = None,
    friction: str | None = None,
    calibration: str | Path | None = None,
    placement: Placement | Mapping[str, Any] | None = None,
    weight: bool = True,
    roughness: str | float | None = None,
    in_tube: InTube | Mapping[str, Any] | None = None,
    until: str | float | None = None,
    progress: Progress | None = None,
) -> Settling:
    """Follow a robot from rest in its tube to its steady state; floats are in SI units, rates in rad/s.

    The run is that of `spirillum.simulate` with the model `tube`, from the robot's table, which is made first where
    there is none; it is followed until a turn of the tail no longer changes where the robot lies.

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot.
        tail_rate: lab rotation rate of the tail, with its unit (``"1.2 Hz"``) or a float in rad/s; without it
            the robot's drive decides.
        friction: friction model, `none`, `rotor`, `body` or `paper`; None: the robot's own.
        calibration: calibration file whose friction, roughness and coefficient of dry friction replace the robot's.
        placement: where it is released: `gap` or `eccentricity`, `pitch`, `yaw`; `ends` of the channel, or a `flow`.
        weight: let weight and buoyancy act, if the masses are known.
        roughness: height of the asperities, with its unit or a float in m; None: 1e-4 of the body's radius.
        in_tube: `azimuth` of the start and `friction_coefficient`, see `spirillum.simulate`.
        until: gap at the end of the drainage time, with its unit or a float in m; None: a fifth of that at
            the start.
        progress: called with stage, number done, and total.

    Raises:
        InputError: for wrong input, a robot outside the model's domain, or a motion that cannot be followed.
    """
    gap = None if until is None else parse_option("until", until, KINDS["length"])
    free = free_motion(
        load(robot),
        tail_rate=tail_rate,
        friction=friction,
        fit=read_fit(calibration),
        placement=placement,
        weight=weight,
        roughness=roughness,
        in_tube=in_tube,
        until=gap,
        turns_shown=_TURNS,
        progress=progress,
    )
    last = _SHARE * free.start_gap if gap is None else gap
    return Settling(free.prediction, last, _films(free, free.start_gap, last), free)


def _films(free: FreeMotion, first: float, last: float) -> tuple[LubricationFilm, ...]:
    """The film at gaps of the trajectory, where the model `tube` resolves it."""
    motion, robot = free.prediction, free.robot
    radius = float(robot.tube[core.TUBE_RADIUS])
    table = find_table(RobotGeometry.of(motion.batch), radius, "yaw")
    found: list[LubricationFilm] = []
    if table is None:
        return ()
    for gap in np.geomspace(first, last, _FILMS):
        placed = Placement.of({"gap": float(gap), "pitch": 0.0, "ends": motion.batch.placement.ends})
        try:
            held = predict_steady(
                motion.robot, model="tube", tail_rate=motion.tail_rotation_rate, placement=placed, band=False
            )
        except InputError:  # thinner than the model resolves
            continue
        found.append(film_at(held, table, float(gap), radius - 0.5 * motion.robot.body.diameter - float(gap)))
    return tuple(found)
