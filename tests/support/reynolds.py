"""Reynolds' equation under a short cylinder in a tube by finite differences: an independent solution for tests.

With y across the tube, z towards its axis and the wall at rest, the pressure p of a motion v of the body obeys

    div(h^3/12 eta grad p) = s,    s = v_z - v_t.grad z_b + div(h v_t)/2,    p = 0 on the edges,

z_b the body's surface and h its height above the wall. With a bound p >= -p_c the pressure is the least one that takes
up no less than what the gap opens (Swift, Stieber): a linear complementarity problem, solved by its active set.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.sparse import csc_matrix, diags
from scipy.sparse.linalg import spsolve
from scipy.spatial.transform import Rotation

from spirillum.dynamics.run_file import robot_of

_ROUNDS = 60


@dataclass(frozen=True)
class ShortCylinder:
    """A cylinder at a pose in a tube, its rear end flat and its front flat or rounded; m, rad."""

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

    def __post_init__(self) -> None:
        nx, ny = self.cells
        x = 0.5 * self.length * np.sin(0.5 * np.pi * np.linspace(-1.0, 1.0, nx + 1))
        least = self.tube - self.radius - np.hypot(self.offset - x * self.pitch, x * self.yaw).max()
        bend = self.radius * self.tube / (self.tube - self.radius)
        width = np.sqrt(2.0 * bend * max(least, 1e-8))
        if self.rounded > 0.0:
            beyond = 0.3 * self.rounded * np.linspace(0.0, 1.0, nx // 2 + 1)[1:] ** 3
            x = np.append(x, x[-1] + beyond)
        far = 0.35 * self.radius
        t = np.linspace(-1.0, 1.0, ny + 1) * np.arcsinh(far / width)
        object.__setattr__(self, "x", x)
        object.__setattr__(self, "lateral", width * np.sinh(t))

    def heights(self, x: np.ndarray, across: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """h, z_b from the body's axis, and y of the body's axis; `across` is y from the line nearest to the wall."""
        side = x * self.yaw
        below = self.offset - x * self.pitch
        # The nearest line: where the normal of the body points along the axis' own offset.
        y = across + side + self.radius * side / np.hypot(side, below)
        beyond = np.maximum(x - 0.5 * self.length, 0.0)
        radius = self.radius - self.rounded + np.sqrt(self.rounded**2 - np.minimum(beyond, self.rounded) ** 2)
        under = np.sqrt(radius**2 - (y - side) ** 2)
        return np.sqrt(self.tube**2 - y**2) - below - under, -under, y - side

    def velocities(self, x: np.ndarray, across: np.ndarray) -> np.ndarray:
        """Velocities of the body's surface for unit motions, (6, 3, ...): U, and Omega about its middle.

        They roll about the body's axis, which is tilted, and turn otherwise about those of the tube.
        """
        _, z, y = self.heights(x, across)
        r = np.stack(np.broadcast_arrays(x, y, z))
        units = np.broadcast_to(np.eye(3).reshape((3, 3) + (1,) * (r.ndim - 1)), (3, *r.shape))
        return np.concatenate([units, np.cross(units, r[None], axis=1)])

    def solve(self, rates: dict[int, float], viscosity: float, bound: float = np.inf) -> tuple[np.ndarray, np.ndarray]:
        """Generalised forces of the pressure on the body (6,), and the pressure at the cells.

        Args:
            rates: rates of the motions 0 to 5, U and Omega about the middle.
            viscosity: Pa s.
            bound: p_c, Pa.
        """
        matrix, sources, area = self._system(viscosity)
        source = np.tensordot(np.array([rates.get(motion, 0.0) for motion in range(6)]), sources, 1)
        p = spsolve(matrix, -source * area)
        active = p < -bound
        for _ in range(_ROUNDS):
            if not active.any():
                break
            p = np.full(p.size, -bound)
            free = ~active
            p[free] = spsolve(matrix[free][:, free], -(source * area)[free] - matrix[free][:, active] @ p[active])
            excess = matrix @ p + source * area
            now = np.where(active, excess > 0.0, p < -bound)
            if (now == active).all():
                break
            active = now
        return sources @ (p * area), p

    def affine(
        self, rates: np.ndarray, viscosity: float, bound: float, active: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool]:
        """Forces of pressure and shear, -K q + f as long as its cavity is that which is guessed.

        Args:
            rates: of the motions 0 to 5 (6,).
            viscosity: Pa s.
            bound: p_c, Pa.
            active: cells that cavitate, a guess.

        Returns:
            K, f, the cells that cavitate at these rates and that pressure, and whether the guess was right.
        """
        matrix, sources, area = self._system(viscosity)
        load, count = (sources * area).T, self.cells[1]
        cavity = np.zeros(area.size, dtype=bool) if active is None else active
        free, held = ~cavity, np.where(cavity, -bound if cavity.any() else 0.0, 0.0)
        pressed = diags(free.astype(float)) @ matrix @ diags(free.astype(float)) + diags(cavity.astype(float))
        bands = np.zeros((count + 1, area.size))
        for below in (0, 1, count):
            bands[below, : area.size - below] = pressed.diagonal(-below)
        right = np.column_stack([-load, -(matrix @ held)]) * free[:, None]
        found = cho_solve_banded((cholesky_banded(bands, lower=True), True), right)
        per_rate, constant = found[:, :6], found[:, 6] + held
        p = per_rate @ rates + constant
        now = np.where(cavity, matrix @ p + load @ rates > 0.0, p < -bound)
        return -load.T @ per_rate - self.shears(viscosity), load.T @ constant, now, bool((now == cavity).all())

    def shear(self, rates: dict[int, float], viscosity: float) -> np.ndarray:
        """Generalised forces of the shear by the body's sliding (6,)."""
        return self.shears(viscosity) @ np.array([rates.get(motion, 0.0) for motion in range(6)])

    def shears(self, viscosity: float) -> np.ndarray:
        """The same per rate (6, 6), fading out where the gap is no film."""
        xm, ym = (
            0.5 * (edges[1:] + edges[:-1])[shape]
            for edges, shape in zip((self.x, self.lateral), ((slice(None), None), (None, slice(None))), strict=True)
        )
        h, z, y = self.heights(xm, ym)
        v = self.velocities(xm, ym)
        around = (-z * v[:, 1] + y * v[:, 2]) / self.radius  # along the circumference
        share = viscosity / h / (1.0 + (h / (0.2 * self.radius)) ** 2)
        share = share * np.diff(self.x)[:, None] * np.diff(self.lateral)[None] * self.radius / -z
        slid = np.stack([v[:, 0], around]).reshape(2, 6, -1)
        return -np.einsum("kin,kjn,n->ij", slid, slid, share.ravel(), optimize=True)

    def _system(self, viscosity: float) -> tuple[csc_matrix, np.ndarray, np.ndarray]:
        x, y = self.x, self.lateral
        xm, ym = 0.5 * (x[1:] + x[:-1]), 0.5 * (y[1:] + y[:-1])
        dx, dy = np.diff(x), np.diff(y)
        nx, ny = dx.size, dy.size
        # The wall's nearest line is straight in (x, across): a shear of coordinates that is negligible at small yaws.
        k_x = self.heights(x[:, None], ym[None])[0] ** 3 / (12.0 * viscosity)
        k_y = self.heights(xm[:, None], y[None])[0] ** 3 / (12.0 * viscosity)
        reach_x = np.concatenate([[0.5 * dx[0]], np.diff(xm), [0.5 * dx[-1]]])
        reach_y = np.concatenate([[0.5 * dy[0]], np.diff(ym), [0.5 * dy[-1]]])
        g_x = k_x * dy[None] / reach_x[:, None]
        g_y = k_y * dx[:, None] / reach_y[None]
        main = (g_x[:-1] + g_x[1:] + g_y[:, :-1] + g_y[:, 1:]).ravel()
        along, across = g_x[1:-1].ravel(), g_y[:, 1:].copy()
        across[:, -1] = 0.0
        across = across.ravel()[:-1]
        matrix = diags([main, -along, -along, -across, -across], [0, ny, -ny, 1, -1], format="csc")
        sources = self._sources(x, y, xm, ym)
        return matrix, sources.reshape(6, nx * ny), (dx[:, None] * dy[None]).ravel()

    def _sources(self, x: np.ndarray, y: np.ndarray, xm: np.ndarray, ym: np.ndarray) -> np.ndarray:
        v = self.velocities(xm[:, None], ym[None])

        def height(at_x: np.ndarray, at_y: np.ndarray) -> np.ndarray:
            """z_b at fixed places of the lab."""
            h, _, _ = self.heights(at_x, at_y)
            side = at_x * self.yaw
            lateral = at_y + side + self.radius * side / np.hypot(side, self.offset - at_x * self.pitch)
            return h - np.sqrt(self.tube**2 - lateral**2)

        def flux(at_x: np.ndarray, at_y: np.ndarray) -> np.ndarray:
            return 0.5 * self.heights(at_x, at_y)[0] * self.velocities(at_x, at_y)[:, :2]

        shear = self.yaw * self.tube / (self.tube - self.radius)  # d(nearest line)/dx, nearly constant
        dx, dy = np.diff(x)[:, None], np.diff(y)[None]

        def slopes(of_x: np.ndarray, of_y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            d_y = np.diff(of_y, axis=-1) / dy
            return np.diff(of_x, axis=-2) / dx - shear * d_y, d_y

        z_x, z_y = slopes(height(x[:, None], ym[None]), height(xm[:, None], y[None]))
        q_x, q_y = slopes(flux(x[:, None], ym[None]), flux(xm[:, None], y[None]))
        return v[:, 2] - v[:, 0] * z_x - v[:, 1] * z_y + q_x[:, 0] + q_y[:, 1]


def film_of_run(moment: Any, cells: tuple[int, int] = (90, 90)) -> tuple[ShortCylinder, dict[int, float]]:
    """The straight side of the body at one sample of a run in a tube, and its rates; for yaws up to 3 degrees."""
    robot = robot_of(moment)
    body, tube = robot.body, 0.5 * robot.channel.diameter
    rear, front = (0.5 * body.length - body.rounding(end) for end in (body.rear_end, body.front_end))
    angles = [float(moment[name]) for name in ("azimuth", "wall_yaw", "wall_pitch")]
    local = Rotation.from_euler("XZY", angles * np.array([1.0, 1.0, -1.0])).as_matrix()
    axis = Rotation.from_euler("X", angles[0]).as_matrix().T @ local[:, 0]
    middle = 0.5 * (front - rear) * axis + [0.0, 0.0, -float(moment["offset"])]
    # Axes from the tube's axis over the middle of the side, which need not be where the origin is nearest.
    turned = Rotation.from_euler("X", np.arctan2(middle[1], -middle[2])).as_matrix().T
    to_middle = turned @ Rotation.from_euler("X", angles[0]).as_matrix().T
    spin = moment["angular_velocity"].values
    at = to_middle @ (moment["velocity"].values + np.cross(spin, 0.5 * (front - rear) * local[:, 0]))
    axis = to_middle @ local[:, 0]
    turning, roll = to_middle @ spin, float(local[:, 0] @ spin)
    rates = np.concatenate([at, [roll], (turning - roll * axis)[1:]])
    _, yaw, pitch = np.arcsin(axis)
    offset = float(np.hypot(*middle[1:]))
    size = (0.5 * body.diameter, front + rear, tube, offset, float(pitch), float(yaw))
    cylinder = ShortCylinder(*size, cells, body.rounding(body.front_end))
    return cylinder, dict(enumerate(rates.tolist()))


def run_lift(moment: Any) -> float:
    """What cavitation adds to the film's force away from the wall at one sample of a run, N."""
    fluid = robot_of(moment).fluid
    cylinder, rates = film_of_run(moment)
    linear, bounded = (cylinder.solve(rates, fluid.viscosity, p)[0][2] for p in (np.inf, fluid.cavitation_pressure))
    return float(bounded - linear)
