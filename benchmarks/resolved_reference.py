"""The bare tail and the robot in unbounded fluid, fully resolved: what line models of the wire are held against.

Method of fundamental solutions: point forces inside the solid, no slip in the least-squares sense at more
points of the true surface, one dense QR; no slender-body or line assumption anywhere. Every surface is a profile of
revolution swept along a centreline (straight for bodies and rods, eq. (10) for the tail, a circle for the
torus). The largest slip at points that were not collocated is the a-posteriori error; the matrix is never
symmetrised, so its asymmetry is a second one. Closed forms (sphere, Perrin's spheroid) and the exact torus of
arXiv:2102.01791, Table 2, are computed with the same functions.

The wire ends where its centreline ends, with edges rounded by a share of its radius (1: hemispheres inside the
length; towards 0: cut square). Lengths in mm, viscosity 1: for SI multiply the force, coupling and torque blocks
by mu * 1e-3, mu * 1e-6 and mu * 1e-9.

Without --full one coarse level; --full refines and studies the ends (some 25 minutes on two busy cores, 4 GB).

    OMP_NUM_THREADS=2 python benchmarks/resolved_reference.py --full --only tail --out DIR
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.linalg.lapack import dgels

from spirillum.fluid.closed.perrin import spheroid_drag
from spirillum.robot.tail_form import centreline

Array = NDArray[np.float64]
Sweep = Callable[[Array, Array, Array], Array]
Profile = Callable[[Array], tuple[Array, Array, Array, Array]]

TAIL = {
    "root": 27.5,
    "wavelength": 25.0,
    "amplitude": 2.5,
    "length": 60.0,
    "taper": 100.0,
    "hand": 1.0,
    "phase": 0.0,
}
WIRE_RADIUS = 0.5
BODY_RADIUS, BODY_LENGTH = 9.0, 35.0
TORUS = 0.7843079118776118  # a/R = 0.1, force over 6 pi mu U (R + a)


@dataclass(frozen=True)
class Settings:
    """Resolution, in units of the local length scale of the profile (the radius, or that of a rounded edge)."""

    depth: float
    """Depth of the sources below the surface."""
    spacing: float
    """Distance between rings of points along the profile."""
    aliasing: float
    """(source radius / surface radius)^n sets the number n of sources around."""
    surplus: float = 1.3
    """Collocation points to sources, along the profile and around."""


@dataclass(frozen=True)
class Surface:
    """Collocation points, sources under them, and points in between for the residual."""

    points: Array
    sources: Array
    checks: Array


def rod_profile(length: float, radius: float, edge: float) -> tuple[Profile, float]:
    """Meridian of a rod of overall `length` with edges rounded by `edge` (`edge == radius`: hemispheres).

    The profile maps its arc length to (z, rho), the outward normal's angle from the axis and the local scale.
    """
    flat, bend, side = radius - edge, 0.5 * np.pi * edge, length - 2.0 * edge
    total = 2.0 * (flat + bend) + side

    def profile(sigma: Array) -> tuple[Array, Array, Array, Array]:
        mirrored = sigma > 0.5 * total
        s = np.where(mirrored, total - sigma, sigma)
        turn = np.clip((s - flat) / edge, 0.0, 0.5 * np.pi)
        z = edge * (1.0 - np.cos(turn)) + np.maximum(s - flat - bend, 0.0)
        rho = np.minimum(s, flat) + edge * np.sin(turn)
        beyond = np.maximum(np.maximum(s - flat - bend, flat - s), 0.0)
        scale = np.minimum(radius, edge + 0.5 * beyond)
        angle = np.pi - turn  # from +z: pi on the first face, pi/2 on the side
        return np.where(mirrored, length - z, z), rho, np.where(mirrored, turn, angle), scale

    return profile, total


def spheroid_profile(axial: float, across: float) -> tuple[Profile, float]:
    """Meridian of a prolate spheroid with semi-axes `axial` and `across`, ends at z = 0 and 2 `axial`."""
    t = np.linspace(0.0, np.pi, 4001)
    speed = np.hypot(axial * np.sin(t), across * np.cos(t))
    arc = CubicSpline(t, speed).antiderivative()(t)
    eccentric = CubicSpline(arc, t)

    def profile(sigma: Array) -> tuple[Array, Array, Array, Array]:
        u = eccentric(sigma)
        z, rho = axial * (1.0 - np.cos(u)), across * np.sin(u)
        angle = np.arctan2(axial * np.sin(u), -across * np.cos(u))
        curvature = axial * across / (axial**2 * np.sin(u) ** 2 + across**2 * np.cos(u) ** 2) ** 1.5
        return z, rho, angle, np.minimum(1.0 / curvature, across)

    return profile, float(arc[-1])


def _around(rho: float, inner: float, gap: float, settings: Settings) -> int:
    """Points on a ring of radius `rho` over sources at radius `inner`, `gap` apart along the profile."""
    dense = 2.0 * np.pi * rho / gap
    ratio = min(abs(inner) / rho, 0.97)
    needed = np.log(settings.aliasing) / np.log(max(ratio, 1e-3))
    return max(3, int(np.ceil(min(dense, needed))))


def _ring(z: float, rho: float, count: int, shift: float) -> Array:
    theta = 2.0 * np.pi * (np.arange(count) + shift) / count
    return np.stack([np.full(count, z), rho * np.cos(theta), rho * np.sin(theta)], axis=-1)


def _stations(profile: Profile, total: float, spacing: float) -> tuple[Array, Array]:
    """Arc lengths of rings (middles of equal cells in scaled length) and of the cells' borders."""
    fine = np.linspace(0.0, total, 20001)
    density = 1.0 / profile(fine)[3]
    count = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(fine))])
    number = int(np.ceil(count[-1] / spacing))
    place = np.interp(np.linspace(0.0, count[-1], 2 * number + 1), count, fine)
    return place[1::2], place[2:-1:2]


def surface(profile: Profile, total: float, sweep: Sweep, settings: Settings) -> Surface:
    """Rings of collocation points and sources, and check points between the rings and between their points."""
    fine = settings.spacing / settings.surplus
    centres, _ = _stations(profile, total, settings.spacing)
    between, borders = _stations(profile, total, fine)
    points, sources, checks = [], [], []
    for j, (z, rho, angle, scale) in enumerate(zip(*profile(centres), strict=True)):
        depth = settings.depth * scale
        z_in, rho_in = z - depth * np.cos(angle), rho - depth * np.sin(angle)
        count = _around(rho, rho_in, settings.spacing * scale, settings)
        sources.append(_ring(z_in, rho_in, count, 0.5 * (j % 2)))
    for j, (z, rho, angle, scale) in enumerate(zip(*profile(between), strict=True)):
        inner = rho - settings.depth * scale * np.sin(angle)
        count = int(np.ceil(settings.surplus * _around(rho, inner, settings.spacing * scale, settings)))
        points.append(_ring(z, rho, count, 0.5 * (j % 2)))
        checks.append(_ring(z, rho, count, 0.5 * (j % 2) + 0.5))
    for z, rho, _, _ in zip(*profile(borders), strict=True):
        checks.append(_ring(z, rho, 11, 0.13))
    return Surface(*(sweep(*np.concatenate(part).T) for part in (points, sources, checks)))


def straight(x_first: float, direction: float = -1.0) -> Sweep:
    """Axis along x; z = 0 of the profile lies at `x_first`."""

    def sweep(z: Array, p: Array, q: Array) -> Array:
        return np.stack([x_first + direction * z, p, q], axis=-1)

    return sweep


def along(position: Array, tangent: Array, arc: Array) -> Sweep:
    """Sweep a profile along a sampled curve, in a frame that does not turn about the tangent."""
    normal = np.empty_like(position)
    first = np.cross(tangent[0], [0.3, -0.2, 0.9])
    normal[0] = first / np.linalg.norm(first)
    for i in range(len(position) - 1):  # parallel transport: reflect twice (chord, then tangent)
        v = position[i + 1] - position[i]
        n = normal[i] - 2.0 * v * (v @ normal[i]) / (v @ v)
        t = tangent[i] - 2.0 * v * (v @ tangent[i]) / (v @ v)
        w = tangent[i + 1] - t
        normal[i + 1] = n - 2.0 * w * (w @ n) / max(w @ w, 1e-300)
    curve, ahead, side = (CubicSpline(arc, value) for value in (position, tangent, normal))

    def sweep(z: Array, p: Array, q: Array) -> Array:
        t = ahead(z)
        t /= np.linalg.norm(t, axis=-1, keepdims=True)
        n = side(z)
        n -= t * np.sum(t * n, axis=-1, keepdims=True)
        n /= np.linalg.norm(n, axis=-1, keepdims=True)
        return curve(z) + p[:, None] * n + q[:, None] * np.cross(t, n)

    return sweep


def tail_curve() -> tuple[Sweep, float]:
    """Eq. (10) by arc length from the root; also its whole length."""
    length = TAIL["length"]
    xi = length * np.linspace(0.0, 1.0, 6001) ** 1.5  # fine at the root, where the envelope bends
    line = centreline(xi, **TAIL)
    arc = PchipInterpolator(xi, line.stretch).antiderivative()(xi)
    return along(line.position, line.tangent, arc), float(arc[-1])


def circle(radius: float) -> Sweep:
    def sweep(z: Array, p: Array, q: Array) -> Array:
        angle = z / radius
        return np.stack([q, (radius + p) * np.cos(angle), (radius + p) * np.sin(angle)], axis=-1)

    return sweep


def torus_surface(radius: float, wire: float, settings: Settings) -> Surface:
    """Rings around a closed circle about the x axis."""
    around = 2.0 * np.pi * radius
    inner = wire * (1.0 - settings.depth)
    count = _around(wire, inner, settings.spacing * wire, settings)
    sweep = circle(radius)

    def part(rho: float, surplus: float, offset: float) -> Array:
        rings = int(np.ceil(surplus * around / (settings.spacing * wire)))
        n = int(np.ceil(surplus * count))
        return sweep(*np.concatenate([_ring((j + offset) * around / rings, rho, n, offset) for j in range(rings)]).T)

    return Surface(part(wire, settings.surplus, 0.0), part(inner, 1.0, 0.0), part(wire, settings.surplus, 0.5))


def stokeslets(targets: Array, sources: Array) -> Array:
    """Matrix from point forces to velocities, viscosity 1; rows and columns ordered by component, then point."""
    m, n = len(targets), len(sources)
    matrix = np.empty((3 * m, 3 * n), order="F")
    for low in range(0, m, 512):
        rows = np.arange(low, min(low + 512, m))
        d = [targets[rows, i][:, None] - sources[None, :, i] for i in range(3)]
        inverse = 1.0 / np.sqrt(d[0] ** 2 + d[1] ** 2 + d[2] ** 2)
        cube = inverse**3
        for i in range(3):
            for j in range(3):
                block = d[i] * d[j] * cube
                if i == j:
                    block += inverse
                matrix[i * m + low : i * m + low + len(rows), j * n : (j + 1) * n] = block / (8.0 * np.pi)
    return matrix


def rigid(points: Array) -> Array:
    """Velocities (by component, then point) of the six unit twists about the origin; transposed: forces to wrench."""
    columns = np.zeros((3, len(points), 6))
    for k in range(3):
        columns[k, :, k] = 1.0
        columns[:, :, 3 + k] = np.cross(np.eye(3)[k], points).T
    return columns.reshape(-1, 6)


def least_squares(matrix: Array, right: Array) -> Array:
    """Least squares by Householder QR; `matrix` (in Fortran order) is overwritten."""
    _, solution, info = dgels(matrix, right, lwork=64 * sum(matrix.shape), overwrite_a=1)
    if info:
        raise ArithmeticError(f"dgels returned {info}")
    return solution[: matrix.shape[1]]


def resistance(parts: list[Surface]) -> tuple[Array, tuple[float, float], int]:
    """Resistance matrix of rigid parts (twists about the origin), slip, and number of sources.

    The slip is the largest and the root mean square of the worst twist, relative to its largest surface velocity.
    """
    points, sources, checks = (np.concatenate([getattr(p, k) for p in parts]) for k in ("points", "sources", "checks"))
    moved = _by_part([p.points for p in parts])
    forces = least_squares(stokeslets(points, sources), moved)
    matrix = _by_part([p.sources for p in parts]).T @ forces
    wanted = _by_part([p.checks for p in parts])
    slip = stokeslets(checks, sources) @ forces - wanted
    size = np.sqrt(np.sum(slip.reshape(3, -1, slip.shape[1]) ** 2, axis=0))
    speed = np.sqrt(np.sum(wanted.reshape(3, -1, slip.shape[1]) ** 2, axis=0)).max(axis=0)
    largest, mean = size.max(axis=0) / speed, np.sqrt(np.mean(size**2, axis=0)) / speed
    return matrix, (float(largest.max()), float(mean.max())), len(sources)


def _by_part(positions: list[Array]) -> Array:
    """Six columns for each part, zero on the other parts."""
    total = sum(len(p) for p in positions)
    columns = np.zeros((3, total, 6 * len(positions)))
    low = 0
    for k, p in enumerate(positions):
        columns[:, low : low + len(p), 6 * k : 6 * k + 6] = rigid(p).reshape(3, -1, 6)
        low += len(p)
    return columns.reshape(3 * total, -1)


def rod(length: float, radius: float, edge: float, sweep: Sweep, settings: Settings) -> Surface:
    return surface(*rod_profile(length, radius, edge * radius), sweep, settings)


def tail_surface(edge: float, settings: Settings) -> Surface:
    sweep, length = tail_curve()
    return rod(length, WIRE_RADIUS, edge, sweep, settings)


def body_surface(settings: Settings) -> Surface:
    return rod(BODY_LENGTH, BODY_RADIUS, 1.0, straight(0.5 * BODY_LENGTH), settings)


def asymmetry(matrix: Array) -> float:
    scale = np.sqrt(np.outer(np.diag(matrix), np.diag(matrix)))
    return float(np.abs((matrix - matrix.T) / scale).max())


def swimming(matrix: Array) -> dict[str, float]:
    """Force-free motion per unit tail rate; lateral motion and tilt held, motor between body and tail."""
    index = [0, 3, 6, 9]
    axial = matrix[np.ix_(index, index)]
    force, body_torque, tail_torque = axial[0] + axial[2], axial[1], axial[3]
    total_torque = body_torque + tail_torque
    system = np.array([[row[0] + row[2], row[1]] for row in (force, total_torque)])
    speed, body_rate = np.linalg.solve(system, -np.array([force[3], total_torque[3]]))
    state = np.array([speed, body_rate, speed, 1.0])
    return {
        "speed_per_tail_rate_mm": float(speed),
        "body_rate_per_tail_rate": float(body_rate),
        "tail_torque_per_tail_rate_mm3": float(tail_torque @ state),
    }


def entry(parts: list[Surface], settings: dict[str, Any]) -> dict[str, Any]:
    start = time.perf_counter()
    matrix, slip, number = resistance(parts)
    return {
        "settings": settings,
        "sources": number,
        "largest_slip": slip[0],
        "rms_slip": slip[1],
        "asymmetry": asymmetry(matrix),
        "seconds": time.perf_counter() - start,
        "matrix": matrix.tolist(),
    }


def tail_case(edge: float, settings: Settings) -> dict[str, Any]:
    result = entry([tail_surface(edge, settings)], {"edge": edge, **vars(settings)})
    m = result["matrix"]
    return {**result, "B11": m[0][0], "B14": m[0][3], "B41": m[3][0], "B44": m[3][3]}


def robot_case(edge: float, settings: Settings, body: Settings) -> dict[str, Any]:
    parts = [body_surface(body), tail_surface(edge, settings)]
    result = entry(parts, {"edge": edge, "tail": vars(settings), "body": vars(body)})
    matrix = np.array(result["matrix"])
    index = [0, 3, 6, 9]
    return {**result, "axial": matrix[np.ix_(index, index)].tolist(), "swimming": swimming(matrix)}


def checks(settings: Settings) -> dict[str, Any]:
    """Sphere, prolate spheroid and torus against their exact values (relative errors)."""
    sphere = entry([surface(*spheroid_profile(1.0, 1.0), straight(1.0), settings)], vars(settings))
    a, b = 2.0, 1.0
    shallow = replace(settings, depth=0.4, spacing=0.6 * settings.spacing)  # the foci stay below the sources
    spheroid = entry([surface(*spheroid_profile(a, b), straight(a), shallow)], vars(shallow))
    exact = np.array(spheroid_drag(np.float64(1.0), np.float64(a), np.float64(b)))
    diagonal = np.diag(np.array(spheroid["matrix"]))
    torus = entry([torus_surface(1.0, 0.1, settings)], vars(settings))
    ball = np.diag(np.array(sphere["matrix"]))
    return {
        "settings": vars(settings),
        "sphere": [ball[0] / (6.0 * np.pi) - 1.0, ball[3] / (8.0 * np.pi) - 1.0],
        "spheroid": (diagonal[[0, 1, 3, 4]] / exact - 1.0).tolist(),
        "torus": torus["matrix"][0][0] / (6.0 * np.pi * 1.1) / TORUS - 1.0,
        "largest_slip": [case["largest_slip"] for case in (sphere, spheroid, torus)],
        "rms_slip": [case["rms_slip"] for case in (sphere, spheroid, torus)],
    }


COARSE = Settings(depth=0.6, spacing=0.5, aliasing=2e-3)
MIDDLE = Settings(depth=0.6, spacing=0.4, aliasing=6e-4)
FINE = Settings(depth=0.7, spacing=0.4, aliasing=6e-6)
BODY = Settings(depth=0.4, spacing=0.2, aliasing=5e-6)


def cases(*, full: bool) -> dict[str, Callable[[], Any]]:
    levels = [COARSE, MIDDLE, FINE] if full else [COARSE]
    edges = [1.0, 0.5, 0.25] if full else [1.0, 0.5]

    def tail() -> Any:
        refined = [(1.0, s) for s in levels]
        shaped = [(e, levels[-1 if len(levels) == 1 else 1]) for e in edges[1:]]
        return [tail_case(*case) for case in refined + shaped]

    def robot() -> Any:
        fine = replace(BODY, spacing=0.15, aliasing=1e-7)
        runs = [(1.0, COARSE, BODY)]
        if full:
            runs = [(1.0, MIDDLE, BODY), (1.0, MIDDLE, fine), (0.5, MIDDLE, BODY), (0.5, FINE, BODY)]
        return [robot_case(*run) for run in runs]

    return {"checks": lambda: [checks(s) for s in levels], "tail": tail, "robot": robot}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--full", action="store_true", help="refinement levels and cap shapes; needs 4 GB and minutes")
    parser.add_argument("--only", choices=["checks", "tail", "robot"], action="append")
    parser.add_argument("--out", type=Path, help="also write one JSON file a case into this folder")
    options = parser.parse_args()
    answer: dict[str, Any] = {"question": "resolved resistance of the bare tail and of the robot, unbounded fluid"}
    answer["units"] = "mm, viscosity 1; twists about the body's mid-length"
    for name, run in cases(full=options.full).items():
        if options.only and name not in options.only:
            continue
        answer[name] = run()
        if options.out:
            (options.out / f"{name}.json").write_text(json.dumps(answer[name], indent=1))
    print(json.dumps(answer, indent=1))


if __name__ == "__main__":
    main()
