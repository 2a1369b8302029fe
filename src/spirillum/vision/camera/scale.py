"""How large lengths are in the picture: the camera is fitted to the ruler, and its uncertainty is propagated."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.robust import mad_scale
from spirillum.vision.camera.checkerboard import Lens
from spirillum.vision.camera.optics import Optics, optics_of
from spirillum.vision.camera.ruler import Lines
from spirillum.vision.flag import Flag
from spirillum.vision.setup import Setup

__all__ = ["Scale", "Sight", "fitted_camera", "given_camera", "with_source"]

_EXPECTED_TILT = 0.1
"""Prior standard deviation of the camera's tilts, rad."""
_EXPECTED_BEND = 0.1
"""Prior standard deviation of the lens's k1, where no checkerboard tells."""
_LINE_ERROR = 0.1
"""Distance of lines from the fit beyond which they count less, pixels."""
_TOGETHER = 12.0
"""Places of a ruler that share one window, and so one error."""
_FOCAL = (0.2, 20.0)
"""Plausible focal lengths over the picture's width."""
_MODEL = 3e-4
"""Standard uncertainty of lengths when all numbers are exact, relative: an ideal lens, a body exactly as its file says.

Assumed; on rendered films with exact numbers speeds came out within 0.02 % of the truth."""
_STEP = 1e-3


@dataclass(frozen=True)
class Scale:
    """How large a length at the height of the robot's axis is in the picture."""

    length_per_pixel: float
    """m per pixel at the height of the robot's axis, in the middle of the picture."""
    relative_uncertainty: float
    """Standard uncertainty of all lengths, relative: heights, index, spacing and how well the lines were found."""
    sources: dict[str, float]
    """Its parts by name, such as `robot.axis_height`, relative; they add up in squares."""
    markers: int
    """Number of lines of the ruler that were found; 0 where the scale was given."""
    residual: float
    """Root mean square distance of the lines from where the fit has them, pixels; NaN without a ruler."""
    apparent_size: float = math.nan
    """Size of the body in the picture over that of its file at this scale; NaN where it was not looked at."""


class Sight(NamedTuple):
    """A camera, and what it says of lengths."""

    optics: Optics
    scale: Scale
    flags: tuple[Flag, ...] = ()


def given_camera(setup: Setup, size: tuple[int, int], lens: Lens | None = None) -> Sight:
    """The upright camera of a setup that gives a length per pixel.

    Args:
        setup: the setup.
        size: width and height of the picture, pixels.
        lens: what pictures of a checkerboard have told.
    """
    wanted = setup.markers.length_per_pixel
    assert wanted is not None  # noqa: S101 - the setup has seen to it
    optics = _with_lens(optics_of(setup, size, 1.0), lens)
    optics = optics.moved({"focal": optics.length_per_pixel / wanted})
    share = setup.markers.length_per_pixel_uncertainty / wanted
    sources = {"lens and outline": _MODEL} | ({"markers.length_per_pixel": share} if share else {})
    return Sight(optics, Scale(optics.length_per_pixel, _total(sources), sources, 0, float("nan")))


def fitted_camera(setup: Setup, size: tuple[int, int], lines: Lines, lens: Lens | None = None) -> Sight:
    """The camera that sees the ruler's lines where they were found: focal length, tilts, rotation.

    The uncertainty of lengths at the height of the axis has a part for each uncertain number of the setup, found by
    fitting again with that number changed, and one for the fit itself.

    Args:
        setup: the setup.
        size: width and height of the picture, pixels.
        lines: what was found of the ruler.
        lens: what pictures of a checkerboard have told.

    Raises:
        InputError: if no plausible camera sees the ruler so.
    """
    spacing, height = setup.markers.spacing, setup.markers.height
    assert spacing is not None  # noqa: S101 - the setup has seen to it
    assert height is not None  # noqa: S101
    start = _with_lens(optics_of(setup, size, float(size[0])), lens)
    start = start.moved({"focal": _first_focal(start, lines, spacing, height)})
    fit = _Fit(lines, bend=lens is None and float(np.ptp(lines.pixels[:, 0])) > 0.6 * size[0])
    optics, residual, own = fit.run(start, spacing, height)
    ratio = optics.focal / size[0]
    if not _FOCAL[0] <= ratio <= _FOCAL[1]:
        raise InputError(
            f"markers.spacing = {spacing * 1e3:g} mm at the given heights makes the focal length {ratio:.3g} widths of "
            f"the picture; allowed: {_FOCAL[0]:g} to {_FOCAL[1]:g} (is the spacing that of neighbouring lines?)"
        )
    sources = {"lens and outline": _MODEL, "fit of the lines": own}
    for name, spread in _uncertain(setup).items():
        longer = _changed(fit, optics, setup, name, _STEP)
        shorter = _changed(fit, optics, setup, name, -_STEP)
        sources[name] = abs(np.log(longer / shorter)) / (2.0 * _STEP) * spread
    flags = []
    if lens is not None and abs(lens.focal / optics.focal - 1.0) > 0.02 + 3.0 * lens.focal_error / lens.focal:
        flags.append(
            Flag(
                "focal-lengths-differ",
                f"the checkerboard gives a focal length of {lens.focal:.1f} pixels, the ruler one of "
                f"{optics.focal:.1f}: heights, spacing or index are not as the setup says, or the lens was refocused",
            )
        )
    return Sight(optics, Scale(optics.length_per_pixel, _total(sources), sources, lines.lines, residual), tuple(flags))


def with_source(scale: Scale, name: str, share: float) -> Scale:
    """A scale that is less certain for one more reason.

    Args:
        scale: the scale.
        name: of the reason.
        share: its part of the uncertainty, relative.
    """
    sources = {**scale.sources, name: share}
    return replace(scale, sources=sources, relative_uncertainty=_total(sources))


def _total(sources: dict[str, float]) -> float:
    """Relative uncertainty of independent parts together."""
    return float(np.sqrt(sum(part**2 for part in sources.values())))


def _with_lens(optics: Optics, lens: Lens | None) -> Optics:
    if lens is None:
        return optics
    return Optics(**{**_fields(optics), "centre": lens.centre, "k1": lens.k1, "k2": lens.k2})


def _fields(optics: Optics) -> dict:  # type: ignore[type-arg]
    return {name: getattr(optics, name) for name in optics.__dataclass_fields__}


def _first_focal(optics: Optics, lines: Lines, spacing: float, height: float) -> float:
    """Focal length of an upright camera that shows the lines at their distance, in the middle of the picture."""
    points = np.array([[-0.5 * spacing, 0.0, height], [0.5 * spacing, 0.0, height]])
    seen = optics.pixels(points)
    return optics.focal * lines.distance / float(np.hypot(*(seen[1] - seen[0])))


class _Fit:
    """Least squares of the camera's numbers and of one offset for each strip."""

    def __init__(self, lines: Lines, *, bend: bool) -> None:
        self.lines = lines
        self.names = (
            ("focal", "tilt_x", "tilt_y", "rotation", "k1") if bend else ("focal", "tilt_x", "tilt_y", "rotation")
        )
        _, self.strip = np.unique(lines.strip, return_inverse=True)
        self.strips = int(self.strip.max()) + 1
        self.scale = _LINE_ERROR * np.sqrt(_TOGETHER)

    def _optics(self, numbers: Samples, start: Optics) -> Optics:
        changes = dict(zip(self.names, numbers.tolist(), strict=True))
        changes["focal"] = start.focal * float(np.exp(changes["focal"]))
        return start.moved(
            {name: value if name == "focal" else getattr(start, name) + value for name, value in changes.items()}
        )

    def _misses(self, numbers: Samples, start: Optics, spacing: float, height: float) -> Samples:
        """How far each place is from where the camera would have it, pixels."""
        x = self._optics(numbers, start).points(self.lines.pixels, height)[:, 0] / spacing
        x = np.nan_to_num(-x if start.leftward else x, nan=1e3)
        gap = x - self.lines.number
        offsets = np.bincount(self.strip, weights=gap, minlength=self.strips) / np.bincount(self.strip)
        return np.asarray((gap - offsets[self.strip]) * self.lines.distance)

    def run(self, start: Optics, spacing: float, height: float) -> tuple[Optics, float, float]:
        """The camera, the lines' root mean square distance, pixels, and the relative error of its scale."""
        from scipy.optimize import least_squares

        expected = np.array([_EXPECTED_TILT, _EXPECTED_TILT, 10.0, _EXPECTED_BEND])[: len(self.names) - 1]
        held = np.array([start.tilt_x, start.tilt_y, 0.0, start.k1])[: len(self.names) - 1]

        def cost(numbers: Samples) -> Samples:
            misses = self._misses(numbers, start, spacing, height) / self.scale
            small = np.clip(misses, -3.0 / np.sqrt(_TOGETHER), 3.0 / np.sqrt(_TOGETHER))
            beyond = misses - small  # Huber's: what lies far counts linearly
            weighed = small + np.sign(beyond) * (np.sqrt(small**2 + 2 * np.abs(small) * np.abs(beyond)) - np.abs(small))
            return np.concatenate([weighed, (numbers[1:] + held) / expected])

        found = least_squares(
            cost, np.zeros(len(self.names)), x_scale=np.array([0.1, 0.02, 0.02, 0.02, 0.02][: len(self.names)])
        )
        optics = self._optics(found.x, start)
        misses = self._misses(found.x, start, spacing, height)
        typical = float(mad_scale(misses))
        kept = np.abs(misses) <= max(4.0 * typical, 1e-9)
        residual = float(np.sqrt(np.mean(misses[kept] ** 2)))
        scatter = np.linalg.pinv(found.jac.T @ found.jac) * (residual / _LINE_ERROR) ** 2
        slopes = np.zeros(len(self.names))
        for k in range(len(self.names)):
            step = np.zeros(len(self.names))
            step[k] = 1e-4
            more, less = (self._optics(found.x + sign * step, start).length_per_pixel for sign in (1.0, -1.0))
            slopes[k] = np.log(more / less) / 2e-4
        return optics, residual, float(np.sqrt(max(float(slopes @ scatter @ slopes), 0.0)))


def _uncertain(setup: Setup) -> dict[str, float]:
    """Relative standard uncertainty of each number behind the scale; heights relative to the camera's."""
    markers, tank, camera = setup.markers, setup.tank, setup.camera
    found = {"camera.height": camera.height_uncertainty / camera.height}
    if markers.spacing is not None:
        found["markers.spacing"] = markers.spacing_uncertainty / markers.spacing
        found["markers.height"] = markers.height_uncertainty / camera.height
    if tank.surface is not None:
        found["tank.surface"] = tank.surface_uncertainty / camera.height
        found["tank.index"] = tank.index_uncertainty / tank.index
    found["robot.axis_height"] = setup.robot.axis_height_uncertainty / camera.height
    return {name: share for name, share in found.items() if share > 0.0}


def _changed(fit: _Fit, optics: Optics, setup: Setup, name: str, step: float) -> float:
    """Length per pixel with one number of the setup changed by a small step of its own scale."""
    spacing, height = setup.markers.spacing, setup.markers.height
    assert spacing is not None  # noqa: S101
    assert height is not None  # noqa: S101
    far, changes = step * setup.camera.height, {}
    if name == "markers.spacing":
        spacing *= 1.0 + step
    elif name == "markers.height":
        height += far
    elif name == "camera.height":
        changes["height"] = optics.height + far
    elif name == "robot.axis_height":
        return optics.moved({"axis_height": optics.axis_height + far}).length_per_pixel
    elif name == "tank.index":
        changes["index"] = optics.index * (1.0 + step)
    elif optics.surface is not None:
        changes["surface"] = optics.surface + far
    return fit.run(optics.moved(changes), spacing, height)[0].length_per_pixel
