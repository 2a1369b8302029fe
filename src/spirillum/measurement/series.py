"""Measured trials as files: labelled time series, poses of the `movement` project, and rows of `observations.csv`."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from spirillum.files import MARK, text_cell
from spirillum.formats.array_files import Labelled, Variable
from spirillum.measurement.observations import RATES
from spirillum.measurement.trials import LEVEL, RATE_NAMES, Measured, Trial
from spirillum.robot.robot import Robot
from spirillum.version import versions
from spirillum.vision.setup import stripes_of
from spirillum.vision.track.colours import pattern_period

_RESIDUAL_UNITS = ("m", "rad", "rad", "rad")


def series_of(trial: Trial, robot: Robot) -> Labelled:
    """Pose, angles, standard errors and residuals on every frame; SI units, rates in rad/s."""
    track = trial.track
    stripes = stripes_of(track.setup, robot)
    frame = np.round(track.frame).astype(np.int64) if np.isfinite(track.frame).all() else track.frame
    series = {
        "frame": (frame, "1", "number of the frame in the video"),
        "heading": (track.heading, "rad", "angle of the motor axis to the x axis in the plane of the picture"),
        "body_angle": (
            track.body_angle,
            "rad",
            "angle by which the body has turned about +x, unwrapped; 0: stripe 1 faces +z",
        ),
        "tail_phase": (track.tail_phase, "rad", "phase phi of the tail about +x in the lab, unwrapped"),
        "position_error": (track.position_error, "m", "estimated standard error of x"),
        "body_angle_error": (track.body_angle_error, "rad", "estimated standard error of the body's angle"),
        "tail_phase_error": (track.tail_phase_error, "rad", "estimated standard error of the tail's phase"),
    }
    for name, unit in zip(RATE_NAMES, _RESIDUAL_UNITS, strict=True):
        residual = trial.fits[name].residual
        if residual.size == track.time.size:
            words = f"distance from the line that gives the {name.replace('_', ' ')}; NaN where left out"
            series[f"{name}_residual"] = (residual, unit, words)
    data: dict[str, Variable] = {
        "position": (
            ("time", "space"), track.position,
            {
                "units": "m", "long_name": "the body's mid-length from the middle of the picture, at the axis's height",
                "comment": "in the annotated film x counts from the first frame",
            },
        ),
        "pixel": (
            ("time", "space"), track.picture[:, :2],
            {"units": "pixel", "long_name": "the body's mid-length in the picture, u to the right and v down"},
        ),
    }  # fmt: skip
    data |= {
        name: (("time",), values, {"units": unit, "long_name": words}) for name, (values, unit, words) in series.items()
    }
    for name, period in (("body_angle", pattern_period(stripes) if stripes else 2 * np.pi), ("tail_phase", 2 * np.pi)):
        dimensions, values, attributes = data[name]
        comment = "all of it may be off by whole multiples of known_modulo (rad), after which everything looks alike"
        data[name] = dimensions, values, {**attributes, "known_modulo": period, "comment": comment}
    for name, item in trial.quantities.items():
        more = {"low": item.low, "high": item.high, "level": LEVEL} if np.isfinite(item.low) else {}
        reason = {"reason": item.reason} if item.reason else {}
        data[name if name != "heading" else "mean_heading"] = ((), item.value, {"units": item.unit, **more, **reason})
    return Labelled(
        data,
        {
            "time": (("time",), track.time, {"units": "s", "long_name": "time in the video"}),
            "space": (("space",), ["x", "y"], {"long_name": "along the channel towards the nose, and across"}),
        },
        {
            "title": f"{trial.video}{' (synthetic)' if trial.synthetic else ''}: what was seen on every frame",
            "synthetic": int(trial.synthetic),
            "robot": robot.name,
            "video": trial.video,
            "length_per_pixel": track.scale.length_per_pixel,
            "length_per_pixel_units": "m",
            "scale_relative_uncertainty": track.scale.relative_uncertainty,
            "apparent_body_size": track.scale.apparent_size,
            "scale_sources": json.dumps(dict(track.scale.sources)),
            "flags": "\n".join(f"{flag.name}: {flag.sentence}" for flag in trial.flags),
            "setup": json.dumps(track.setup.model_dump(), sort_keys=True),
            "settings": json.dumps(robot.model_dump(), sort_keys=True),
            "versions": versions(),
        },
    )


def movement_of(trial: Trial, robot: Robot) -> Labelled:
    """The track as a poses data set of the `movement` project: one individual with two keypoints, in pixels."""
    # Dimensions are time, space, keypoints and individuals; variables `position` and `confidence`; x is u, y is v.
    track = trial.track
    points = track.picture.reshape(-1, 2, 2)  # frame, point, coordinate
    position = np.swapaxes(points, 1, 2)[..., None]
    confidence = np.where(np.isfinite(points).all(axis=2), 1.0, np.nan)[..., None]
    attributes: dict[str, Any] = {"source_software": "spirillum", "ds_type": "poses", "time_unit": "seconds"}
    if track.time.size > 1:
        attributes["fps"] = round(float(1.0 / np.median(np.diff(track.time))), 6)
    attributes |= {
        "source_file": trial.video,
        "synthetic": int(trial.synthetic),
        "length_per_pixel": track.scale.length_per_pixel,
        "length_per_pixel_units": "m",
    }
    return Labelled(
        {
            "position": (("time", "space", "keypoints", "individuals"), position, {"units": "pixel"}),
            "confidence": (("time", "keypoints", "individuals"), confidence, {}),
        },
        {
            "time": (("time",), track.time, {"units": "s"}),
            "space": (("space",), ["x", "y"], {}),
            "keypoints": (("keypoints",), ["centre", "nose"], {}),
            "individuals": (("individuals",), [robot.name], {}),
        },
        attributes,
    )


_KEYS = ("robot", "channel_diameter_mm", "wavelength_mm", "amplitude_mm", "trial")
_SEEN = {
    "forward_velocity": "forward_velocity_mm_s",
    "tail_rotation_rate": "tail_rate_Hz",
    "body_rotation_rate": "body_rate_Hz",
}
"""Observed series. The motor's rate follows from two of them; a column of its own would count them twice."""


def observation_rows(trials: Sequence[Trial], robot: Robot, setup: str) -> str | None:
    """Text of an observations file, a row a trial; None without a channel, or if nothing was measured."""
    if robot.channel is None:
        return None
    kept = [trial for trial in trials if any(math.isfinite(trial.quantities[name].value) for name in _SEEN)]
    if not kept:
        return None
    text = io.StringIO()
    if any(trial.synthetic for trial in kept):
        text.write("# SYNTHETIC: the videos say that they are computed; nothing was measured.\n")
    text.write(
        f"# Measured from video with {_safe(setup)}, {MARK}: one row a trial, signed about the swimming direction.\n"
    )
    for trial in kept:
        flags = ", ".join(dict.fromkeys(flag.name for flag in trial.flags))
        text.write(f"# trial {_safe(trial.name)}: {_safe(trial.video)}{'; flags: ' + flags if flags else ''}\n")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow((*_KEYS, *_SEEN.values(), *(f"{column}_ci95" for column in _SEEN.values())))
    where = [
        _safe(robot.name),
        *(f"{1e3 * length:.9g}" for length in (robot.channel.diameter, robot.tail.wavelength, robot.tail.amplitude)),
    ]
    for trial in kept:
        seen = [(trial.quantities[name], RATES[column]) for name, column in _SEEN.items()]
        cells = [_cell(item.value, factor) for item, factor in seen]
        halves = [_half_width(item, factor) if cell else "" for (item, factor), cell in zip(seen, cells, strict=True)]
        writer.writerow([*where, _trial(trial.name), *cells, *halves])
    return text.getvalue()


def _cell(value: float, factor: float) -> str:
    """A value in the column's unit; empty where it was not measured."""
    return f"{value / factor:.7g}" if math.isfinite(value) and value != 0 else ""


def _half_width(item: Measured, factor: float) -> str:
    """The larger half of a 95 % interval in the column's unit; empty where there is none."""
    half = max(item.high - item.value, item.value - item.low) / factor
    return f"{half:.4g}" if math.isfinite(half) else ""


def _trial(name: str) -> str:
    """A trial's name; one that reads as a fraction would be taken for a slip of the column."""
    safe = _safe(name)
    return f"trial {safe}" if safe.replace(".", "", 1).isdigit() and not safe.isdigit() else safe


def _safe(text: str) -> str:
    """One printable line, and no comment sign at its beginning."""
    return text_cell(text).lstrip("#").strip()[:200] or "trial"
