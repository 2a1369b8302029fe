"""Reynolds' equation under a short cylinder in a tube by finite elements: an independent solution for tests.

With the wall at rest the pressure p of a motion v of the body obeys

    div(h^3/12 eta grad p) = div(h v_t)/2 - v.n,    p = 0 on the edges,

on the body's surface, n its normal, v_t the part of v along it, h its distance from the wall. Elements are bilinear in
x along the axis and t around it, from the line that is nearest to the wall. With a bound p >= -p_c the pressure is the
least one that takes up no less than what the gap opens (Swift, Stieber): a linear complementarity problem, solved by
its active set.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.sparse import coo_matrix, csc_matrix, diags
from scipy.sparse.linalg import splu, spsolve
from scipy.spatial.transform import Rotation

from spirillum.dynamics.run_file import robot_of

_ROUNDS = 60
_GAUSS = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)


@dataclass(frozen=True)
class ShortCylinder:
    """A cylinder at a pose in a tube, its rear end flat and its front flat or rounded; m, rad.

    Motions 0 to 5 are U and Omega about its middle in the frame of `film_resistance`: x' along its axis, y' level.
    """

    radius: float
    length: float
    tube: float
    offset: float
    """e of its middle."""
    pitch: float = 0.0
    """Nose away from the wall."""
    yaw: float = 0.0
    """Nose to +y."""
    cells: tuple[int, int] = (90, 90)
    rounded: float = 0.0
    """Radius of the front end beyond the length."""

    @cached_property
    def frame(self) -> np.ndarray:
        """x', y' and z' as rows: along the tube, to the side, towards its axis."""
        return Rotation.from_euler("ZY", [self.yaw, -self.pitch]).as_matrix().T

    @cached_property
    def grid(self) -> tuple[np.ndarray, np.ndarray]:
        """Nodes along the axis and around, as fine at the ends and about the nearest line as films are wide."""
        half = 0.5 * self.length
        ends = np.hypot(*(self._axis(np.array([-half, half]))[1:]))
        bend = self.radius * self.tube / (self.tube - self.radius)
        width = np.sqrt(2.0 * bend * max(self.tube - self.radius - ends.max(), 1e-8))

        def graded(reach: float, count: int) -> np.ndarray:
            return width * np.sinh(np.linspace(0.0, np.arcsinh(reach / width), count + 1))

        from_end = graded(half, self.cells[0] // 2)
        x = np.concatenate([from_end - half, half - from_end[-2::-1]])
        if self.rounded > 0.0:
            x = np.append(x, half + graded(0.3 * self.rounded, self.cells[0] // 4)[1:])
        t = graded(0.35 * self.radius, self.cells[1] // 2)
        return x, np.concatenate([-t[:0:-1], t])

    def _axis(self, x: np.ndarray) -> np.ndarray:
        """Points of the axis (3, ...): along the tube, to the side, towards the tube's axis."""
        return np.multiply.outer(self.frame[0], x) - np.multiply.outer([0.0, 0.0, self.offset], np.ones_like(x))

    def _nearest(self, x: np.ndarray) -> np.ndarray:
        """Angle about x' from y' to z' of the line that is nearest to the wall."""
        side, up = np.tensordot(self.frame[1:, 1:], self._axis(x)[1:], 1)
        return np.arctan2(up, side)

    @cached_property
    def _assembled(self) -> tuple[csc_matrix, np.ndarray, np.ndarray]:
        """Stiffness times the viscosity, loads (nodes, 6) and shear over it (6, 6); nodes within the edges."""
        x, t = self.grid
        dx, dt = np.diff(x), np.diff(t)
        values = np.array([1.0 - _GAUSS, _GAUSS])  # (ends, points)
        at_x, at_t = (grid[:-1, None] + step[:, None] * _GAUSS for grid, step in ((x, dx), (t, dt)))
        # Axes: cells along, points along, cells around, points around.
        at_x, at_t = at_x[:, :, None, None], at_t[None, None]
        beyond = np.clip(at_x - 0.5 * self.length, 0.0, self.rounded)
        radius = self.radius - self.rounded + np.sqrt(self.rounded**2 - beyond**2)
        slope = -beyond / np.sqrt(self.rounded**2 - beyond**2) if self.rounded > 0.0 else 0.0 * beyond
        small = 1e-7 * self.length
        turning = (self._nearest(at_x + small) - self._nearest(at_x - small)) / (2.0 * small)
        angle = self._nearest(at_x) + at_t / self.radius
        c, s, zero = np.cos(angle), np.sin(angle), 0.0 * angle
        size = np.sqrt(1.0 + slope**2) + zero
        out = np.stack([-slope / size, c / size, s / size])
        along, around = np.stack([1.0 / size, slope * c / size, slope * s / size]), np.stack([zero, -s, c])
        point = np.stack([at_x + zero, radius * c, radius * s])
        away = np.tensordot(self.frame.T, point, 1) - np.array([0.0, 0.0, self.offset]).reshape(3, 1, 1, 1, 1)
        h = self.tube - np.hypot(away[1], away[2])
        units = np.broadcast_to(np.eye(3).reshape((3, 3) + (1,) * 4), (3, *point.shape))
        v = np.concatenate([units, np.cross(units, point[None], axis=1)])  # (6, 3, ...)
        through, slid_x, slid_t = (np.einsum("mi...,i...->m...", v, way) for way in (out, along, around))
        area = 0.25 * dx[:, None, None, None] * dt[:, None] * size * radius / self.radius
        # Gradients of the four functions of a cell along and around, at its points.
        f_x, f_t = values[:, None, None, :, None, None], values[None, :, None, None, None, :]
        d_x = np.array([-1.0, 1.0]).reshape(2, 1, 1, 1, 1, 1) / dx[:, None, None, None] * f_t
        d_t = np.array([-1.0, 1.0]).reshape(1, 2, 1, 1, 1, 1) / dt[:, None] * f_x
        g_x, g_t = (d_x - self.radius * turning * d_t) / size, d_t * self.radius / radius
        mobility = area * h**3 / 12.0
        matrix = np.einsum("ijapbq,klapbq,apbq->ijklab", g_x, g_x, mobility, optimize=True)
        matrix += np.einsum("ijapbq,klapbq,apbq->ijklab", g_t, g_t, mobility, optimize=True)
        load = np.einsum("ijapbq,mapbq,apbq->ijabm", f_x * f_t, through, area, optimize=True)
        for gradient, slid in ((g_x, slid_x), (g_t, slid_t)):
            load += np.einsum("ijapbq,mapbq,apbq->ijabm", gradient, slid, 0.5 * area * h, optimize=True)
        thin = area / h / (1.0 + (h / (0.2 * self.radius)) ** 2)
        shears = sum(np.einsum("mapbq,napbq,apbq->mn", slid, slid, thin, optimize=True) for slid in (slid_x, slid_t))
        number = np.full((x.size, t.size), -1)
        number[1:-1, 1:-1] = np.arange((x.size - 2) * (t.size - 2)).reshape(x.size - 2, t.size - 2)
        nodes = np.array([[number[i : i + dx.size, j : j + dt.size] for j in (0, 1)] for i in (0, 1)])
        rows, columns = np.broadcast_arrays(nodes[:, :, None, None], nodes[None, None])
        inside, count = (rows >= 0) & (columns >= 0), number.max() + 1
        stiffness = coo_matrix((matrix[inside], (rows[inside], columns[inside])), shape=(count, count)).tocsc()
        loads = np.zeros((count + 1, 6))
        np.add.at(loads, nodes, load)
        return stiffness, loads[:-1], np.asarray(shears)

    @cached_property
    def _factors(self) -> Any:
        return splu(self._assembled[0])

    def solve(self, rates: dict[int, float], viscosity: float, bound: float = np.inf) -> tuple[np.ndarray, np.ndarray]:
        """Generalised forces of the pressure on the body (6,), and the pressure at the nodes.

        Args:
            rates: rates of the motions 0 to 5.
            viscosity: Pa s.
            bound: p_c, Pa.
        """
        matrix, loads, _ = self._assembled
        load = loads @ np.array([viscosity * rates.get(motion, 0.0) for motion in range(6)])
        p = self._factors.solve(load)
        active = p < -bound
        for _ in range(_ROUNDS):
            if not active.any():
                break
            p = np.full(p.size, -bound)
            free = ~active
            p[free] = spsolve(matrix[free][:, free], load[free] - matrix[free][:, active] @ p[active])
            now = np.where(active, matrix @ p > load, p < -bound)
            if (now == active).all():
                break
            active = now
        return -loads.T @ p, p

    def affine(
        self, rates: np.ndarray, viscosity: float, bound: float, active: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool]:
        """Forces of pressure and shear, -K q + f as long as its cavity is that which is guessed.

        Args:
            rates: of the motions 0 to 5 (6,).
            viscosity: Pa s.
            bound: p_c, Pa.
            active: nodes that cavitate, a guess.

        Returns:
            K, f, the nodes that cavitate at these rates and that pressure, and whether the guess was right.
        """
        matrix, loads, shears = self._assembled
        load, width = viscosity * loads, self.grid[1].size - 1
        cavity = np.zeros(len(load), dtype=bool) if active is None else active
        free, held = ~cavity, np.where(cavity, -bound if cavity.any() else 0.0, 0.0)
        pressed = diags(free.astype(float)) @ matrix @ diags(free.astype(float)) + diags(cavity.astype(float))
        bands = np.zeros((width + 1, len(load)))
        for below in (0, 1, width - 2, width - 1, width):
            bands[below, : len(load) - below] = pressed.diagonal(-below)
        right = np.column_stack([load, -(matrix @ held)]) * free[:, None]
        found = cho_solve_banded((cholesky_banded(bands, lower=True), True), right)
        per_rate, constant = found[:, :6], found[:, 6] + held
        p = per_rate @ rates + constant
        now = np.where(cavity, matrix @ p > load @ rates, p < -bound)
        drag = loads.T @ per_rate + viscosity * shears
        return drag, -loads.T @ constant, now, bool((now == cavity).all())

    def shear(self, rates: dict[int, float], viscosity: float) -> np.ndarray:
        """Generalised forces of the shear by the body's sliding (6,), fading out where the gap is no film."""
        return -viscosity * self._assembled[2] @ np.array([rates.get(motion, 0.0) for motion in range(6)])


def film_at(
    robot: Any, middle: np.ndarray, axes: np.ndarray, cells: tuple[int, int] = (90, 90)
) -> tuple[ShortCylinder, np.ndarray]:
    """The straight side of a robot's body, and its motions per rate of the body in its own axes (6, 6).

    `middle` of the body from the tube's axis, m; its axes as columns.
    """
    body = robot.body
    rear, front = (0.5 * body.length - body.rounding(end) for end in (body.rear_end, body.front_end))
    ahead = 0.5 * (front - rear)
    at = (middle + ahead * axes[:, 0]) * [0.0, 1.0, 1.0]
    up = -at / np.linalg.norm(at)
    local = np.stack([[1.0, 0.0, 0.0], np.cross(up, [1.0, 0.0, 0.0]), up])
    along, side, lift = local @ axes[:, 0]
    pitch, yaw = float(np.arcsin(lift)), float(np.arctan2(side, along))
    size = (0.5 * body.diameter, front + rear, 0.5 * robot.channel.diameter, float(np.linalg.norm(at)), pitch, yaw)
    cylinder = ShortCylinder(*size, cells, body.rounding(body.front_end))
    turned = cylinder.frame @ local @ axes
    motions = np.zeros((6, 6))
    motions[:3, :3] = motions[3:, 3:] = turned
    motions[:3, 3:] = ahead * turned @ [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]
    return cylinder, motions


def run_lift(moment: Any, cells: tuple[int, int] = (90, 90)) -> float:
    """What cavitation adds to the film's force away from the wall at one sample of a run in a tube, N."""
    robot = robot_of(moment)
    axes = Rotation.from_quat(moment["attitude"].values, scalar_first=True).as_matrix()
    cylinder, motions = film_at(robot, moment["position"].values, axes, cells)
    spin = np.concatenate([moment[name].values @ axes for name in ("velocity", "angular_velocity")])
    rates = dict(enumerate((motions @ spin).tolist()))
    linear, bounded = (
        cylinder.solve(rates, robot.fluid.viscosity, p)[0] for p in (np.inf, robot.fluid.cavitation_pressure)
    )
    return float((bounded - linear)[:3] @ cylinder.frame[:, 2])
