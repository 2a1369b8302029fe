"""A scene as a job for the tracer: camera, tank, lamps, meshes, and the robot's pose on every frame; mm."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from path_traced.geometry import meshes_of, poses_of, robot_of
from path_traced.papers import Paper, papers_of
from path_traced.scenes import Scene

__all__ = ["axis_height", "papers", "write_job"]

_INNER, _OUTER, _TUBE_LENGTH, _TUBE_INDEX = 20.0, 22.0, 350.0, 1.47
_BESIDE_BODY, _BESIDE_TAIL, _BEYOND = 10.0, 3.0, 8.0
"""Reach of the windows beside body and tail, and beyond nose and tail, mm: what lies in the robot's shadow."""
_STEPS = (-0.5, 0.0, 0.5)
_CEILING = 1500.0
"""Of the lamps above the lens, mm."""
_FINGERS = [((-24.0 + 16.0 * k, -58.0 + 6.0 * abs(k - 1.5), 0.0), (7.5, 32.0, 7.5), 0.06 * (k - 1.5)) for k in range(4)]
_PALM, _THUMB = ((0.0, 0.0, 0.0), (42.0, 40.0, 13.0), 0.0), ((46.0, -18.0, 0.0), (9.0, 28.0, 9.0), 0.7)
_ARM = (0.0, 90.0, 8.0), (30.0, 90.0, 24.0), 0.0
"""Bones of a hand: centre and semi-axes, mm, turn about the vertical, rad."""


def _apparent_depth(scene: Scene, height: float) -> float:
    """Distance from the lens at which a point at a height seems to lie, seen straight down, mm."""
    return scene.eye - scene.oil + (scene.oil - height) / scene.oil_index


def _focal_pixels(scene: Scene) -> float:
    """Focal length that shows the scene's field of view at the floor."""
    return scene.size[0] * _apparent_depth(scene, 0.0) / scene.field_of_view


def axis_height(scene: Scene, robot: Any) -> float:
    """Height of the body's axis above the floor: the tube lies on it, or on the paper, and the body low in the tube."""
    return _tube_axis(scene) - (_INNER - 0.5e3 * robot.body.diameter - scene.gap)


def _tube_axis(scene: Scene) -> float:
    return _OUTER + (0.0 if scene.paper == "ruler" else scene.paper_height)


def _frame_times(scene: Scene) -> np.ndarray:
    """Times of the frames, s, the middle of their exposures."""
    return np.arange(scene.count) / scene.fps


def papers(scene: Scene) -> list[Paper]:
    """The sheets on the floor."""
    return papers_of(scene.paper, _OUTER, scene.seed)


def write_job(scene: Scene, folder: Path, samples: int) -> Path:
    """Write what the tracer reads: `job.json`, `meshes.npz` and the papers' pictures.

    Args:
        scene: to be traced.
        folder: for the job and its frames.
        samples: of each pixel.
    """
    folder.mkdir(parents=True, exist_ok=True)
    robot = robot_of(scene)
    meshes = meshes_of(scene, robot)
    arrays = {f"{name}{k}": mesh[name] for k, mesh in enumerate(meshes) for name in ("vertices", "faces", "colours")}
    np.savez(folder / "meshes.npz", **arrays)
    sheets = []
    for number, paper in enumerate(papers(scene)):
        name = f"paper-{number}.png"
        paper.picture.save(folder / name)
        sheets.append({"picture": name, "centre": paper.centre, "size": paper.size, "height": scene.paper_height})
    height = axis_height(scene, robot)
    job = {
        "seed": scene.seed,
        "size": scene.size,
        "samples": samples,
        "still_samples": 2 * samples,
        "caustics": scene.caustics,
        "shutter": scene.exposure * scene.fps,
        "camera": {
            "eye": scene.eye,
            "focal_pixels": _focal_pixels(scene),
            "tilt": np.radians(scene.tilt).tolist(),
            "roll": float(np.radians(scene.roll)),
            "aperture": scene.aperture,
            "focus": _apparent_depth(scene, height),
        },
        "oil": {"height": scene.oil, "index": scene.oil_index},
        "tube": {
            "axis": _tube_axis(scene),
            "inner": _INNER,
            "outer": _OUTER,
            "length": _TUBE_LENGTH,
            "index": _TUBE_INDEX,
        },
        "papers": sheets,
        "ambient": (0.33, 0.335, 0.325),
        "lamps": _lamps(scene),
        "hand": {"colour": (0.62, 0.36, 0.26), "bones": [_PALM, _THUMB, _ARM, *_FINGERS]} if scene.hand else None,
        "meshes": [{"part": mesh["part"], "material": mesh["material"]} for mesh in meshes],
        "frames": _frames(scene, height, robot),
    }
    path = folder / "job.json"
    path.write_text(json.dumps(job))
    return path


def _lamps(scene: Scene) -> list[dict[str, Any]]:
    """Two large panels beside the picture, and lamps whose mirrored pictures lie in it."""
    rng = np.random.default_rng([scene.seed, 3])
    high = scene.eye + _CEILING
    found = [
        {"centre": (1500.0, 700.0, high), "size": (1200.0, 600.0), "radiance": 2.4, "colour": (1.0, 0.97, 0.92)},
        {"centre": (-1400.0, -900.0, high), "size": (1200.0, 600.0), "radiance": 1.7, "colour": (0.93, 0.97, 1.0)},
    ]
    if scene.kind.startswith("dark-room"):
        found = found[:1]
    scale = (2.0 * (scene.eye - scene.oil) + _CEILING) / _focal_pixels(scene)  # mm in the mirrored ceiling a pixel
    for number in range(scene.lamps):
        side = 1.0 if number % 2 else -1.0
        u, v = side * rng.uniform(150.0, 250.0), rng.uniform(-120.0, 120.0)
        if number % 2:
            v = rng.uniform(-40.0, 60.0)
        size = scale * rng.uniform(110.0, 190.0, 2)
        found.append(
            {
                "centre": (scale * u, -scale * v, high),
                "size": size.tolist(),
                "radiance": 7.0,
                "colour": (1.0, 0.98, 0.95),
            }
        )
    return found


def _frames(scene: Scene, height: float, robot: Any) -> list[dict[str, Any]]:
    """Poses at the beginning, middle and end of each exposure, and the windows that hold the robot.

    A robot that stands still has one frame, and an empty tube has no window: noise is added later.
    """
    times = _frame_times(scene)
    moments = (times[:, None] + scene.exposure * np.array(_STEPS)).reshape(-1)
    poses = poses_of(scene, moments, height)
    found = []
    for number in range(scene.traced):
        keys = []
        for step, offset in enumerate(_STEPS):
            place = len(_STEPS) * number + step
            pose = {name: values[place].tolist() for name, values in poses.items()}
            keys.append((offset * scene.exposure * scene.fps, pose))
        windows = [None] if scene.hand else _windows(scene, keys[1][1], height, robot)
        found.append({"keys": keys, "windows": windows, "hand": _hand_place(scene, times[number])})
    return found


def _hand_place(scene: Scene, time: float) -> tuple[float, float, float]:
    """Middle of the palm: the hand comes from behind the tank, rests above its edge, and leaves."""
    share = time / scene.duration
    near = np.clip(min(share - 0.1, 0.85 - share) / 0.25, 0.0, 1.0)
    near = near * near * (3.0 - 2.0 * near)
    return 30.0 + 3.0 * float(np.sin(9.0 * time)), 230.0 - 125.0 * float(near), scene.oil + 25.0


def _windows(scene: Scene, pose: dict[str, Any], height: float, robot: Any) -> list[tuple[int, int, int, int]]:
    """Windows about the body and about the tail: left, top, right and bottom in the picture, where they are in it."""
    if scene.cover == "none":
        return []
    half, joint = 0.5e3 * robot.body.length, 1e3 * robot.coupling.length
    tail, amplitude = 1e3 * robot.tail.length, 1e3 * robot.tail.amplitude
    body = (-half - joint - 1.0, half + _BEYOND), 0.5e3 * robot.body.diameter + _BESIDE_BODY
    rear = (-half - joint - tail - _BEYOND, -half - joint + _BEYOND), amplitude + _BESIDE_TAIL
    found = [_window(scene, pose, height, *place) for place in (body, rear)]
    return [(left, top, right, bottom) for left, top, right, bottom in found if right - left > 1 and bottom - top > 1]


def _window(
    scene: Scene, pose: dict[str, Any], height: float, along_body: tuple[float, float], beside: float
) -> tuple[int, int, int, int]:
    """The window about a part of the robot, from x to x on its axis."""
    heading = pose["heading"]
    along, across = np.array([np.cos(heading), np.sin(heading)]), np.array([-np.sin(heading), np.cos(heading)])
    corners = np.array([[x, y] for x in along_body for y in (-beside, beside)])
    points = np.array(pose["position"][:2]) + corners[:, :1] * along + corners[:, 1:] * across
    focal, (width, tall) = _focal_pixels(scene), scene.size
    tilt_x, tilt_y = np.radians(scene.tilt)
    x, y = focal * points.T / _apparent_depth(scene, height)
    # The tilted, rolled camera, to first order.
    x, y = x + focal * np.tan(tilt_y), y - focal * np.tan(tilt_x)
    roll = np.radians(scene.roll)
    u = 0.5 * width + x * np.cos(roll) + y * np.sin(roll)
    v = 0.5 * tall + x * np.sin(roll) - y * np.cos(roll)
    low_u, high_u = np.clip([u.min(), u.max()], 0, width)
    low_v, high_v = np.clip([v.min(), v.max()], 0, tall)
    return int(low_u), int(low_v), int(np.ceil(high_u)), int(np.ceil(high_v))
