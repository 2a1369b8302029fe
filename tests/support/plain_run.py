"""A run in a tube by a plain integration: an independent solution for tests.

At each pose the film under the body is Reynolds' equation in two dimensions, by finite elements and with its cavity,
in place of the table's film and the slices of csrc/; asperities, dry friction, weight and motor are written out with
NumPy, and SciPy steps in time. It takes the outer part of the resistance from the program: the table less its film.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation
from tests.support.reynolds import film_at

from spirillum.dynamics.free_robot import drive_of, weight_of
from spirillum.dynamics.run_file import robot_of
from spirillum.fluid.tube.library import tables_of
from spirillum.fluid.tube.tube import END_LOSS
from spirillum.kernels import core
from spirillum.kernels.core import resistance_at
from spirillum.kernels.tube_table import film_start
from spirillum.robot.batch import RobotBatch

REFERENCE = 20e-6
"""Gap, m, at which the table's film and that of the elements are made equal: how a film fades out is a matter of
definition, what it gains as it thins is not."""
SIDE = slice(0, 2)
DIFFERENCES = np.array([1e-10, 1e-10, 1e-8, 1e-8, 1e-8, 1e-8, 1e-4, 1e-5])
ERRORS = np.array([1e-9, 1e-9, 1e-7, 1e-7, 1e-7, 1e-7, 1e-3, 1e-4, 1e-6, 1e-4])
"""Of the state: y, z, attitude, tail phase, current; x, roll. A tenth of them changes means of a turn by 2e-4."""


class Means(NamedTuple):
    """Of a stretch of time: speed, m/s, rate of the body, rad/s, and smallest gap, m, in the median."""

    speed: float
    body_rate: float
    gap: float


class Film(NamedTuple):
    """Force of the film on the six rates of the body, affine about them: -matrix q + force."""

    matrix: np.ndarray
    force: np.ndarray
    is_settled: bool


@dataclass
class PlainRun:
    """The paper's robot in its tube; its tail may not touch the wall."""

    run: Any
    cells: tuple[int, int] = (45, 45)

    def __post_init__(self) -> None:
        self.robot = robot_of(self.run)
        robot, batch = self.robot, RobotBatch.of(self.robot)
        body, fluid = robot.body, robot.fluid
        self.table: Any = tables_of(batch)[0].packed
        self.radius, self.tube, self.half = 0.5 * body.diameter, 0.5 * robot.channel.diameter, 0.5 * body.length
        self.ball = body.rounding(body.front_end)
        self.eta, self.bound = fluid.viscosity, fluid.cavitation_pressure or np.inf
        self.weight, self.drive = weight_of(robot), drive_of(batch)
        self.channel = robot.channel.length + END_LOSS * self.tube
        self.rough, self.slow = (float(self.run.attrs[name]) for name in ("roughness", "sliding_speed"))
        self.slipping = float(self.run.attrs["friction_coefficient"])
        # Asperities carry W at half their height: the larger of weight and stall torque over the half-length.
        stall = (
            self.drive[core.DRIVE_TORQUE_CONSTANT] * self.drive[core.DRIVE_VOLTAGE] / self.drive[core.DRIVE_CONSTANT]
        )
        self.load = max(np.abs(self.weight[:2]).sum(), stall / self.half)
        self.q, self.active = np.zeros(7), None
        self.correction = np.zeros((6, 6))
        pose = np.array([0.0, -(self.tube - self.radius - REFERENCE), 1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
        place, axes = self._place(pose)
        self.correction = self.eta * self._table_film(place) - self._film(pose, axes, np.zeros(6), np.inf).matrix

    def _place(self, state: np.ndarray) -> tuple[tuple[float, float, float, float], np.ndarray]:
        """Offset, pitch, yaw and roll of the body, and its axes in the lab as columns."""
        axes = Rotation.from_quat(state[2:6], scalar_first=True).as_matrix()
        side = state[SIDE]
        e, d, y = float(np.hypot(*side)), axes[:, 0], axes[:, 1]
        z_loc = np.array([0.0, *(-side / e)])
        y_loc = np.cross(z_loc, [1.0, 0.0, 0.0])
        pitch, yaw = np.arcsin(d @ z_loc), np.arctan2(d @ y_loc, d[0])
        across = np.array([-np.sin(yaw), 0.0, 0.0]) + np.cos(yaw) * y_loc
        return (e, float(pitch), float(yaw), float(np.arctan2(y @ np.cross(d, across), y @ across))), axes

    def _table_film(self, place: tuple[float, float, float, float]) -> np.ndarray:
        film = np.empty((6, 6))
        core.film_at(self.table[film_start(self.table) :], *place[:3], film)
        return film

    def _outer(self, place: tuple[float, float, float, float], phase: float) -> np.ndarray:
        """Resistance without the film, with what both films differ by at the reference, in body axes (8, 8)."""
        out = np.empty((8, 8))
        resistance_at(self.table, *place[:3], place[3] + phase, out)
        out *= self.eta
        out[:6, :6] += self.correction - self.eta * self._table_film(place)
        turn = about_x(-place[3])
        return turn @ out @ turn.T

    def _film(self, state: np.ndarray, axes: np.ndarray, rates: np.ndarray, bound: float) -> Film:
        """The film at rates, affine with the cavity as it is found there; in body axes."""
        cylinder, to_film = film_at(self.robot, np.array([0.0, *state[SIDE]]), axes, self.cells)
        matrix, force, self.active, settled = cylinder.affine(to_film @ rates, self.eta, bound, self.active)
        return Film(to_film.T @ matrix @ to_film, to_film.T @ force, settled)

    def _contacts(self, state: np.ndarray, axes: np.ndarray) -> list[tuple[float, np.ndarray, np.ndarray]]:
        """Load, row that closes the gap and two rows of sliding of the rounded front and of the rear edge."""
        origin, found = np.array([0.0, *state[SIDE]]), []

        def rim(angle: float) -> np.ndarray:
            return np.array([-self.half, self.radius * np.cos(angle), self.radius * np.sin(angle)])

        down = axes.T @ (origin * [0.0, 1.0, 1.0])
        below = float(np.arctan2(down[2], down[1]))
        reach = minimize_scalar(
            lambda angle: -np.hypot(*(origin + axes @ rim(angle))[1:]),
            bounds=(below - 0.5, below + 0.5),
            method="bounded",
            options={"xatol": 1e-9},
        )
        front = np.array([self.half - self.ball, 0.0, 0.0])
        for point, ball in ((front, self.ball), (rim(reach.x), 0.0)):
            place = origin + axes @ point
            away = float(np.hypot(*place[1:]))
            normal = axes.T @ (np.array([0.0, *place[1:]]) / away)
            touched, gap = point + ball * normal, self.tube - away - ball
            if gap >= self.rough:
                continue
            ways = [normal, axes[0], np.cross(axes[0], normal)]
            rows = np.array([[*way, *np.cross(touched, way), 0.0] for way in ways])
            found.append((self.load * (self.rough / gap - 1.0) ** 2, rows[0], rows[1:]))
        return found

    def rates(self, state: np.ndarray) -> np.ndarray:
        """Rates q at which the forces balance."""
        place, axes = self._place(state)
        outer = self._outer(place, float(state[6]))
        opened = 1.0 / (8.0 * np.pi * self.channel * self.eta + outer[7, 7])
        own = outer[:7, :7] - opened * np.outer(outer[:7, 7], outer[7, :7])
        own[6, 6] += self.robot.motor.rotor_friction
        down, moments = -axes[2], self.weight[2:].reshape(2, 3)
        rotor = about_x(float(state[6]))[:3, :3] @ moments[1]
        force = np.concatenate(
            [self.weight[:2].sum() * down, np.cross(moments[0] + rotor, down), np.cross(rotor, down)[:1]]
        )
        force[6] += self.drive[core.DRIVE_POLARITY] * self.drive[core.DRIVE_TORQUE_CONSTANT] * state[7]
        contacts = self._contacts(state, axes)
        for load, closing, _ in contacts:
            force = force - load * closing
        q = self.q
        for _ in range(30):
            film = self._film(state, axes, q[:6], self.bound)
            matrix, right = own.copy(), force.copy()
            matrix[:6, :6] += film.matrix
            right[:6] += film.force
            before, q = q, self._balanced(matrix, right, contacts, q)
            if film.is_settled and np.abs(q - before).max() < 1e-7 * np.abs(q).max():
                break
        self.q = q
        return q

    def _balanced(
        self, matrix: np.ndarray, right: np.ndarray, contacts: list[tuple[float, np.ndarray, np.ndarray]], q: np.ndarray
    ) -> np.ndarray:
        """Newton's method for dry friction."""
        for _ in range(100):
            left, slope = right - matrix @ q, matrix.copy()
            for load, _, rows in contacts:
                slip = rows @ q
                size = np.sqrt(slip @ slip + self.slow**2)
                left = left - self.slipping * load * rows.T @ slip / size
                slope += self.slipping * load * rows.T @ (np.eye(2) / size - np.outer(slip, slip) / size**3) @ rows
            step = np.linalg.solve(slope, left)
            q = q + step
            if np.abs(step).max() < 1e-10 * np.abs(q).max():
                break
        return q

    def derivative(self, _: float, state: np.ndarray) -> np.ndarray:
        """Time derivative of a state."""
        q = self.rates(state)
        axes = Rotation.from_quat(state[2:6], scalar_first=True).as_matrix()
        moved, (w, x, y, z) = axes @ q[:3], state[2:6]
        turning = 0.5 * np.array([[-x, -y, -z], [w, -z, y], [z, w, -x], [-y, x, w]]) @ q[3:6]
        drive, current = self.drive, float(state[7])
        supply = drive[core.DRIVE_VOLTAGE] - drive[core.DRIVE_INTERNAL_RESISTANCE] * abs(current)
        constant, decay, fall, growth, rise, slope = drive[core.DRIVE_CONSTANT : core.DRIVE_SLOPE + 1]
        resistance = constant + decay * np.exp(-fall * abs(current)) + growth * np.exp(rise * abs(current))
        resistance += slope * abs(current)
        emf = drive[core.DRIVE_BACK_EMF] * drive[core.DRIVE_POLARITY] * q[6]
        change = (supply - resistance * current - emf) / drive[core.DRIVE_INDUCTANCE]
        return np.concatenate([moved[1:], turning, [q[6], change, moved[0], q[3]]])

    def _slopes(self, time: float, state: np.ndarray) -> np.ndarray:
        here, out = self.derivative(time, state), np.zeros((state.size, state.size))
        for n, step in enumerate(DIFFERENCES):
            out[:, n] = (self.derivative(time, state + step * np.eye(state.size)[n]) - here) / step
        return out

    def state_at(self, sample: int) -> np.ndarray:
        """The run's state at a sample."""
        now = self.run.isel(time=sample)
        side, attitude = now["position"].values[1:], now["attitude"].values
        rest = [float(now["tail_phase"]), float(now["motor_current"]), 0.0, 0.0]
        return np.concatenate([side, attitude, rest])

    def integrate(self, first: int, last: int) -> tuple[Means, Means]:
        """Means between two samples: of the plain integration that begins at the first, and of the run."""
        time, start = self.run["time"].values, self.state_at(first)
        samples = np.arange(first, last + 1)
        found = solve_ivp(
            self.derivative, (time[first], time[last]), start, method="BDF", t_eval=time[samples], jac=self._slopes,
            rtol=1e-10, atol=ERRORS, first_step=1e-4,
        )  # fmt: skip
        lasted = time[last] - time[first]
        gaps = [self._gap(state) for state in found.y.T]
        own = Means(found.y[8, -1] / lasted, found.y[9, -1] / lasted, float(np.median(gaps)))
        x = self.run["position"].values[:, 0]
        turned = float(self.run["body_angle"][last] - self.run["body_angle"][first])
        gap = float(self.run["wall_gap"][samples].median())
        return own, Means((x[last] - x[first]) / lasted, turned / lasted, gap)

    def _gap(self, state: np.ndarray) -> float:
        """Smallest gap of front and rear edge, m."""
        _, axes = self._place(state)
        origin = np.array([0.0, *state[SIDE]])
        front = origin + (self.half - self.ball) * axes[:, 0]
        angles = np.linspace(0.0, 2.0 * np.pi, 20001)
        rim = np.stack([0.0 * angles - self.half, self.radius * np.cos(angles), self.radius * np.sin(angles)])
        rear = origin[:, None] + axes @ rim
        return self.tube - max(float(np.hypot(*front[1:])) + self.ball, float(np.hypot(rear[1], rear[2]).max()))


def about_x(phase: float) -> np.ndarray:
    """Velocities and rotations turned about x; the joint's rate and the mean flow as they are."""
    found = np.eye(8)
    for first in (1, 4):
        found[first : first + 2, first : first + 2] = [[np.cos(phase), -np.sin(phase)], [np.sin(phase), np.cos(phase)]]
    return found
