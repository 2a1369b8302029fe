"""Grids in three dimensions as VTK image files (.vti), which ParaView and VisIt read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from spirillum.files import atomic_write
from spirillum.optional_dependencies import import_optional

if TYPE_CHECKING:
    import xarray as xr

_AXES = ("x", "y", "z")


def write_vti(dataset: xr.Dataset, path: Path) -> None:
    """Write a flow in a box as VTK image data, whole or not at all.

    Point arrays `velocity` (3 components, m/s), `pressure` (Pa), both NaN inside solids, and `inside` (0 or 1); lengths
    in m. The dataset's attributes stand in a comment at the head of the file, as JSON.
    """
    import_optional("pyevtk", "a flow for ParaView")
    from pyevtk.hl import imageToVTK

    ordered = dataset.transpose(*_AXES)
    axes = [np.asarray(ordered[axis].values, dtype=float) for axis in _AXES]
    with atomic_write(path) as temporary:
        imageToVTK(
            str(temporary.with_suffix("")),  # the library adds the suffix
            # Plain floats: the library writes their repr, which numpy's own floats spell with their type.
            origin=tuple(float(axis[0]) for axis in axes),
            spacing=tuple(float((axis[-1] - axis[0]) / (axis.size - 1)) for axis in axes),
            pointData={
                "velocity": tuple(np.ascontiguousarray(ordered[f"velocity_{axis}"].values) for axis in _AXES),
                "pressure": np.ascontiguousarray(ordered["pressure"].values),
                "inside": np.ascontiguousarray(ordered["inside"].values.astype(np.uint8)),
            },
        )
        add_comment(temporary, json.dumps(dict(ordered.attrs), sort_keys=True, default=str))


def add_comment(path: Path, text: str) -> None:
    """Insert a JSON text as a comment behind the XML declaration; offsets of the appended data stay valid."""
    declaration, rest = path.read_bytes().split(b"\n", 1)
    safe = text.replace("--", "-\\u002d")  # a comment must not hold two hyphens; JSON may spell one of them
    path.write_bytes(b"\n".join([declaration, f"<!-- {safe} -->".encode(), rest]))
