"""Text on a picture: title, axes, scale bar."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from spirillum.arrays import Samples
from spirillum.view.figures.scene import FAINT, INK, arrow, label, round_length
from spirillum.view.figures.style import UnitPrefix, in_words, plain, styled
from spirillum.view.scene3d.scenery import SceneCamera

_DPI = 200
_REFERENCE = 900.0  # height of a picture in pixels at which text has its nominal size


@dataclass(frozen=True)
class Bar:
    """Scale bar in the scene, projected."""

    length: float  #: Length, m.
    start: tuple[float, float]  #: Pixel of its left end.
    end: tuple[float, float]  #: Pixel of its right end.


def scale_bar(camera: SceneCamera, size: tuple[int, int], middle: Samples) -> Bar:
    """Scale bar at the lower right: in the upright plane along the robot's axis, or across it in a view along it."""
    along = np.eye(3)[int(np.argmax(np.abs(camera.right)))]
    along = along * np.sign(along @ camera.right)
    normal = camera.sight if camera.parallel else np.cross(along, np.array([0.0, 0.0, 1.0]))
    end = camera.on_plane((0.96 * size[0], size[1] - 0.06 * size[1]), size, middle, normal)
    short = 1e-3 * camera.half_height
    unit = float(np.linalg.norm(np.diff(camera.pixels(np.stack([end - short * along, end]), size), axis=0)))
    length = round_length(0.16 * size[0] / unit * short)
    (start_x, start_y), (end_x, end_y) = camera.pixels(np.stack([end - length * along, end]), size)
    return Bar(length, (float(start_x), float(start_y)), (float(end_x), float(end_y)))


def words_on(size: tuple[int, int], camera: SceneCamera, bar: Bar, title: str, lines: Sequence[str]) -> np.ndarray:
    """(height, width, 4) the text alone, straight alpha."""
    with styled():
        figure, axes, unit = _canvas(size)
        left, top = 0.022 * size[0], 0.035 * size[1]
        axes.text(left, top, plain(title, 60), va="top", size=11 * unit, weight="bold", color=INK)
        axes.text(
            left, top + 0.052 * size[1], "\n".join(lines), va="top", size=7.5 * unit, color=FAINT, linespacing=1.4
        )
        _draw_bar(axes, bar, unit, size)
        _draw_axes(axes, camera, unit, size)
        canvas: Any = figure.canvas
        canvas.draw()
        return np.array(canvas.buffer_rgba())


def blended_into(words: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """A function that blends text into pictures of one size; only the rows and columns with text change."""
    opaque = words[..., 3] > 0
    patches = []
    for rows in _runs(opaque.any(axis=1)):
        columns = np.flatnonzero(opaque[rows].any(axis=0))
        box = (rows, slice(int(columns[0]), int(columns[-1]) + 1))
        alpha = words[box][..., 3:].astype(np.uint16)
        patches.append((box, 255 - alpha, words[box][..., :3] * alpha + 127))

    def write(image: np.ndarray) -> np.ndarray:
        for box, clear, colour in patches:
            image[box] = (image[box] * clear + colour) // 255
        return image

    return write


def _runs(truth: Any) -> list[slice]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], truth, [False]]).astype(np.int8)))
    return [slice(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]


class Stamp:
    """Time stamp in the upper right corner of a video's frames, and the ratio of its speed to the run's."""

    def __init__(self, size: tuple[int, int], times: Samples, speed: float) -> None:
        from matplotlib import font_manager
        from PIL import ImageFont

        span = float(times[-1] - times[0])
        power = int(np.clip(np.floor(np.log10(max(span, 1e-300))), -9, 3))
        self._scale = UnitPrefix.of(np.array([10.0**power]), "s") if span < 1.0 else UnitPrefix(1.0, "s")
        smallest = float(np.diff(times).min()) / self._scale.factor
        self._digits = int(np.clip(np.ceil(-np.log10(smallest)), 0, 3))
        self._width = len(f"{times[-1] / self._scale.factor:.{self._digits}f}")
        self._speed = "" if speed == 1.0 else f"   ×{speed:g}"
        height = max(int(0.030 * min(size[1], 0.5625 * size[0])), 9)
        self._font = ImageFont.truetype(font_manager.findfont("DejaVu Sans Mono"), height)
        self._right, self._top, self._height = int(0.978 * size[0]), int(0.035 * size[1]), int(1.5 * height)

    def text(self, time: float) -> str:
        """The label at a time of the run, s."""
        return f"t = {time / self._scale.factor:{self._width}.{self._digits}f} {self._scale.unit}{self._speed}"

    def write(self, image: np.ndarray, time: float) -> None:
        """Write into a frame."""
        from PIL import Image, ImageDraw

        text = self.text(time)
        width = min(int(self._font.getlength(text)) + 2, self._right)
        box = np.s_[self._top : self._top + self._height, self._right - width : self._right]
        patch = Image.fromarray(image[box])
        ImageDraw.Draw(patch).text((0, 0), text, font=self._font, fill=INK)
        image[box] = np.asarray(patch)


def _canvas(size: tuple[int, int]) -> tuple[Figure, Axes, float]:
    """An empty figure, axes in its pixels, and the size of text."""
    figure = Figure(figsize=(size[0] / _DPI, size[1] / _DPI), dpi=_DPI, facecolor="none")
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), facecolor="none")
    axes.set_xlim(0.0, size[0])
    axes.set_ylim(size[1], 0.0)
    axes.set_axis_off()
    return figure, axes, min(size[1] / _REFERENCE, size[0] / _REFERENCE)


def _draw_bar(axes: Axes, bar: Bar, unit: float, size: tuple[int, int]) -> None:
    (x, y), (u, v) = bar.start, bar.end
    axes.plot([x, u], [y, v], color=INK, linewidth=2.2 * unit, solid_capstyle="butt")
    tick = 0.009 * size[1]
    for a, b in (bar.start, bar.end):
        axes.plot([a, a], [b - tick, b + tick], color=INK, linewidth=1.0 * unit)
    above = 0.5 * (y + v) - 0.018 * size[1]
    label(axes, 0.5 * (x + u), above, in_words(bar.length, "m"), va="bottom", size=8.5 * unit)


def _draw_axes(axes: Axes, camera: SceneCamera, unit: float, size: tuple[int, int]) -> None:
    """Directions of the lab's axes; one that points along the line of sight is left out."""
    reach = 0.075 * size[1]
    shown = {
        name: np.array([axis @ camera.right, -axis @ camera.up]) * reach
        for name, axis in zip("xyz", np.eye(3), strict=True)
    }
    leftmost = min(0.0, *(float(way[0]) for way in shown.values()))
    lowest = max(0.0, *(float(way[1]) for way in shown.values()))
    origin = np.array([0.035 * size[0] - leftmost, size[1] - 0.055 * size[1] - lowest])
    for name, way in shown.items():
        if np.hypot(*way) < 0.15 * reach:
            continue
        arrow(axes, origin, origin + way, mutation_scale=6.5 * unit, linewidth=1.0 * unit)
        position = origin + way * (1.0 + 0.24 * reach / np.hypot(*way))
        label(axes, float(position[0]), float(position[1]), f"${name}$", size=8.5 * unit)
