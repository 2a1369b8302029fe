"""Arrays as files: labelled ones as xarray writes them, and three-dimensional grids as VTK images (.vti)."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from spirillum.files import atomic_write, netcdf_file
from spirillum.optional_dependencies import import_optional

if TYPE_CHECKING:
    import xarray as xr


Variable: TypeAlias = tuple[tuple[str, ...], Any, Mapping[str, Any]]  #: Dimensions, values and attributes.


class Labelled(NamedTuple):
    """What an `xarray.Dataset` is made of."""

    data: Mapping[str, Variable]  #: Variables.
    coordinates: Mapping[str, Variable]  #: One for each dimension.
    attributes: Mapping[str, Any]

    def dataset(self) -> xr.Dataset:
        """As an `xarray.Dataset`."""
        import xarray as xr

        return xr.Dataset(self.data, coords=self.coordinates, attrs=self.attributes)

    def write(self, path: Path) -> None:
        """Write NetCDF-4, compressed, whole or not at all; `xarray.open_dataset` gives `dataset` back."""
        with netcdf_file(path) as file:
            file.dimensions = {name: len(values) for name, (_, values, _) in self.coordinates.items()}
            for name, variable in {**self.coordinates, **self.data}.items():
                _write(file, name, variable)
            file.attrs.update(self.attributes)


def _write(file: Any, name: str, variable: Variable) -> None:
    dimensions, values, attributes = variable
    values = np.asarray(values)
    options: dict[str, Any] = {"compression": "gzip", "compression_opts": 4, "shuffle": True} if values.ndim else {}
    if values.dtype.kind == "U":
        import h5py

        values, options = values.astype(object), {"dtype": h5py.string_dtype()}
    elif values.dtype.kind == "f":
        options["fillvalue"] = np.nan
    written = file.create_variable(name, dimensions, data=values, **options)
    written.attrs.update(attributes)


_AXES = ("x", "y", "z")


def write_vti(dataset: xr.Dataset, path: Path) -> None:
    """Write a flow in a box as VTK image data, whole or not at all."""
    # Point arrays `velocity` (3 components, m/s), `pressure` (Pa), both NaN inside solids, and `inside` (0 or 1);
    # lengths in m. The dataset's attributes stand in a comment at the head of the file, as JSON.
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
