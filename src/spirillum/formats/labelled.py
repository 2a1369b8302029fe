"""Labelled arrays written as xarray writes them, without the time that importing it takes for every film."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from spirillum.files import netcdf_file

if TYPE_CHECKING:
    import xarray as xr

Variable: TypeAlias = tuple[tuple[str, ...], Any, Mapping[str, Any]]
"""Dimensions, values and attributes."""


class Labelled(NamedTuple):
    """What an `xarray.Dataset` is made of."""

    data: Mapping[str, Variable]
    """Variables."""
    coordinates: Mapping[str, Variable]
    """One for each dimension."""
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
