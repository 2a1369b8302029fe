"""Scale of lengths: a checkerboard calibrates the lens, a ruler the camera; their uncertainties are propagated."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.display import counted
from spirillum.errors import InputError
from spirillum.robust import mad_scale
from spirillum.vision.camera.optics import DIRECTIONS, Optics, optics_of
from spirillum.vision.camera.ruler import Lines
from spirillum.vision.flag import Flag
from spirillum.vision.setup import Checkerboard, Setup
from spirillum.vision.video import opencv as cv2
from spirillum.vision.video.display import AS_STORED, Display
from spirillum.vision.video.pictures import IMAGES, bits_of, eight_bit, read_header, read_image

_FEWEST = 3  # fewest pictures with a detected board
_POOR_FIT = 2.0  # largest root mean square reprojection error, pixels


class Lens(NamedTuple):
    """A lens with radial distortion: a distance r from the optical axis becomes r (1 + k1 r^2 + k2 r^4)."""

    focal: float  #: Focal length, pixels.
    focal_error: float  #: Standard error of the focal length, pixels.
    centre: tuple[float, float]  #: Principal point, pixels.
    k1: float  #: Radial distortion of second order.
    k2: float  #: Radial distortion of fourth order.
    residual: float  #: Root mean square reprojection error of the corners, pixels.
    pictures: int  #: Number of pictures in which the board was detected.


def pictures_of(board: Checkerboard, folder: Path) -> list[Path]:
    """Return the pictures of a checkerboard, beside a setup file in a folder."""
    images = folder / board.images
    if not images.is_dir():
        raise InputError(f"camera.checkerboard.images: {images} is no folder; allowed: a folder of pictures")
    names = sorted(entry for entry in images.iterdir() if entry.suffix.lower() in IMAGES)
    if len(names) < _FEWEST:
        raise InputError(
            f"camera.checkerboard.images: {images} holds {counted(len(names), 'picture')}; allowed: at least {_FEWEST}"
        )
    return names


def lens_of(board: Checkerboard, folder: Path, size: tuple[int, int], display: Display = AS_STORED) -> Lens:
    """Calibrate a lens by OpenCV's pinhole model with square pixels and radial distortion."""
    images, names = folder / board.images, pictures_of(board, folder)
    pattern, found = (board.columns, board.rows), []
    for name in names:
        stored, header = read_image(name, grey=True), read_header(name)
        if stored is None or header is None:
            raise InputError(f"camera.checkerboard: {name} cannot be read as an image; allowed: png, jpg, tif, bmp")
        stored = eight_bit(stored, bits_of(stored))
        grey = header.display.display_picture(stored)
        if grey.shape[::-1] != size and display.size(header.size) == size:
            grey = display.display_picture(stored)
        if grey.shape[::-1] != size:
            seen_size = f"{grey.shape[1]} x {grey.shape[0]} pixels"
            raise InputError(
                f"camera.checkerboard: {name} has {seen_size}; allowed: {size[0]} x {size[1]}, as the video"
            )
        seen, corners = cv2.findChessboardCornersSB(grey, pattern, flags=cv2.CALIB_CB_ACCURACY)
        if seen:
            found.append(corners.reshape(-1, 2).astype(np.float32))
    if len(found) < _FEWEST:
        raise InputError(
            f"camera.checkerboard: a board of {board.columns} x {board.rows} inner corners was found in {len(found)} "
            f"of {len(names)} pictures of {images}; allowed: at least {_FEWEST}, with the board tilted differently"
        )
    grid = np.zeros((board.columns * board.rows, 3), dtype=np.float32)
    grid[:, :2] = np.mgrid[0 : board.columns, 0 : board.rows].T.reshape(-1, 2) * board.square
    first = np.array([[size[0], 0.0, 0.5 * (size[0] - 1)], [0.0, size[0], 0.5 * (size[1] - 1)], [0.0, 0.0, 1.0]])
    flags = cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K3 | cv2.CALIB_USE_INTRINSIC_GUESS
    try:
        residual, matrix, distortion, _, _, errors, *_ = cv2.calibrateCameraExtended(
            [grid] * len(found), found, size, first, None, flags=flags
        )
    except cv2.error as error:
        raise InputError(f"camera.checkerboard: no camera fits the pictures of {images} ({error.err})") from error
    distortion = np.ravel(distortion)
    focal, focal_error = float(matrix[0, 0]), float(np.ravel(errors)[:2].max())  # one of the two is fixed
    if not (np.isfinite(focal) and focal_error < 0.1 * focal and residual < _POOR_FIT):
        raise InputError(
            f"camera.checkerboard: the fit leaves {residual:.2g} pixels and a focal length of {focal:.4g} +- "
            f"{focal_error:.2g} pixels; allowed: under {_POOR_FIT:g} pixels and 10 %, of boards tilted differently"
        )
    centre = float(matrix[0, 2]), float(matrix[1, 2])
    return Lens(focal, focal_error, centre, float(distortion[0]), float(distortion[1]), float(residual), len(found))


_PRIOR_TILT = 0.1  # prior standard deviation of the camera's tilts, rad
_PRIOR_K1 = 0.1  # prior standard deviation of the lens's k1, without a checkerboard
_LINE_ERROR = 0.1  # standard error of a line's position, pixels
_CORRELATED = 12.0  # points of a ruler with correlated errors, as they share a window
_HUBER = 3.0 / math.sqrt(_CORRELATED)  # residual from which on Huber's loss is linear, standard errors
_FOCAL = (0.2, 250.0)  # plausible focal lengths over the picture's width
_MODEL = 3e-4
"""Relative standard uncertainty of lengths by the models of lens and body, with an exact setup.

Assumed; on rendered videos with an exact setup, errors of the speed are below 0.02 %."""
_SMALL_ROLL = 0.1  # roll from which on the fit does not begin with an upright camera, rad
_STEP = 1e-3  # relative step of numerical derivatives


@dataclass(frozen=True)
class Scale:
    """Scale of lengths at the height of the robot's axis, with its uncertainty."""

    length_per_pixel: float  #: Length per pixel at the height of the robot's axis, in the centre of the picture, m.
    relative_uncertainty: float
    """Relative standard uncertainty of all lengths, by heights, index, spacing and the fit of the lines."""
    sources: dict[str, float]  #: Contributions to it by source, such as `robot.axis_height`; they add in quadrature.
    markers: int  #: Number of detected lines of the ruler; 0 where the scale was given.
    residual: float  #: Root mean square residual of the lines, pixels; NaN without a ruler.
    apparent_size: float = math.nan  #: Apparent size of the body over its file's at this scale; NaN where not measured.


class CalibratedCamera(NamedTuple):
    """A calibrated camera with its scale and warnings."""

    optics: Optics
    scale: Scale
    flags: tuple[Flag, ...] = ()
    reduction: int = 1  #: Factor by which pictures may be reduced to be looked at as a whole: the ruler is resolved.


def camera_of_setup(setup: Setup, size: tuple[int, int], lens: Lens | None = None) -> CalibratedCamera:
    """The upright camera of a setup that gives a length per pixel."""
    wanted = setup.markers.length_per_pixel
    assert wanted is not None  # noqa: S101 - the setup ensures it
    optics = _with_lens(optics_of(setup, size, 1.0), lens)
    optics = optics.moved({"focal": optics.length_per_pixel / wanted})
    share = setup.markers.length_per_pixel_uncertainty / wanted
    sources = {"lens and outline": _MODEL} | ({"markers.length_per_pixel": share} if share else {})
    return CalibratedCamera(optics, Scale(optics.length_per_pixel, _total(sources), sources, 0, float("nan")))


def fitted_camera(setup: Setup, size: tuple[int, int], lines: Lines, lens: Lens | None = None) -> CalibratedCamera:
    """Fit focal length, tilts, rotation and distortion of the camera to the ruler's lines."""
    # The uncertainty of lengths at the height of the axis has a contribution of the fit, and one of each uncertain
    # number of the setup, by the implicit derivative of the fit.
    spacing, height = setup.markers.spacing, setup.markers.height
    assert spacing is not None  # noqa: S101 - the setup ensures it
    assert height is not None  # noqa: S101
    start = _with_lens(optics_of(setup, size, float(size[0])), lens)
    start = start.moved({"focal": _first_focal(start, lines, spacing, height)})
    start = start.moved({"rotation": first_rotation(start, lines)})
    fit = _Fit(lines, distorted=lens is None and float(np.ptp(lines.pixels[:, 0])) > 0.6 * size[0])
    optics, residual, own = fit.run(start, spacing, height)
    ratio = optics.focal / size[0]
    if not _FOCAL[0] <= ratio <= _FOCAL[1]:
        raise InputError(
            f"markers.spacing = {spacing * 1e3:g} mm at the given heights makes the focal length {ratio:.3g} widths of "
            f"the picture; allowed: {_FOCAL[0]:g} to {_FOCAL[1]:g} (is the spacing that of neighbouring lines?)"
        )
    sources = {"lens and outline": _MODEL, "fit of the lines": own}
    for name, spread in _uncertain(setup).items():
        longer, shorter = (_changed(_Geometry(optics, spacing, height), name, step) for step in (_STEP, -_STEP))
        sources[name] = abs(fit.response(longer, shorter)) / (2.0 * _STEP) * spread
    flags = []
    if lens is not None and abs(lens.focal / optics.focal - 1.0) > 0.02 + 3.0 * lens.focal_error / lens.focal:
        flags.append(Flag.named("focal-lengths-differ", board=lens.focal, ruler=optics.focal))
    return CalibratedCamera(
        optics, Scale(optics.length_per_pixel, _total(sources), sources, lines.lines, residual), tuple(flags)
    )


def with_source(scale: Scale, name: str, share: float) -> Scale:
    """The scale with one more contribution to its uncertainty."""
    sources = {**scale.sources, name: share}
    return replace(scale, sources=sources, relative_uncertainty=_total(sources))


def _total(sources: dict[str, float]) -> float:
    """Independent relative uncertainties, added in quadrature."""
    return float(np.sqrt(sum(part**2 for part in sources.values())))


def _with_lens(optics: Optics, lens: Lens | None) -> Optics:
    if lens is None:
        return optics
    return Optics(**{**_fields(optics), "centre": lens.centre, "k1": lens.k1, "k2": lens.k2})


def _fields(optics: Optics) -> dict:  # type: ignore[type-arg]
    return {name: getattr(optics, name) for name in optics.__dataclass_fields__}


def _first_focal(optics: Optics, lines: Lines, spacing: float, height: float) -> float:
    """Initial focal length: that of an upright camera with the measured distance of lines in the centre."""
    points = np.array([[-0.5 * spacing, 0.0, height], [0.5 * spacing, 0.0, height]])
    seen = optics.pixels(points)
    return optics.focal * lines.distance / float(np.hypot(*(seen[1] - seen[0])))


def first_rotation(optics: Optics, lines: Lines) -> float:
    """Rotation of the camera, by the angle of the channel against the stated direction, rad; 0 where it is small."""
    off = -DIRECTIONS[optics.direction] - lines.roll  # both clockwise, as rows count downwards
    off -= np.pi * round(off / np.pi)  # lines are counted in either sense
    return 0.0 if abs(off) < _SMALL_ROLL else float(off)


class _Geometry(NamedTuple):
    """A camera before a ruler."""

    optics: Optics  # the camera
    spacing: float  # spacing of the ruler's lines, m
    height: float  # height of the ruler, m

    @property
    def distance(self) -> float:
        """Distance of the ruler's lines below the lens, pixels."""
        return self.spacing / self.optics.moved({"axis_height": self.height}).length_per_pixel


class _Fit:
    """Robust least squares fit of the camera's parameters, with a free offset of each strip."""

    def __init__(self, lines: Lines, *, distorted: bool) -> None:
        self.lines = lines
        self.names = (
            ("focal", "tilt_x", "tilt_y", "rotation", "k1") if distorted else ("focal", "tilt_x", "tilt_y", "rotation")
        )
        _, self.strip = np.unique(lines.strip, return_inverse=True)
        self.strips = int(self.strip.max()) + 1
        self.sense = 1.0  #: 1 where the lines are counted towards the nose, -1 where they are counted away from it.
        self.scale = _LINE_ERROR * np.sqrt(_CORRELATED)
        self._steps: Samples = np.empty((0, 0))
        """Pseudoinverse of the Jacobian at the fit: change of the parameters by that of the residuals."""
        self._slopes: Samples = np.empty(0)
        """Relative change of the length per pixel by that of the parameters at the fit."""

    def _optics(self, numbers: Samples, start: Optics) -> Optics:
        changes = dict(zip(self.names, numbers.tolist(), strict=True))
        changes["focal"] = start.focal * float(np.exp(changes["focal"]))
        return start.moved(
            {name: value if name == "focal" else getattr(start, name) + value for name, value in changes.items()}
        )

    def _residuals(self, numbers: Samples, start: Optics, spacing: float, height: float) -> Samples:
        """Residual of each point of the ruler, pixels, (n,)."""
        x = self._optics(numbers, start).points(self.lines.pixels, height)[:, 0] / spacing
        x = np.nan_to_num(self.sense * x, nan=1e3)
        gap = x - self.lines.number
        offsets = np.bincount(self.strip, weights=gap, minlength=self.strips) / np.bincount(self.strip)
        return np.asarray((gap - offsets[self.strip]) * self.lines.distance)

    def run(self, start: Optics, spacing: float, height: float) -> tuple[Optics, float, float]:
        """The fitted camera, the root mean square residual, pixels, and the relative standard error of its scale."""
        from scipy.optimize import least_squares

        x = start.points(self.lines.pixels, height)[:, 0]
        self.sense = float(np.sign(np.nansum((x - np.nanmean(x)) * (self.lines.number - self.lines.number.mean()))))
        found = least_squares(
            lambda numbers: self._cost(numbers, start, spacing, height),
            np.zeros(len(self.names)),
            x_scale=np.array([0.1, 0.02, 0.02, 0.02, 0.02][: len(self.names)]),
        )
        optics = self._optics(found.x, start)
        residuals = self._residuals(found.x, start, spacing, height)
        typical = float(mad_scale(residuals))
        kept = np.abs(residuals) <= max(4.0 * typical, 1e-9)
        residual = float(np.sqrt(np.mean(residuals[kept] ** 2)))
        covariance = np.linalg.pinv(found.jac.T @ found.jac) * (residual / _LINE_ERROR) ** 2
        slopes = np.zeros(len(self.names))
        for k in range(len(self.names)):
            step = np.zeros(len(self.names))
            step[k] = 1e-4
            more, less = (self._optics(found.x + sign * step, start).length_per_pixel for sign in (1.0, -1.0))
            slopes[k] = np.log(more / less) / 2e-4
        self._steps, self._slopes = np.linalg.pinv(found.jac), slopes
        return optics, residual, float(np.sqrt(max(float(slopes @ covariance @ slopes), 0.0)))

    def response(self, longer: _Geometry, shorter: _Geometry) -> float:
        """Relative difference of the length per pixel between fits with two geometries, both close to the fitted one.

        To first order, by the implicit function theorem: the residuals' change at fixed parameters, and the change of
        the parameters that undoes it best.
        """
        still = np.zeros(len(self.names))
        apart = self._cost(still, *longer) - self._cost(still, *shorter)
        direct = np.log(longer.optics.length_per_pixel / shorter.optics.length_per_pixel)
        return float(direct - self._slopes @ (self._steps @ apart))

    def _cost(self, numbers: Samples, start: Optics, spacing: float, height: float) -> Samples:
        """Residuals in standard errors with Huber's loss, and those of the prior."""
        width = np.array([_PRIOR_TILT, _PRIOR_TILT, 10.0, _PRIOR_K1])[: len(self.names) - 1]
        prior = np.array([start.tilt_x, start.tilt_y, 0.0, start.k1])[: len(self.names) - 1]
        residuals = self._residuals(numbers, start, spacing, height) / self.scale
        small = np.clip(residuals, -_HUBER, _HUBER)
        beyond = residuals - small  # Huber's loss, linear for outliers
        weighted = small + np.sign(beyond) * (np.sqrt(small**2 + 2 * np.abs(small) * np.abs(beyond)) - np.abs(small))
        return np.concatenate([weighted, (numbers[1:] + prior) / width])


def _uncertain(setup: Setup) -> dict[str, float]:
    """Relative standard uncertainty of each number of the setup; heights relative to that of the camera."""
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


def _changed(before: _Geometry, name: str, step: float) -> _Geometry:
    """A fitted camera before its ruler, with one number of the setup changed by a relative step."""
    # Its focal length is such that the ruler's lines are as far apart as they were: the fit hardly changes.
    optics, far = before.optics, step * before.optics.height
    if name == "markers.spacing":
        after = before._replace(spacing=before.spacing * (1.0 + step))
    elif name == "markers.height":
        after = before._replace(height=before.height + far)
    elif name == "tank.index":
        after = before._replace(optics=optics.moved({"index": optics.index * (1.0 + step)}))
    else:
        field = {"camera.height": "height", "robot.axis_height": "axis_height", "tank.surface": "surface"}[name]
        after = before._replace(optics=optics.moved({field: getattr(optics, field) + far}))
    focal = optics.focal * before.distance / after.distance
    return after._replace(optics=after.optics.moved({"focal": focal}))
