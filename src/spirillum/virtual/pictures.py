"""Pictures of the virtual camera: radiance averaged over the exposure, then disturbances and encoding."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.kernels.core import blend, develop, draw
from spirillum.robot.mesh import robot_mesh
from spirillum.robot.robot import Robot
from spirillum.virtual.artifacts import ViewArtifacts
from spirillum.virtual.disturbances import Disturbances
from spirillum.virtual.optics import Backdrop, Tank, VirtualLens, backdrop, spots, tint
from spirillum.virtual.solids import MATERIALS, Lamps, RenderedSolid, Shading, joined, part_of, solids_of
from spirillum.virtual.trajectory import CameraFramePose, TrialTrajectory

_GLASS = 1.47  # refractive index of the cover; borosilicate glass, assumed
_WALL = 0.11  # thickness of its wall over its radius; assumed: 1 mm of 9
_AMBIENT = 0.85  # light of the room beside the picture over the picture's mean; assumed
_SIDEWAYS = float(np.cos(np.radians(75.0)))
"""Cosine of the angle to the vertical above which light comes from the room instead of the floor."""
_ENCODED = 2.0  # offset of a normal's components in its encoding as a colour, which is positive
_EMPTY = -1e30
_NEAREST, _FARTHEST = 1e-9, 0.9999
_FAR = np.linspace(_NEAREST, _FARTHEST, 501)  # distances from the centre over the radius, for paths of light
_SHARP, _BLUR = 2.0, 0.25  # shrinking from which on the floor's structure blurs, and how wide over the cover's radius


class Glass(NamedTuple):
    """The cover in a window of the picture."""

    share: Samples  #: Share of each pixel that the cover has, (rows, columns).
    across: Samples  #: x and y of its unit normal in the camera's frame, (rows, columns, 2).


class Cover:
    """The glass before a robot's seal: its surface to draw, and what is seen through it."""

    def __init__(self, robot: Robot, index: float, still: Backdrop, lamps: Lamps, side: float) -> None:
        from scipy.ndimage import gaussian_filter

        body = next(piece for piece in robot_mesh(robot) if piece.name == "body")
        self.solid: RenderedSolid = joined([part_of(body, body.region == 0)])
        self._radius, self._still, self._lamps, self._side = 0.5 * robot.body.diameter, still, lamps, side
        self._index = index
        pixels = float(1.0 / np.abs(np.diff(still.floor[..., 0], axis=1)).mean())
        self._ambient = _AMBIENT * still.light.mean(axis=(0, 1))
        self._blurred = gaussian_filter(still.light, (*(2 * [_BLUR * self._radius * pixels]), 0))
        self._pixels = pixels
        count = len(self.solid.faces)
        self._red, self._green = (np.tile(colour, (count, 1)) for colour in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))

    def encoded(self, turn: Samples) -> Shading:
        """Its normals as colours: x in red, y in green."""
        normals = self.solid.normals @ turn.T + _ENCODED
        return Shading(self._red, self._green, normals[..., 0], normals[..., 1])

    def decoded(self, depth: Samples, samples: Samples) -> Glass:
        """Cover in a window of samples, (rows, columns, k, 3), by the colours of `encoded`; clears the samples."""
        hit = np.asarray(depth > _EMPTY)[..., None]
        count = np.asarray(hit.sum(axis=2))
        across = np.where(hit, samples[..., :2], 0.0).sum(axis=2) / np.maximum(count, 1) - _ENCODED
        depth[:] = _EMPTY
        return Glass(hit.mean(axis=(2, 3)), np.where(count > 0, across, 0.0))

    def refract(self, picture: Samples, glass: Glass, left: int, top: int, height: float) -> None:
        """Replace the background of the cover by its refracted image in `picture`, whose linear light is changed."""
        from scipy.ndimage import map_coordinates

        v, u = np.nonzero(glass.share)
        across = glass.across[v, u]
        far = np.clip(np.hypot(*across.T), _NEAREST, _FARTHEST)
        shift, floor, detail = (np.interp(far, _FAR, values) for values in self._paths(height))
        move = self._side * (shift * self._pixels / far)[:, None] * across
        pixels = np.stack([top + v - move[:, 1], left + u + move[:, 0]])
        sharp, blurred = (
            np.stack([map_coordinates(light[..., k], pixels, order=1, mode="nearest") for k in range(3)], axis=-1)
            for light in (self._still.light, self._blurred)
        )
        seen = blurred + detail[:, None] * (sharp - blurred)
        through = self._ambient + floor[:, None] * (seen - self._ambient)
        picture[top + v, left + u] += glass.share[v, u][:, None] * (through - picture[top + v, left + u])

    def _paths(self, height: float) -> tuple[Samples, Samples, Samples]:
        """Shift, share of light from the floor, and how sharp the floor is there, at `_FAR`."""
        shift, floor = light_path(_FAR, self._radius, height, self._index)
        shrunk = np.abs(np.gradient(shift / self._radius + _FAR, _FAR))
        return shift, floor, 1.0 / np.maximum(shrunk / _SHARP, 1.0) ** 2

    def shine(self, picture: Samples, glass: Glass, left: int, top: int) -> None:
        """Add the lamps that the glass mirrors."""
        upwards = np.sqrt(np.maximum(1.0 - np.square(glass.across).sum(axis=-1), 0.0))
        normals = np.concatenate([glass.across, upwards[..., None]], axis=-1)
        _, _, specular, exponent = MATERIALS["body"]
        facing = np.maximum(normals @ self._lamps.halfway.T, 0.0) ** exponent @ self._lamps.strength
        rows, columns = glass.share.shape
        window = slice(top, top + rows), slice(left, left + columns)
        picture[window] += (specular * facing * glass.share * self._still.over[window])[..., None]


def light_path(far: Samples, radius: float, height: float, index: float) -> tuple[Samples, Samples]:
    """How far out the floor is seen through a round cover with air inside, m, and the share of its light."""
    # A line of sight stays in a plane with the normal, where wall and air are circles, and n times its distance from
    # the centre is the same in oil, glass and air (Bouguer's formula: M. Born, E. Wolf, Principles of Optics, 3.2).
    # Where that exceeds the air's radius, the air mirrors it (total reflection).
    inner = radius * (1.0 - _WALL)
    distance = far * radius
    at_oil, in_glass = np.arcsin(far), np.arcsin(index / _GLASS * far)
    at_air = np.arcsin(np.minimum(index * distance / (_GLASS * inner), 1.0))
    in_air = np.arcsin(np.minimum(index * distance / inner, 1.0))
    total = index * distance >= inner
    bent = np.where(total, np.pi - 2.0 * at_air, 2.0 * (in_air - at_air)) - 2.0 * (at_oil - in_glass)
    cos = np.cos(bent)
    steep = np.maximum(cos, _SIDEWAYS)
    sin = np.sin(bent)
    shift = distance * (cos - 1.0) + (height + distance * sin) * sin / steep
    passed = np.where(total, 1.0, (1.0 - _mirrored(at_air, in_air)) ** 2)
    return shift, passed * np.clip((cos - _SIDEWAYS) / 0.2, 0.0, 1.0)


def _mirrored(inside: Samples, outside: Samples) -> Samples:
    """Share of unpolarised light that a surface mirrors, by the angles on both sides (Fresnel)."""
    plus, minus = np.maximum(inside + outside, 1e-9), inside - outside
    upright = ((1.0 - _GLASS) / (1.0 + _GLASS)) ** 2
    oblique = 0.5 * ((np.sin(minus) / np.sin(plus)) ** 2 + (np.tan(minus) / np.tan(plus)) ** 2)
    return np.asarray(np.where(inside + outside < 1e-4, upright, oblique))


_STILL = 0.1  # motion blur below which an exposure is rendered at one time, pixels
_STEP = 0.8  # motion blur between two times of an exposure, pixels
_MAX_TIMES = 8
_LAMPS = {
    "top": ((0.25, 0.55, 0.85, 0.62), (-0.5, -0.45, 0.75, 0.38)),
    "side": ((0.2, 0.9, 0.5, 0.68), (0.0, 0.1, 1.0, 0.34)),
}
"""Direction towards each lamp (right, up, towards the camera) in the picture, and its strength; assumed."""
_SHADOW = 0.26  # relative loss of light in the robot's shadow on the floor; assumed
_MARGIN = 3
_SIDE = 4  # samples of a pixel along u and along v
_SAMPLES = _SIDE**2
_FEW = 13  # one in so many vertices serves to estimate the motion blur


class Painter:
    """Renderer of the robot in its tank. One painter serves one video: it reuses its buffers between frames."""

    def __init__(
        self, robot: Robot, tank: Tank, lens: VirtualLens, edges: Samples | None = None, *, covered: bool = False
    ) -> None:
        self.robot, self.tank, self.lens = robot, tank, lens
        self.body, self.rotor = solids_of(robot, edges=edges, covered=covered)
        self.still = backdrop(tank, lens)
        side = -1.0 if lens.leftwards else 1.0
        self._lamps = _lamps(tank.view, side)
        self._cover = Cover(robot, lens.index, self.still, self._lamps, side) if covered else None
        self._tint = tint(lens.surface - tank.tube_height)
        self._spots = np.ascontiguousarray(np.swapaxes(spots(_SIDE), 1, 2))
        self._depth = np.empty(0, dtype=np.float32)
        self._samples = np.empty(0, dtype=np.float32)

    def light(self, trajectory: TrialTrajectory, time: float, exposure: float) -> np.ndarray:
        """(rows, columns, 3) linear light of an exposure about a time."""
        middle = trajectory.at(time)
        solids = [(self.body, "body"), (self.rotor, "rotor")]
        if self._cover is not None:
            solids.append((self._cover.solid, "body"))
        parts = self._parts(solids, trajectory, middle, time, exposure)
        picture = self.still.light.copy()
        left, top, right, bottom = self._window([pixels for _, _, moments in parts for pixels in moments])
        if left >= right or top >= bottom:
            return picture
        depth, samples = self._buffers(bottom - top, right - left)

        def sample(part: tuple[RenderedSolid, Samples, list[Samples]], shading: Shading) -> None:
            solid, _, moments = part
            every = len(moments)  # each time has a share of every pixel's samples
            for number, pixels in enumerate(moments):
                draw(pixels, solid.faces, *shading, self._spots, number, every, left, top, depth, samples)

        glass = None
        if self._cover is not None:
            sample(parts.pop(), self._cover.encoded(middle.body))
            glass = self._cover.decoded(depth, samples)
            self._cover.refract(picture, glass, left, top, float(middle.position[2]))
        for part in parts:
            sample(part, part[0].shading(part[1], self._lamps))
        _, over, shine, floor = self.still
        blend(depth, samples, left, top, over, shine, floor, self._shadow(middle), self._tint, picture)
        if self._cover is not None and glass is not None:
            self._cover.shine(picture, glass, left, top)
        return picture

    def _parts(
        self,
        solids: list[tuple[RenderedSolid, str]],
        trajectory: TrialTrajectory,
        middle: CameraFramePose,
        time: float,
        exposure: float,
    ) -> list[tuple[RenderedSolid, Samples, list[Samples]]]:
        """Solids, each with its rotation and the pixels of its vertices at times over the exposure."""
        found = []
        for solid, name in solids:

            def seen(share: float, every: int = 1, solid: RenderedSolid = solid, name: str = name) -> Samples:
                pose = trajectory.at(time + share * exposure) if share else middle
                return self.lens.project(solid.vertices[::every] @ getattr(pose, name).T + pose.position)

            blur = float(np.abs(seen(0.5, _FEW) - seen(-0.5, _FEW))[:, :2].max()) if exposure > 0 else 0.0
            count = 1 if blur < _STILL else int(np.clip(np.ceil(blur / _STEP), 2, _MAX_TIMES))
            shares = (np.arange(count) + 0.5) / count - 0.5
            found.append((solid, getattr(middle, name), [seen(float(share)) for share in shares]))
        return found

    def _window(self, seen: list[Samples]) -> tuple[int, int, int, int]:
        """Columns and rows around the rendered content: left, top, right, bottom."""
        low = np.min([pixels[:, :2].min(axis=0) for pixels in seen], axis=0)
        high = np.max([pixels[:, :2].max(axis=0) for pixels in seen], axis=0)
        width, height = self.lens.size
        spare = _MARGIN + int(0.25 * (high[1] - low[1]))  # room for the shadow
        left, top = (int(np.floor(value)) - spare for value in low)
        right, bottom = (int(np.ceil(value)) + spare + 1 for value in high)
        return max(left, 0), max(top, 0), min(right, width), min(bottom, height)

    def _buffers(self, rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
        need = rows * columns * _SAMPLES
        if self._depth.size < need:
            self._depth = np.full(need, -1e30, dtype=np.float32)
            self._samples = np.empty(3 * need, dtype=np.float32)
        shape = (rows, columns, _SAMPLES)
        return self._depth[:need].reshape(shape), self._samples[: 3 * need].reshape(*shape, 3)

    def _shadow(self, pose: CameraFramePose) -> Samples:
        """Soft shadow, as `blend` takes it; the lamp is a little to one side."""
        half, radius = 0.5 * self.robot.body.length, 0.5 * self.robot.body.diameter
        x, y, z = (float(value) for value in pose.position)
        drop = (-0.1 if self.lens.leftwards else 0.1) * z
        edge = 0.95 * radius, 0.22 * radius
        return np.array([x, y - drop, *pose.body[:2, 0], half - 0.6 * radius, *edge, _SHADOW])


def _lamps(view: str, side: float) -> Lamps:
    """The lamps of a view; `side` is -1 where the camera is rotated by half a turn."""
    towards = np.array([direction for *direction, _ in _LAMPS[view]]) * np.array([side, side, 1.0])
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    halfway = towards + np.array([0.0, 0.0, 1.0])
    halfway /= np.linalg.norm(halfway, axis=1, keepdims=True)
    return Lamps(towards, halfway, np.array([strength for *_, strength in _LAMPS[view]]))


_TEXT = "synthetic"
_LETTERS = {  # 3 x 5 pixels, rows from the top
    "s": "011 100 010 001 110",
    "y": "000 101 011 001 110",
    "n": "000 110 101 101 101",
    "t": "010 111 010 010 011",
    "h": "100 100 110 101 101",
    "e": "000 010 111 100 011",
    "i": "010 000 010 010 010",
    "c": "000 011 100 100 011",
}
_LARGE = 480  # width of a picture above which the letters are twice as large, pixels


def stamp(image: np.ndarray) -> None:
    """Write the label into the lower right corner of a picture of bytes, which is changed."""
    mask = np.zeros((5, 4 * len(_TEXT) - 1), dtype=bool)
    for index, letter in enumerate(_TEXT):
        rows = [[digit == "1" for digit in row] for row in _LETTERS[letter].split()]
        mask[:, 4 * index : 4 * index + 3] = rows
    times = 2 if image.shape[1] >= _LARGE else 1
    mask = np.repeat(np.repeat(mask, times, axis=0), times, axis=1)
    height, width = mask.shape
    corner = image[-height - 3 : -3, -width - 3 : -3]
    corner[mask] = (60, 60, 66)


_VIGNETTING = 0.20  # relative loss of light in the corners; assumed
_STEPS = 1 << 14
_BRIGHTNESS = 1.05  # exposure of the camera: linear light of white paper is about 0.8


@dataclass
class FrameEncoder:
    """The frames of one video, in order: noise differs from frame to frame."""

    painter: Painter
    disturbances: Disturbances
    trajectory: TrialTrajectory
    exposure: float  #: Of each frame, s.
    view: ViewArtifacts | None = None

    def __post_init__(self) -> None:
        width, height = self.painter.lens.size
        v, u = np.meshgrid(np.linspace(-1, 1, height) * height, np.linspace(-1, 1, width) * width, indexing="ij")
        self._vignette = 1.0 - _VIGNETTING * (u**2 + v**2) / (width**2 + height**2)
        light = np.linspace(0.0, 1.0, _STEPS)
        self._curve = 255.0 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)

    def image(self, time: float) -> np.ndarray:
        """(height, width, 3) sRGB bytes of the frame at a time."""
        disturbances = self.disturbances
        light = self.painter.light(self.trajectory, time, self.exposure)
        disturbances.disturb(light, time, self.trajectory.at(time).position)
        if self.view is not None:
            light = self.view.camera_picture(light, time)
        image = np.empty(light.shape, dtype=np.uint8)
        gain = _BRIGHTNESS * disturbances.gain(time)
        starts = disturbances.starts(light.shape[0])
        develop(light, self._vignette, gain, self._curve, disturbances.grain, starts, disturbances.noise, image)
        stamp(image)
        return image
