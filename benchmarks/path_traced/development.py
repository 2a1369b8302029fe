"""From traced light to the video: window into the still picture, vignetting, sensor noise, H.264; setup and truth."""

from __future__ import annotations

from dataclasses import asdict
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from path_traced.geometry import robot_of
from path_traced.job import axis_height, papers
from path_traced.scenes import Scene

from spirillum.files import atomic_write
from spirillum.formats.h264 import h264_writer

__all__ = ["develop", "setup_text", "truth_of"]

_FEATHER = 32
"""Most pixels over which a window joins the still picture, so that the end of its shadow is no edge."""
_VIGNETTING = 0.12
_SYNTHETIC = "synthetic: path traced, not a measurement"


Window = tuple[int, int, int, int] | None


def develop(scene: Scene, folder: Path, target: Path, windows: list[list[Window]]) -> None:
    """Encode the traced frames of a folder.

    Args:
        scene: says how bright and noisy the picture is, and how it is compressed.
        folder: with `still.npy` and the frames.
        target: the video.
        windows: of the traced frames in the picture; a single frame is repeated.
    """
    still = np.load(folder / "still.npy").astype(np.float32)
    gain = scene.brightness / float(np.percentile(still.mean(axis=-1), 95.0))
    rng = np.random.default_rng([scene.seed, 11])
    shade = _vignette(scene.size)
    quality = {"preset": "medium"}
    if scene.crf is not None:
        quality["crf"] = str(scene.crf)
    else:
        quality |= {"b": f"{scene.bit_rate}k", "maxrate": f"{scene.bit_rate}k", "bufsize": f"{2 * scene.bit_rate}k"}
    with (
        atomic_write(target) as temporary,
        h264_writer(
            temporary,
            scene.size,
            Fraction(scene.fps).limit_denominator(1001),
            {"title": f"{scene.kind} {scene.seed}, synthetic", "comment": _SYNTHETIC},
            quality=quality,
            threads=1,
            encoders=("libx264",),
            instead="an environment with libx264",
            extra="video",
        ) as writer,
    ):
        for number in range(scene.count):
            place = min(number, len(windows) - 1)
            light = still.copy()
            for k, window in enumerate(windows[place]):
                _paste(light, np.load(folder / f"{place:05d}-{k}.npy").astype(np.float32), window)
            writer.add(_exposed(gain * shade * light, scene, rng), number)


def _paste(light: np.ndarray, part: np.ndarray, window: Window) -> None:
    """Put a window into the picture; its borders fade, but those of the picture. None: the whole picture."""
    if window is None:
        light[:] = part
        return
    left, top, right, bottom = window
    rows, columns, _ = light.shape
    u, v = np.arange(left, right), np.arange(top, bottom)
    feather = min(_FEATHER, (bottom - top) // 4)
    across = np.minimum(u - left if left else feather, right - 1 - u if right < columns else feather)
    down = np.minimum(v - top if top else feather, bottom - 1 - v if bottom < rows else feather)
    share = np.clip(np.minimum(across[None, :], down[:, None]) / feather, 0.0, 1.0)[..., None]
    here = light[top:bottom, left:right]
    here += share * (part - here)


def _vignette(size: tuple[int, int]) -> np.ndarray:
    width, height = size
    v, u = np.meshgrid(np.linspace(-1, 1, height) * height, np.linspace(-1, 1, width) * width, indexing="ij")
    found: np.ndarray = (1.0 - _VIGNETTING * (u**2 + v**2) / (width**2 + height**2))[..., None].astype(np.float32)
    return found


def _exposed(light: np.ndarray, scene: Scene, rng: np.random.Generator) -> np.ndarray:
    """Bytes (sRGB); noise of photons and of reading, normal, as large as `noise` at the paper's light."""
    slope = 255.0 * 1.055 / 2.4 * scene.brightness ** (1 / 2.4 - 1.0)  # of the curve, steps over light
    sigma = scene.noise / slope * np.sqrt(0.7 * np.maximum(light, 0.0) / scene.brightness + 0.3)
    light = np.clip(light + sigma * rng.standard_normal(light.shape, dtype=np.float32), 0.0, 1.0)
    curve = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    return np.ascontiguousarray(np.rint(255.0 * curve).astype(np.uint8))


def setup_text(scene: Scene, robot_file: str) -> str:
    """What an experimenter would have measured with a ruler: nominal values with their uncertainties."""
    eye = 50.0 * round(scene.eye / 50.0) + 10.0
    spacing = papers(scene)[0].spacing
    return f"""# {_SYNTHETIC}; what the experimenter measured with a ruler
[camera]
view = "top"
height = "{eye:g} mm"
height_uncertainty = "1.5 mm"

[tank]
surface = "60 mm"
surface_uncertainty = "1 mm"
index = 1.40
index_uncertainty = 0.005

[markers]
spacing = "{spacing:g} mm"
height = "0.3 mm"
height_uncertainty = "0.3 mm"

[robot]
file = "{robot_file}"
axis_height = "11.5 mm"
axis_height_uncertainty = "0.5 mm"
direction = "{scene.direction}"
"""


def truth_of(scene: Scene, name: str) -> dict[str, Any]:
    """The truth of a video, in the form of `truth.json`: mm/s and Hz, signed about +x of the robot."""
    motion = scene.motion
    return {
        "file": f"{name}.mp4",
        "kind": scene.kind,
        "seed": scene.seed,
        "speed_mm_s": motion.speed,
        "body_Hz": motion.body_rate,
        "tail_Hz": motion.tail_rate,
        "robot": scene.cover != "none",
        "moving": scene.cover != "none" and bool(motion.speed or motion.body_rate or motion.tail_rate),
        "cover": scene.cover,
        "paper": scene.paper,
        "direction": scene.direction,
        "handedness": scene.handedness,
        "roll_deg": scene.roll,
        "heading_deg": motion.heading,
        "lateral_wobble_mm": motion.wobble,
        "heading_wobble_deg": motion.heading_wobble,
        "start_mm": motion.start - 0.5 * motion.speed * scene.duration,
        "body_angle_deg": motion.body_angle,
        "tail_phase_deg": motion.tail_phase,
        "lens_mm": scene.eye - scene.oil,
        "fps": scene.fps,
        "frames": scene.count,
        "axis_height_mm": axis_height(scene, robot_of(scene)),
        "paper_height_mm": scene.paper_height,
        "oil_mm": scene.oil,
        "oil_index": scene.oil_index,
        "lens_height_mm": scene.eye,
        "tilt_deg": list(scene.tilt),
        "scene": asdict(scene),
    }
