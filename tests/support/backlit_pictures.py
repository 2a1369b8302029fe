"""A robot on a light table: a third style of picture, made from the geometry of the robot alone.

The floor is the lamp: uneven, with fibres of paper in it. Glass and robot are dark before it, a weak lamp from one side
shows the paint. The ruler is a printed strip with long and short lines and digits, on one side of the tube. Own
pinhole, paints and gamma; written without regard to what a tracker can follow. Camera's frame: x towards the nose,
z towards the camera, y = z x x; pixel centres at whole numbers; SI; rates signed about +x.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from spirillum.robot.load import load
from spirillum.robot.robot import Robot
from spirillum.robot.tail_form import amplitude_envelope

INKS = {
    "red": (0.50, 0.055, 0.06),
    "yellow": (0.62, 0.47, 0.05),
    "green": (0.05, 0.30, 0.11),
    "blue": (0.05, 0.13, 0.42),
    "white": (0.62, 0.62, 0.58),
    "black": (0.02, 0.02, 0.022),
    "orange": (0.58, 0.21, 0.03),
    "magenta": (0.42, 0.05, 0.30),
    "cyan": (0.05, 0.36, 0.42),
}
"""Linear reflectance of the stripes' paints."""

_TABLE = np.array([0.80, 0.74, 0.63])
"""Linear light of the table where it is brightest: a warm lamp."""
_LAMP = np.array([-0.45, 0.55, 0.70])
"""Direction towards the weak lamp in the picture (right, up, towards the camera), not normalised."""
_SIDE = 3
"""Samples of a pixel along each direction; rows and columns of samples are shifted against each other."""


@dataclass(frozen=True)
class Backlit:
    """A film on the light table and all that is true of it."""

    robot: Robot = field(default_factory=lambda: load("biorob2012-wide"))
    size: tuple[int, int] = (400, 300)
    direction: str = "right"
    camera_height: float = 0.24
    axis_height: float = 0.018
    focal: float = 660.0
    spacing: float = 0.002
    velocity: float = 1e-3
    tail_rate: float = 2 * np.pi * 1.1
    body_rate: float = -2 * np.pi * 0.12
    start: tuple[float, float] = (0.02, 0.0)
    heading: float = 0.0
    body_angle: float = 0.3
    tail_phase: float = 0.7
    edges: tuple[float, ...] | None = None
    """Angles of the edges between stripes, from the first one's on, rad, one more than stripes; None: even ones."""
    plain: str | None = None
    """Paint of the whole seal in place of stripes; a name of `INKS`, or `bare` for that of the body."""
    tube: bool = True
    ruler_side: float = 1.0
    """On which side of the tube the ruler lies: 1 or -1 along y."""
    paint: tuple[float, float, float] = (0.16, 0.17, 0.24)
    """Linear reflectance of the body."""
    grain: float = 1.2
    """Standard deviation of the sensor's noise at full light, of 255; it goes with the root of the light."""
    seed: int = 1

    def at(self, time: float) -> tuple[float, float, float, float]:
        """x and y of the mid-length, body angle, tail phase (lab)."""
        return (
            self.start[0] + self.velocity * time,
            self.start[1],
            self.body_angle + self.body_rate * time,
            self.tail_phase + self.tail_rate * time,
        )

    @property
    def sign(self) -> float:
        """1 where the nose points to the right in the picture, -1 to the left."""
        return 1.0 if self.direction == "right" else -1.0

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """Pixels of points of the camera's frame, (..., 2)."""
        scale = self.sign * self.focal / (self.camera_height - points[..., 2])
        centre = 0.5 * (np.array(self.size) - 1.0)
        return np.stack([centre[0] + scale * points[..., 0], centre[1] - scale * points[..., 1]], axis=-1)

    def placed(self, points: np.ndarray, time: float) -> np.ndarray:
        """Points of the robot's level frame (origin at its mid-length) in the camera's frame."""
        x, y, *_ = self.at(time)
        cos, sin = np.cos(self.heading), np.sin(self.heading)
        return np.stack(
            [
                x + cos * points[..., 0] - sin * points[..., 1],
                y + sin * points[..., 0] + cos * points[..., 1],
                self.axis_height + points[..., 2],
            ],
            axis=-1,
        )

    @cached_property
    def table(self) -> np.ndarray:
        """Linear light of the still scene: table, ruler, glass, (height, width, 3)."""
        import cv2

        width, height = self.size
        rng = np.random.default_rng([self.seed, 1])
        u, v = np.meshgrid(np.linspace(-1, 1, width), np.linspace(-1, 1, height) * height / width)
        centre, slope = rng.uniform(-0.3, 0.3, 2), rng.uniform(-0.12, 0.12, 2)
        light = 1.0 - 0.28 * ((u - centre[0]) ** 2 + (v - centre[1]) ** 2) + slope[0] * u + slope[1] * v
        for fine, strength in ((2, 0.012), (5, 0.016), (24, 0.022)):
            blots = rng.standard_normal((height // fine + 2, width // fine + 2)).astype(np.float32)
            light *= 1.0 + strength * cv2.resize(blots, (width, height), interpolation=cv2.INTER_CUBIC)
        scene = light[..., None] * _TABLE
        scene *= self._ruler()[..., None]
        if self.tube and self.robot.channel is not None:
            scene *= self._glass()[..., None]
        return scene

    def _ruler(self) -> np.ndarray:
        """Transmission of the printed strip."""
        import cv2

        width, height = self.size
        fine = 4
        print_ = np.full((height * fine, width * fine), 255, dtype=np.uint8)
        scale = self.focal / self.camera_height
        inner = 0.025 if self.robot.channel is None else 0.5 * self.robot.channel.diameter + 0.0045

        def corner(x: float, y: float) -> np.ndarray:
            return (self.pixels(np.array([x, y, 0.0])) + 0.5) * fine - 0.5

        def fill(low: tuple[float, float], high: tuple[float, float], value: float) -> None:
            box = np.array([corner(*low), corner(high[0], low[1]), corner(*high), corner(low[0], high[1])])
            cv2.fillPoly(print_, [np.rint(box * 1024).astype(np.int32)], round(255 * value), shift=10)

        reach = 0.5 * width / scale + 0.01
        side = self.ruler_side
        fill((-reach, side * inner), (reach, side * (inner + 0.0115)), 0.86)
        count = int(reach / self.spacing) + 1
        for index in range(-count, count + 1):
            x, long = index * self.spacing + 0.00061, index % 5 == 0
            fill((x - 2.2e-4, side * inner), (x + 2.2e-4, side * (inner + (0.0075 if long else 0.0048))), 0.12)
            if long:
                place = corner(x - 8e-4, side * (inner + 0.0098))
                text = str(abs(round(index * self.spacing * 1e3)))
                where = (int(place[0]), int(place[1]))
                cv2.putText(print_, text, where, cv2.FONT_HERSHEY_SIMPLEX, 1.1e-3 * scale * fine / 10, 51, fine // 2)
        small = cv2.resize(print_.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
        return np.asarray(small / 255.0)

    def _glass(self) -> np.ndarray:
        """Transmission of the tube by rows: dark where the wall is seen edge on."""
        import cv2

        width, height = self.size
        assert self.robot.channel is not None
        radius = 0.5 * self.robot.channel.diameter
        fine = 8
        rows = (np.arange(height * fine) + 0.5) / fine - 0.5
        y = np.abs(rows - 0.5 * (height - 1)) * (self.camera_height - self.axis_height) / self.focal
        share = np.clip(y / radius, 0.0, 1.0)
        through = 1.0 - 0.16 * share**6
        wall = (y > radius) & (y < radius + 0.0017)
        through = np.where(wall, 0.38 + 0.35 * np.clip((y - radius) / 0.0017, 0.0, 1.0) ** 3, through)
        through = np.where(y >= radius + 0.0017, 1.0, through)
        return np.repeat(cv2.resize(through[:, None], (1, height), interpolation=cv2.INTER_AREA)[:, :1], width, axis=1)

    def draw(self, time: float) -> np.ndarray:
        """The picture at a time, (height, width, 3), 8-bit RGB."""
        import cv2

        scene, width, height = self.table.copy(), *self.size
        box = self._window(time)
        left, top, right, bottom = box
        if right > left and bottom > top:
            colour, cover = self._robot(time, box)
            shade = np.zeros((height, width), dtype=np.float32)
            shade[top:bottom, left:right] = cover
            wide = 3.2e-3 * self.focal / self.camera_height
            shift = np.array([[1.0, 0.0, 0.5 * wide], [0.0, 1.0, 0.8 * wide]])
            shade = cv2.GaussianBlur(cv2.warpAffine(shade, shift, (width, height)), (0, 0), wide)
            scene *= (1.0 - 0.22 * shade)[..., None]
            part = scene[top:bottom, left:right]
            part *= (1.0 - cover)[..., None]
            part += colour
        light = np.clip(scene, 0.0, 1.0)
        rng = np.random.default_rng([self.seed, 2, round(1e6 * time)])
        bytes_ = 255.0 * light ** (1 / 2.1)
        bytes_ += self.grain * (0.4 + 0.6 * np.sqrt(light)) * rng.standard_normal(bytes_.shape)
        return np.clip(np.rint(bytes_), 0, 255).astype(np.uint8)

    def _box(self, rear: float, front: float, reach: float, time: float) -> tuple[int, int, int, int]:
        """Pixels around a box about the robot's axis: left, top, right, bottom; not cut at the borders."""
        corners = np.array([[x, y, z] for x in (rear, front) for y in (-reach, reach) for z in (-reach, reach)])
        seen = self.pixels(self.placed(corners, time))
        low, high = np.floor(seen.min(axis=0)).astype(int) - 2, np.ceil(seen.max(axis=0)).astype(int) + 3
        return int(low[0]), int(low[1]), int(high[0]), int(high[1])

    def _window(self, time: float) -> tuple[int, int, int, int]:
        robot = self.robot
        front, half = 0.5 * robot.body.length, 0.5 * robot.body.diameter
        rear = -front - robot.coupling.length - robot.tail.length
        box = self._box(rear, front, max(half, robot.tail.amplitude + robot.tail.wire_diameter), time)
        return max(box[0], 0), max(box[1], 0), min(box[2], self.size[0]), min(box[3], self.size[1])

    def _robot(self, time: float, box: tuple[int, int, int, int]) -> tuple[np.ndarray, np.ndarray]:
        """Linear light of the robot in a window, weighted by its coverage, and the coverage."""
        left, top, right, bottom = box
        u = (np.arange((right - left) * _SIDE) + 0.5) / _SIDE - 0.5 + left
        v = (np.arange((bottom - top) * _SIDE) + 0.5) / _SIDE - 0.5 + top
        spread = (0.618034 * np.arange(max(u.size, v.size)) % 1.0 - 0.5) / _SIDE
        u, v = u + spread[: v.size, None], v[:, None] + spread[: u.size]
        colour, covered = np.zeros((*u.shape, 3)), np.zeros(u.shape, dtype=bool)
        self._draw_wire(u, v, time, colour, covered)
        body, coupling = self.robot.body, self.robot.coupling
        rear, front = -0.5 * body.length, 0.5 * body.length
        rounded = body.front_end == "hemisphere"
        solids = [(rear, front, 0.5 * body.diameter, rounded, True)]
        if coupling.diameter > 0:
            ends = rear - coupling.length + coupling.clearance, rear - coupling.clearance
            solids.insert(0, (*ends, 0.5 * coupling.diameter, False, False))
        for low, high, radius, round_, paint in solids:
            seen = self._box(low, high, radius, time)
            columns, rows = (
                slice(*(int(np.clip((edge - start) * _SIDE, 0, limit)) for edge in edges))
                for edges, start, limit in (
                    ((seen[0], seen[2]), left, u.shape[1]),
                    ((seen[1], seen[3]), top, u.shape[0]),
                )
            )
            part = rows, columns
            eye, ray = self._rays(u[part], v[part], time)
            hit, where, normal = _struck(eye, ray, low, high, radius, rounded=round_)
            covered[part] |= hit
            albedo = self._painted(where[hit], time) if paint else np.array([0.10, 0.095, 0.085])
            colour[part][hit] = self._lit(albedo, normal[hit])
        shape = (bottom - top, _SIDE, right - left, _SIDE)
        return colour.reshape(*shape, 3).mean(axis=(1, 3)), covered.reshape(shape).mean(axis=(1, 3))

    def _rays(self, u: np.ndarray, v: np.ndarray, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Eye and directions in the robot's level frame."""
        centre = 0.5 * (np.array(self.size) - 1.0)
        x, y, *_ = self.at(time)
        cos, sin = np.cos(self.heading), np.sin(self.heading)
        across, up = self.sign * (u - centre[0]) / self.focal, -self.sign * (v - centre[1]) / self.focal
        eye = np.array([-cos * x - sin * y, sin * x - cos * y, self.camera_height - self.axis_height])
        return eye, np.stack([cos * across + sin * up, cos * up - sin * across, np.full_like(across, -1.0)], axis=-1)

    def _painted(self, where: np.ndarray, time: float) -> np.ndarray:
        """Reflectance of the body at points of its level frame."""
        colours = np.broadcast_to(np.array(self.paint), where.shape).copy()
        seal, body = self.robot.seal, self.robot.body
        if seal is None:
            return colours
        on = where[:, 0] < -0.5 * body.length + seal.length
        if self.plain is not None or not seal.stripes:
            if self.plain in INKS:
                colours[on] = INKS[self.plain]
            return colours
        count = len(seal.stripes)
        even = (np.arange(count + 1) - 0.5) * 2 * np.pi / count
        edges = np.array(self.edges) if self.edges is not None else even
        angle = np.arctan2(-where[on, 1], where[on, 2]) - self.at(time)[2]
        angle = (angle - edges[0]) % (2 * np.pi) + edges[0]
        which = np.clip(np.searchsorted(edges, angle, side="right") - 1, 0, count - 1)
        colours[on] = np.array([INKS[name] for name in seal.stripes])[which]
        return colours

    def _lit(self, paint: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """Light of a surface: sky from above, the weak lamp, and the table's light that grazes the rim."""
        towards = _LAMP * np.array([self.sign, self.sign, 1.0]) / np.linalg.norm(_LAMP)
        facing = np.clip(normal @ towards, 0.0, None)[:, None]
        level = normal[:, 2:]
        shine = np.clip(2.0 * facing[:, 0] * level[:, 0] - towards[2], 0.0, None)[:, None]
        rim = np.clip(1.0 - level, 0.0, 1.0) ** 5
        return paint * (0.34 + 0.30 * level + 0.55 * facing) + 0.05 * shine**20 + 0.16 * rim * _TABLE

    def _draw_wire(self, u: np.ndarray, v: np.ndarray, time: float, colour: np.ndarray, covered: np.ndarray) -> None:
        """Cover what lies within half a wire of the projected centreline."""
        from scipy.spatial import cKDTree

        robot, tail = self.robot, self.robot.tail
        xi = np.linspace(0.0, tail.length, 3000)
        taper = np.inf if tail.taper is None else tail.taper
        radius = amplitude_envelope(xi, *(np.full(1, value) for value in (tail.amplitude, tail.length, taper)))[0]
        x = -0.5 * robot.body.length - robot.coupling.length - xi
        angle = robot.hand * 2 * np.pi / tail.wavelength * x + self.at(time)[3]
        wire = np.stack([x, radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
        shaft = np.linspace(-0.5 * robot.body.length, x[0], 300)
        wire = np.concatenate([np.stack([shaft, 0 * shaft, 0 * shaft], axis=-1), wire])
        seen = self.placed(wire, time)
        middle = self.pixels(seen)
        half = 0.5 * tail.wire_diameter * self.focal / (self.camera_height - seen[:, 2])
        # Behind the root the projected wire is a function of u, less steep than 1: the search is for pixels beside it.
        wide, order = 2.0 * float(half.max()), np.argsort(middle[:, 0])
        beside = np.abs(v[:, :] - np.interp(u[0], middle[order, 0], middle[order, 1])) < 2.0 * wide
        root = middle[300]
        near = beside | ((np.abs(u - root[0]) < 4.0 * wide) & (np.abs(v - root[1]) < 6.0 * wide))
        far, which = cKDTree(middle).query(np.stack([u[near], v[near]], axis=-1), distance_upper_bound=wide)
        on = np.isfinite(far)
        on[on] = far[on] <= half[which[on]]
        across = np.zeros(on.shape)
        across[on] = far[on] / half[which[on]]
        mask = np.zeros(u.shape, dtype=bool)
        mask[near] = on
        covered |= mask
        colour[mask] = (0.035 + 0.05 * np.sqrt(1.0 - across[on] ** 2))[:, None] * np.array([1.25, 0.85, 0.65])

    def setup(self) -> dict[str, str]:
        """Lines of the setup file, as an experimenter would write it."""
        return {
            "camera.view": '"top"',
            "camera.height": f'"{self.camera_height * 1e3!r} mm"',
            "markers.spacing": f'"{self.spacing * 1e3!r} mm"',
            "markers.height": '"0 mm"',
            "robot.file": f'"{self.robot.name}"',
            "robot.axis_height": f'"{self.axis_height * 1e3!r} mm"',
            "robot.direction": f'"{self.direction}"',
        }


def _struck(
    eye: np.ndarray, ray: np.ndarray, rear: float, front: float, radius: float, *, rounded: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where rays first meet a cylinder about x, with a hemisphere at its front or flat: hit, place, outward normal."""
    straight = front - radius if rounded else front
    nearest = np.full(ray.shape[:-1], np.inf)
    normal = np.zeros(ray.shape)

    def take(t: np.ndarray, good: np.ndarray, outward: Any) -> None:
        better = good & (t > 0) & (t < nearest)
        nearest[better] = t[better]
        normal[better] = outward(better)

    def at(t: np.ndarray) -> np.ndarray:
        return np.asarray(eye + t[..., None] * ray)

    with np.errstate(invalid="ignore", divide="ignore"):
        a, b = (ray[..., 1:] ** 2).sum(-1), (ray[..., 1:] * eye[1:]).sum(-1)
        t = (-b - np.sqrt(b * b - a * ((eye[1:] ** 2).sum() - radius**2))) / a
        p = at(t)
        take(t, (p[..., 0] >= rear) & (p[..., 0] <= straight), lambda m: p[m] * np.array([0, 1, 1]) / radius)
        for x, outward in ((rear, -1.0), *(() if rounded else ((front, 1.0),))):
            t = (x - eye[0]) / ray[..., 0]
            flat = at(t)
            inside = (flat[..., 1] ** 2 + flat[..., 2] ** 2 <= radius**2) & (outward * ray[..., 0] < 0)
            take(t, inside, lambda m, outward=outward: np.array([outward, 0.0, 0.0]))
        if rounded:
            from_nose = eye - np.array([straight, 0.0, 0.0])
            a, b = (ray**2).sum(-1), (ray * from_nose).sum(-1)
            t = (-b - np.sqrt(b * b - a * ((from_nose**2).sum() - radius**2))) / a
            q = from_nose + t[..., None] * ray
            take(t, q[..., 0] >= 0.0, lambda m: q[m] / radius)
    hit = np.isfinite(nearest)
    return hit, at(np.where(hit, nearest, 0.0)), normal


def backlit(**changes: Any) -> Backlit:
    """A film on the light table with some things changed."""
    return replace(Backlit(), **changes)
