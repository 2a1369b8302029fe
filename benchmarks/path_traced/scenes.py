"""Scenes of the experiment as data: what is in the tank, how the robot swims, and what the camera does to the picture.

Lengths are in mm, angles in degrees, rates in Hz, signed about +x of the robot.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any
from zlib import crc32

import numpy as np

__all__ = ["KINDS", "Motion", "Scene", "sample_scene"]


@dataclass(frozen=True)
class Motion:
    """True motion of the robot; it swims along the channel at constant rates."""

    speed: float = 0.0
    body_rate: float = 0.0
    tail_rate: float = 0.0
    heading: float = 0.0
    """Angle of the robot's axis to the channel."""
    wobble: float = 0.0
    """Amplitude of a lateral oscillation at the tail's rate, mm."""
    heading_wobble: float = 0.0
    """Amplitude of an oscillation of the heading at the tail's rate."""
    start: float = 0.0
    """x of the body's mid-length in the middle of the video."""
    body_angle: float = 0.0
    tail_phase: float = 0.0


@dataclass(frozen=True)
class Scene:
    """A video to be path traced."""

    kind: str
    seed: int
    cover: str = "glass"
    """What the body is made of: `glass` (air with a battery and a board inside), `liner` (glass over a dark liner) or
    `painted`; `none`: an empty tube."""
    paper: str = "ruler"
    """What lies under the tube: two strips of a `ruler` beside it, `grid` (2 mm) or `millimetre` paper."""
    lamps: int = 0
    """Lamps that are mirrored in the oil."""
    hand: bool = False
    """A hand rests at the tank for a part of the video."""
    caustics: bool = False
    """Light is refracted by tube and cover on its way from the lamps, too; needs several times the samples."""
    moving: bool = True
    direction: str = "right"
    handedness: str = "right"
    motion: Motion = field(default_factory=Motion)
    fps: float = 15.0
    duration: float = 3.0
    exposure: float = 1.0 / 60.0
    size: tuple[int, int] = (640, 480)
    eye: float = 210.0
    """Height of the lens."""
    oil: float = 60.0
    oil_index: float = 1.40
    tilt: tuple[float, float] = (0.0, 0.0)
    roll: float = 0.0
    field_of_view: float = 163.0
    """Width of the picture at the floor."""
    aperture: float = 0.7
    """Radius of the entrance pupil."""
    gap: float = 0.5
    """Between body and tube."""
    paper_height: float = 0.3
    brightness: float = 0.5
    """Linear light of paper in the picture, 1 is white."""
    noise: float = 1.0
    """Standard deviation of the sensor's noise at that light, steps of 255."""
    crf: int | None = 20
    """Constant rate factor of the encoder; None: a bit rate."""
    bit_rate: int | None = None
    """kb/s."""
    contents: Mapping[str, Any] = field(default_factory=dict)
    """Colours and sizes of what the cover holds."""

    @property
    def count(self) -> int:
        """Number of frames."""
        return int(np.floor(self.duration * self.fps + 1e-9)) + 1

    @property
    def traced(self) -> int:
        """Number of frames that differ by more than noise."""
        return self.count if self.hand or (self.moving and self.cover != "none") else 1

    @property
    def sign(self) -> float:
        """Sign of x of the robot in the picture."""
        return 1.0 if self.direction == "right" else -1.0


_SLOW: dict[str, Any] = {"slow": True, "fps": 4.0, "duration": 20.0}
_YAW: dict[str, Any] = {"heading": 2.0, "wobble": 0.35, "heading_wobble": 0.5}

KINDS: dict[str, dict[str, Any]] = {
    "glass-grid": {"paper": "grid", "crf": 18, **_YAW},
    "glass-liner": {"cover": "liner", "direction": "left", "handedness": "left"},
    "painted-grid": {"cover": "painted", "paper": "grid", "crf": 18},
    "glass": {},
    "reflections": {"lamps": 2, "crf": None, "bit_rate": 260, "noise": 2.5, "brightness": 0.35},
    "slow-glass": _SLOW,
    "slow-painted-grid": {"cover": "painted", "paper": "grid", "crf": 18, **_SLOW},
    "still": {"moving": False},
    "empty": {"cover": "none"},
    "glass-millimetre": {"paper": "millimetre", "crf": 18},
    "painted-millimetre": {"cover": "painted", "paper": "millimetre", "crf": 18},
    "slow-glass-grid": {"paper": "grid", "crf": 18, **_SLOW},
    "still-grid": {"paper": "grid", "moving": False, "crf": 18},
    "still-painted-grid": {"cover": "painted", "paper": "grid", "moving": False, "crf": 18},
    "empty-grid": {"cover": "none", "paper": "grid", "crf": 18},
    "painted": {"cover": "painted", **_YAW},
    "reflections-grid": {"lamps": 2, "paper": "grid", "crf": 20},
    "low-bitrate": {"crf": None, "bit_rate": 120},
    "low-bitrate-grid": {"paper": "grid", "crf": None, "bit_rate": 400},
    "dark-room": {"brightness": 0.06, "noise": 5.0},
    "dark-room-grid": {"paper": "grid", "brightness": 0.06, "noise": 5.0},
    "hand": {"hand": True},
    "caustics": {"caustics": True},
    "caustics-grid": {"paper": "grid", "caustics": True, "crf": 18},
    "slow-liner": {"cover": "liner", **_SLOW},
    "slow-reflections": {"lamps": 2, **_SLOW},
    "rolled": {"cover": "liner", "roll": 3.0, "eye": 460.0},
}
"""What each kind of scene has of its own; the rest is sampled or as in `Scene`."""


def sample_scene(kind: str, seed: int, changes: Mapping[str, Any] | None = None) -> Scene:
    """A scene of a kind with random truth.

    Args:
        kind: one of `KINDS`.
        seed: of all random numbers.
        changes: fields of `Scene` that are given instead, and of `motion` those of `Motion`.
    """
    own = dict(KINDS[kind])
    rng = np.random.default_rng([seed, crc32(kind.encode())])
    slow = own.pop("slow", False)
    yaw = {name: own.pop(name, 0.0) for name in ("heading", "wobble", "heading_wobble")}
    left = own.get("handedness") == "left"
    motion = _sample_motion(rng, slow=slow, moving=own.get("moving", True) and own.get("cover") != "none", left=left)
    scene = Scene(
        kind,
        seed,
        motion=replace(motion, **yaw),
        oil=60.0 + 0.7 * rng.normal(),
        oil_index=1.40 + 0.0025 * rng.normal(),
        tilt=(0.5 * rng.normal(), 0.5 * rng.normal()),
        field_of_view=rng.uniform(158.0, 168.0),
        aperture=rng.uniform(0.4, 1.0),
        gap=rng.uniform(0.2, 0.7),
        paper_height=rng.uniform(0.1, 0.5),
        contents=_sample_contents(rng),
        **own,
    )
    given = dict(changes or {})
    if "motion" in given:
        given["motion"] = replace(scene.motion, **given["motion"])
    return replace(scene, eye=scene.eye + 0.8 * rng.normal(), **given)


def _sample_motion(rng: np.random.Generator, *, slow: bool, moving: bool, left: bool) -> Motion:
    """Rates of a slow robot, or of the paper's; the body turns against the tail."""
    if slow:
        speed, body, tail = np.exp(rng.uniform(np.log([0.02, 0.002, 0.02]), np.log([0.3, 0.02, 0.25])))
    else:
        speed, body, tail = rng.uniform([0.8, 0.06, 0.8], [2.3, 0.19, 1.9])
    angles = rng.uniform(0.0, 360.0, 2)
    start = float(rng.uniform(20.0, 40.0))
    side = -1.0 if left else 1.0
    motion = Motion(start=start, body_angle=float(angles[0]), tail_phase=float(angles[1]))
    if not moving:
        return motion
    return replace(motion, speed=float(speed), body_rate=-side * float(body), tail_rate=side * float(tail))


def _sample_contents(rng: np.random.Generator) -> dict[str, Any]:
    """What a cover holds: a battery as a box or a cylinder, its colours, a board."""
    wraps = ((0.30, 0.36, 0.50), (0.75, 0.75, 0.74), (0.20, 0.22, 0.24), (0.55, 0.30, 0.16))
    return {
        "box": bool(rng.uniform() < 0.6),
        "wrap": wraps[int(rng.integers(len(wraps)))],
        "back": (0.74, 0.74, 0.72),
        "length": float(rng.uniform(11.5, 14.0)),
        "wall": float(rng.uniform(0.8, 1.2)),
        "liner": float(rng.uniform(0.05, 0.12)),
        "paint": float(rng.uniform(0.08, 0.16)),
    }
