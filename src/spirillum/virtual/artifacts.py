"""Image degradations and artifacts of a recording: their options, and their effects on frames and pictures."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BeforeValidator, Field

from spirillum.arrays import Samples
from spirillum.errors import InputError, did_you_mean
from spirillum.optional_dependencies import import_optional
from spirillum.robot.arguments import Options, in_range, whole, within
from spirillum.robot.fields import Angle, Time
from spirillum.robot.robot import Robot

_LOST, _SHAKE, _PAINT, _CABLES, _MIRRORED = range(30, 35)
_WAVES, _SLOWEST, _FASTEST = 4, 0.15, 1.2  # waves of a hand's sway, and their frequencies, Hz; assumed
_JITTER = 1.0 / 3.0  # standard deviation of the jitter from frame to frame over the sway; assumed
_TURN = 2e-4  # roll of a hand-held camera over its sway, rad per pixel; assumed


class Degradation(Options, argument="degradation"):
    """Amounts of the disturbances of a video; the defaults are a clean one's."""

    noise: Annotated[float, BeforeValidator(in_range(0.0, 64.0))] = 0.0
    """Standard deviation of the noise, in steps of 255; independent in every pixel and colour."""
    lamp_drift: Annotated[float, BeforeValidator(in_range(0.0, 0.9))] = 0.0
    """Relative change of the lamp's brightness."""
    crf: Annotated[int, BeforeValidator(whole(0, 51))] = 18
    """Constant rate factor of the compression (H.264), 0 (lossless) to 51."""
    dropped: Annotated[float, BeforeValidator(in_range(0.0, 0.9))] = 0.0
    """Share of frames that are lost; the time stamps of the others stay true."""
    tilt: Annotated[Angle, within(0.0, 0.2, "rad")] = 0.0
    """Angle between optical axis and vertical, in a random direction."""
    glare: Annotated[float, BeforeValidator(in_range(0.0, 1.0))] = 0.0
    """Share of the body's picture under a spot of glare."""
    glare_moves: Annotated[bool, Field(strict=True)] = True
    """The glare moves with the body, instead of standing still in the lab."""
    bubbles: Annotated[int, BeforeValidator(whole(0, 200))] = 0
    """Number of bubbles that drift under the top of the tube."""
    hand: Annotated[bool, Field(strict=True)] = False  #: The shadow of a hand passes over the picture.

    @classmethod
    def of(cls, value: str | Self | Mapping[str, Any] | None) -> Self:
        """A degradation from its name, itself, its fields (over those of a `preset`), or None: a clean video."""
        given = {"preset": value} if isinstance(value, str) else value
        if isinstance(given, Mapping) and given.get("preset") is not None:
            name = str(given["preset"])
            if name not in _PRESETS:
                hint = did_you_mean(name, _PRESETS)
                raise InputError(f"degradation = {name[:40]!r}{hint}; allowed: {', '.join(_PRESETS)}")
            instead = {field: new for field, new in given.items() if field != "preset" and new is not None}
            given = _PRESETS[name] | instead
        return super().of(given)

    def uncompressed(self) -> Self:
        """The degradation of frames that are written as PNG files, without compression."""
        if self.crf and self.crf not in {self.of(name).crf for name in _PRESETS}:
            raise InputError(
                f"crf = {self.crf} (of --crf or --trouble compression) for a folder of PNG files, which are lossless; "
                "allowed: with a video (.mp4)"
            )
        return self.model_copy(update={"crf": 0})


_PRESETS: dict[str, dict[str, Any]] = {
    "clean": {},
    "degraded": {"noise": 8.0, "lamp_drift": 0.2, "crf": 33, "dropped": 0.05, "tilt": math.radians(2.0), "glare": 0.2},
}
"""Named degradations; `degraded` is what measuring is tested with."""


class Troubles(Options, argument="troubles"):
    """Amounts of the artifacts of a video; the defaults are none."""

    lost_frames: Annotated[float, BeforeValidator(in_range(0.0, 0.5))] = 0.0
    """Share of frames that are lost while the film's times go on evenly, as simple recording scripts write them."""
    clock_jump: Annotated[Time, within(0.0, 1e5, "s")] = 0.0
    """Time by which the clock of the camera jumps forward in the middle of the film, s; no frame is missing there."""
    handheld: Annotated[float, BeforeValidator(in_range(0.0, 30.0, " pixels"))] = 0.0
    """Sway of a camera held by hand: standard deviation of its slow part, pixels; a third of it from frame to frame."""
    rolled: Annotated[Angle, within(-0.6, 0.6, "rad")] = 0.0
    """Angle by which the camera is turned about its optical axis against the channel."""
    uneven_stripes: Annotated[float, BeforeValidator(in_range(0.0, 0.5))] = 0.0
    """Widths of hand-painted stripes: largest difference from an even one, over it."""
    blurred: Annotated[float, BeforeValidator(in_range(0.0, 10.0, " pixels"))] = 0.0
    """Standard deviation of what a lens out of focus makes of a point, pixels."""
    cables: Annotated[int, BeforeValidator(whole(0, 8))] = 0
    """Number of dark cables that hang across the view, between camera and oil."""
    mirrored_lamps: Annotated[int, BeforeValidator(whole(0, 8))] = 0
    """Number of lamps that the oil's surface mirrors into the picture."""
    grid_paper: Annotated[bool, Field(strict=True)] = False
    """Whether grid paper is under the tube, instead of a ruler beside it."""
    glass_cover: Annotated[bool, Field(strict=True)] = False
    """Whether the body before its seal is a cover of glass with a battery and a board inside, as the paper's."""

    @property
    def uses_seed(self) -> bool:
        """Whether any of these artifacts is random."""
        usual = Troubles()
        return any(getattr(self, name) != getattr(usual, name) for name in _RANDOM)


_RANDOM = ("lost_frames", "handheld", "uneven_stripes", "cables", "mirrored_lamps")
"""Random artifacts; the others are equal for all seeds."""

_USUAL: dict[str, dict[str, Any]] = {
    "lost-frames": {"lost_frames": 0.03},
    "clock-jump": {"clock_jump": 2.0},
    "handheld": {"handheld": 3.0},
    "rolled": {"rolled": np.radians(4.0)},
    "uneven-stripes": {"uneven_stripes": 0.2},
    "blurred": {"blurred": 1.0},
    "cables": {"cables": 2},
    "mirrored-lamps": {"mirrored_lamps": 2},
    "grid-paper": {"grid_paper": True},
    "glass-cover": {"glass_cover": True},
}
"""Typical size of each artifact: 7 frames of 240; 2 s; 3 pixels; 4 degrees; a fifth; one pixel; two; two."""
_DISTURBANCES: dict[str, dict[str, Any]] = {
    "noise": {"noise": 8.0},
    "lamp": {"lamp_drift": 0.2},
    "compression": {"crf": 34},
    "missing-frames": {"dropped": 0.1},
    "tilted": {"tilt": np.radians(2.0)},
    "glare": {"glare": 0.2},
    "standing-glare": {"glare": 0.2, "glare_moves": False},
    "bubbles": {"bubbles": 8},
    "hand": {"hand": True},
}
"""Artifacts that are disturbances of the picture (`Degradation`), and their typical size."""
NAMES = (*_USUAL, *_DISTURBANCES)  #: All artifacts that a rendered video may have.


def with_troubles(
    value: str | Troubles | Mapping[str, Any] | None, degradation: str | Degradation | Mapping[str, Any] | None
) -> tuple[Troubles, Degradation]:
    """Artifacts from a caller's value, and the degradation with those among them that disturb the picture."""
    stated = Degradation.of(degradation)
    chosen: dict[str, Any] = {}
    disturbed: dict[str, Any] = {}
    for word in (part.strip() for part in value.split(",")) if isinstance(value, str) else ():
        if word not in NAMES:
            raise InputError(f"trouble {word[:40]!r}{did_you_mean(word[:40], NAMES)}; allowed: {', '.join(NAMES)}")
        chosen |= _USUAL.get(word, {})
        disturbed |= _DISTURBANCES.get(word, {})
    given = degradation.model_dump(exclude_unset=True) if isinstance(degradation, Degradation) else degradation
    fields = given if isinstance(given, Mapping) else {}
    found = stated.model_copy(update={name: size for name, size in disturbed.items() if fields.get(name) is None})
    if not (found.glare_moves or found.glare):
        raise InputError("glare_moves = False without glare; allowed: with a glare above 0")
    return Troubles.of(chosen if isinstance(value, str) else value), found


def counted_frames(troubles: Troubles, kept: np.ndarray, fps: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the remaining frames as recorded, and those from which the video computes their times."""
    lost = min(round(troubles.lost_frames * kept.size), max(kept.size - 2, 0))
    left = counted = kept
    if lost:
        gone = np.random.default_rng([seed, _LOST]).permutation(kept.size - 2)[:lost] + 1
        left = np.delete(kept, gone)
        counted = left[0] + np.arange(left.size)
    late = round(troubles.clock_jump * fps)
    return left, counted + late * (np.arange(counted.size) >= (counted.size + 1) // 2) if late else counted


def stripe_edges(troubles: Troubles, count: int, seed: int) -> Samples:
    """Angles of the edges between stripes from the first edge on, rad, (count + 1,); even without artifacts."""
    even = 2.0 * np.pi / count
    widths = 1.0 + troubles.uneven_stripes * np.random.default_rng([seed, _PAINT]).uniform(-1.0, 1.0, count)
    edges = np.concatenate([[0.0], np.cumsum(widths)]) * (2.0 * np.pi / widths.sum())
    return np.asarray(edges - 0.5 * even, dtype=float)


def repainted(robot: Robot, vertices: Samples, edges: Samples) -> Samples:
    """Vertices of a body of revolution turned about its axis so that its stripes have other edges."""
    if robot.seal is None or not robot.seal.stripes:
        return vertices
    x, y, z = vertices.T
    count = len(robot.seal.stripes)
    first = -np.pi / count
    angle = (np.arctan2(-y, z) - first) % (2.0 * np.pi) + first
    new = np.interp(angle, 2.0 * np.pi / count * (np.arange(count + 1) - 0.5), edges)
    radius = np.hypot(y, z)
    return np.stack([x, -radius * np.sin(new), radius * np.cos(new)], axis=1)


@dataclass(frozen=True)
class Shake:
    """Camera shake: roll and sway."""

    troubles: Troubles
    seed: int
    _waves: Samples = field(init=False, repr=False)

    def __post_init__(self) -> None:
        rng = np.random.default_rng([self.seed, _SHAKE])
        rates = np.exp(rng.uniform(np.log(_SLOWEST), np.log(_FASTEST), (3, _WAVES)))
        phases, sizes = rng.uniform(0.0, 2.0 * np.pi, (3, _WAVES)), rng.uniform(0.5, 1.0, (3, _WAVES))
        sizes *= np.sqrt(2.0) / np.linalg.norm(sizes, axis=1, keepdims=True)
        object.__setattr__(self, "_waves", np.stack([2.0 * np.pi * rates, phases, sizes]))

    def at(self, time: float) -> tuple[float, float, float]:
        """Shift of the picture to the right and downwards, pixels, and its roll, rad, at a time."""
        rates, phases, sizes = self._waves
        sway = np.sum(sizes * np.sin(rates * time + phases), axis=1)
        jitter = _JITTER * np.random.default_rng([self.seed, _SHAKE, round(1e4 * time)]).standard_normal(3)
        u, v, turn = self.troubles.handheld * (sway + jitter)
        return float(u), float(v), self.troubles.rolled + _TURN * float(turn)

    def moved(self, light: np.ndarray, time: float) -> np.ndarray:
        """Return a picture in the moving camera; its borders are extended."""
        if not (self.troubles.handheld or self.troubles.rolled):
            return light
        cv2 = import_optional("cv2", "a camera that is not still", "video")
        u, v, roll = self.at(time)
        rows, columns, _ = light.shape
        matrix = cv2.getRotationMatrix2D((0.5 * (columns - 1), 0.5 * (rows - 1)), np.degrees(roll), 1.0)
        matrix[:, 2] += u, v
        moved = cv2.warpAffine(light, matrix, (columns, rows), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        return np.ascontiguousarray(np.maximum(moved, 0.0), dtype=light.dtype)


_CABLE = 1.0 / 80.0  # width of a cable over that of the picture; assumed
_CABLE_LIGHT = 0.02  # linear light of a cable: black rubber; assumed


class ViewArtifacts:
    """Artifacts between the robot and a picture of it: mirrored lamps, cables, a moving or unfocused camera."""

    def __init__(self, troubles: Troubles, seed: int, size: tuple[int, int]) -> None:
        self._shake, self._blurred = Shake(troubles, seed), troubles.blurred
        self._cables = _cables(troubles.cables, seed, size) if troubles.cables else None
        self._lamps = _mirrored_lamps(troubles.mirrored_lamps, seed, size) if troubles.mirrored_lamps else None

    def camera_picture(self, light: np.ndarray, time: float) -> np.ndarray:
        """A picture as the camera sees it at a time."""
        if self._lamps is not None:
            light = light + self._lamps
        if self._cables is not None:
            light = (light * (1.0 - self._cables) + _CABLE_LIGHT * self._cables).astype(light.dtype)
        light = self._shake.moved(light, time)
        if self._blurred:
            cv2 = import_optional("cv2", "a lens out of focus", "video")
            light = cv2.GaussianBlur(light, (0, 0), self._blurred)
        return light


_LAMP_LIGHT = 0.22  # linear light of a lamp in the oil's surface, which mirrors 3 %; white paper has 0.8; assumed
_LEAST_LAMP, _LARGEST_LAMP = (0.12, 0.20), (0.27, 0.31)  # sides of a lamp over the picture's width and height; assumed


def _mirrored_lamps(count: int, seed: int, size: tuple[int, int]) -> np.ndarray:
    """Light that rectangular lamps add to each pixel, which the still surface mirrors, (rows, columns, 1)."""
    columns, rows = size
    rng = np.random.default_rng([seed, _MIRRORED])
    v, u = np.mgrid[0:rows, 0:columns]
    light = np.zeros((rows, columns))
    for _ in range(count):
        middle = rng.uniform(0.1, 0.9, 2) * size
        half = 0.5 * rng.uniform(_LEAST_LAMP, _LARGEST_LAMP) * size
        turn = rng.uniform(-0.12, 0.12)
        along = np.abs((u - middle[0]) * np.cos(turn) + (v - middle[1]) * np.sin(turn)) - half[0]
        down = np.abs((v - middle[1]) * np.cos(turn) - (u - middle[0]) * np.sin(turn)) - half[1]
        light += _LAMP_LIGHT * np.clip(0.5 - 0.5 * np.maximum(along, down), 0.0, 1.0)  # edges of two pixels
    return light[..., None].astype(np.float32)


def _cables(count: int, seed: int, size: tuple[int, int]) -> Samples:
    """Share of each pixel that cables cover, which hang from the upper to the lower border, (rows, columns, 1)."""
    cv2 = import_optional("cv2", "cables", "video")
    columns, rows = size
    rng = np.random.default_rng([seed, _CABLES])
    cover = np.zeros((rows, columns), dtype=np.uint8)
    along = np.linspace(-0.05, 1.05, 40)
    for _ in range(count):
        start, lean, sway, phase = rng.uniform([0.1, -0.2, 0.02, 0.0], [0.9, 0.2, 0.05, 2.0 * np.pi])
        across = columns * (start + sway * np.sin(2.0 * np.pi * along + phase)) + lean * rows * (along - 0.5)
        path = np.rint(16.0 * np.column_stack([across, rows * along])).astype(np.int32)
        thickness = max(2, round(_CABLE * columns))
        cv2.polylines(cover, [path], isClosed=False, color=255, thickness=thickness, lineType=cv2.LINE_AA, shift=4)
    return (cover / 255.0)[..., None]
