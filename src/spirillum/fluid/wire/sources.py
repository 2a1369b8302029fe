"""Forces and torques along wires as rings around the axis: how solids of revolution feel them, and answer.

A point force at the angle theta' excites every mode m, with the phase exp(-i m theta'). Solids answer by reciprocity
with the transpose, weighted with their surface elements.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spirillum.arrays import Amplitudes, Samples
from spirillum.fluid.wire.revolution import Panels
from spirillum.fluid.wire.stokeslets import Wire, WireSystem

_TORQUE_MODES = 3  # torques along a wire are felt through modes 0 to 2 only: the others fade too fast
_OF_STATIONS = ("x", "rho", "theta", "frames", "torques")
_STEP = 1e-3  # of the differences that make couples from forces, over the blob radius


@dataclass(frozen=True)
class Sources:
    """Forces and torques at the wires' stations, in cylindrical components, as solids feel them.

    Torques are those of the first moments; the moments' strains fade so fast that solids do not feel them.
    """

    wires: tuple[Wire, ...]
    """Wires."""
    x: Samples
    """(stations,)."""
    rho: Samples
    """(stations,)."""
    theta: Samples
    """(stations,)."""
    frames: Samples
    """Rows e_x, e_rho, e_theta, (stations, 3, 3)."""
    torques: Samples
    """Cylindrical torque of each unit moment, (stations, 3, q)."""

    @classmethod
    def of(cls, wires: tuple[Wire, ...], system: WireSystem) -> Sources:
        """Of all wires."""
        points = np.concatenate([wire.points for wire in wires]) if wires else np.zeros((0, 3))
        theta = np.arctan2(points[:, 2], points[:, 1])
        cos, sin, zero = np.cos(theta), np.sin(theta), np.zeros(len(theta))
        rows = [[zero + 1.0, zero, zero], [zero, cos, sin], [zero, -sin, cos]]
        frames = np.moveaxis(np.array(rows), -1, 0)
        rho = np.hypot(points[:, 1], points[:, 2])
        return cls(wires, points[:, 0], rho, theta, frames, frames @ system.torques)

    @classmethod
    def joined(cls, several: Sequence[Sources]) -> Sources:
        """All of them as one; of one accuracy."""
        rows = [np.concatenate([getattr(one, name) for one in several]) for name in _OF_STATIONS]
        return cls(tuple(wire for one in several for wire in one.wires), *rows)

    def alike(self, other: Sources) -> bool:
        """Whether both sweep the same circles as they turn."""
        near = 1e-9 * float(np.max(self.rho, initial=0.0))
        return self.x.shape == other.x.shape and all(
            np.allclose(one, two, rtol=0.0, atol=near) for one, two in ((self.x, other.x), (self.rho, other.rho))
        )

    def turn(self, m: int, size: int) -> Amplitudes:
        """Phase exp(-i m theta) of each of `size` sources in mode m, and -i more for f_theta, T_x and T_rho."""
        factor = np.array([1.0, 1.0, -1j, -1j, -1j, 1.0])[: size // max(len(self.x), 1)]
        turns: Amplitudes = (np.exp(-1j * m * self.theta)[:, None] * factor).ravel()
        return turns

    def columns(self, matrix: Samples) -> Samples:
        """Turn columns that stand for sources into columns for the stations' forces, then moments."""
        stations, kinds = len(self.x), self.torques.shape[2]
        if stations == 0:
            return matrix
        split = matrix.reshape(len(matrix), stations, matrix.shape[1] // stations)
        found = np.zeros((len(matrix), (3 + kinds) * stations))
        found[:, : 3 * stations] = _each(split[:, :, :3], self.frames)
        if split.shape[2] > 3:
            found[:, 3 * stations :] = _each(split[:, :, 3:], self.torques)
        return found

    def rings(self, strengths: Samples, size: int) -> Samples:
        """Sources from the stations' forces and moments, (size, 12)."""
        stations, kinds = len(self.x), self.torques.shape[2]
        forces = np.matmul(self.frames, strengths[: 3 * stations].reshape(stations, 3, 12))
        torques = np.matmul(self.torques, strengths[3 * stations :].reshape(stations, kinds, 12))
        both: Samples = np.concatenate([forces, torques], axis=1)[:, : size // max(stations, 1)]
        return both.reshape(size, 12)

    def velocities(self, panels: Panels, modes: int) -> list[Samples]:
        """Velocities of each mode on the nodes from ring sources, (3 nodes, 3 or 6 stations) each."""
        forces = self._from(panels, modes)
        if self.torques.shape[2] == 0:
            return list(forces)
        torques = self._torque_velocities(panels, forces[:_TORQUE_MODES])
        both = [_interleaved(*pair) for pair in zip(forces, torques, strict=False)]
        return both + list(forces[_TORQUE_MODES:])

    def _from(self, panels: Panels, modes: int, dx: float = 0.0, drho: float = 0.0) -> Samples:
        """Velocities from ring forces at stations moved by dx and drho blob radii, (modes, 3 nodes, 3 stations)."""
        from spirillum.kernels.rings import ring_blocks

        x, rho = panels.x.ravel(), panels.rho.ravel()
        found: list[Samples] = [np.zeros((modes, 3 * panels.size, 0))]
        start = 0
        for wire in self.wires:
            at = slice(start, start + len(wire.points))
            moved = self.x[at] + dx * wire.blob, self.rho[at] + drho * wire.blob
            found.append(ring_blocks(x, rho, *moved, wire.blob**2, modes))
            start += len(wire.points)
        return np.concatenate(found, axis=2)

    def _torque_velocities(self, panels: Panels, forces: Samples) -> Samples:
        """Velocities from ring torques (T_x, T_rho, T_theta), (modes, 3 nodes, 3 stations).

        A torque is half the difference of two couples of forces: T_x = [f_theta along rho - f_rho along theta]/2 and
        so on. Derivatives along x and rho are central differences; along theta, phase and unit vectors turn.
        """
        modes, rows = forces.shape[:2]
        blob = np.concatenate([np.full(len(wire.points), wire.blob) for wire in self.wires])
        rho = np.maximum(self.rho, _STEP * blob)[:, None]
        shape = (modes, rows, len(self.x), 3)
        by_x = (self._from(panels, modes, dx=_STEP) - self._from(panels, modes, dx=-_STEP)).reshape(shape)
        by_x /= 2.0 * _STEP * blob[:, None]
        by_rho = (self._from(panels, modes, drho=_STEP) - self._from(panels, modes, drho=-_STEP)).reshape(shape)
        by_rho /= 2.0 * _STEP * blob[:, None]
        m = np.arange(modes)[:, None, None]
        k_x, k_rho, k_g = np.moveaxis(forces.reshape(shape), -1, 0)
        around = rho[:, 0]
        torques = (
            by_rho[..., 2] - (m * k_rho - k_g) / around,
            m * k_x / around - by_x[..., 2],
            by_x[..., 1] - by_rho[..., 0],
        )
        found: Samples = 0.5 * np.stack(torques, axis=-1).reshape(modes, rows, -1)
        return found


def _each(split: Samples, blocks: Samples) -> Samples:
    """Multiply (k, n, c) with a block (c, d) for each of n, to (k, n d)."""
    found: Samples = np.matmul(split.swapaxes(0, 1), blocks).swapaxes(0, 1).reshape(len(split), -1)
    return found


def _interleaved(forces: Samples, torques: Samples) -> Samples:
    """Columns of three forces and three torques for each station."""
    rows = len(forces)
    pairs = np.concatenate([forces.reshape(rows, -1, 3), torques.reshape(rows, -1, 3)], axis=2)
    return pairs.reshape(rows, -1)
