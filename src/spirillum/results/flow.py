"""The flow on a plane or a box written as a picture, a VTK image or NetCDF."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from spirillum.errors import InputError
from spirillum.fields.flow import Flow
from spirillum.files import PICTURES, output_target, write_dataset

if TYPE_CHECKING:
    import xarray as xr


def check_targets(plane: Path | None, volume: Path | None) -> None:
    """Check the files before any work is done."""
    netcdf = {".nc": "a NetCDF file"}
    if plane is None and volume is None:
        raise InputError("no file is requested; allowed: -o flow.png for a plane, --volume flow.vti for a box, or both")
    if plane is not None:
        output_target(plane, {**PICTURES, **netcdf}, "flow.png")
    if volume is not None:
        output_target(volume, {".vti": "a VTK image file", **netcdf}, "flow.vti")
    if plane is not None and volume is not None and plane.resolve() == volume.resolve():
        raise InputError(f"{plane} is requested as plane and as box; allowed: two files")


def write_flow(flow: Flow, dataset: xr.Dataset, path: Path) -> None:
    """Write a plane or a box in the format of the file's suffix."""
    if path.suffix.lower() == ".nc":
        write_dataset(dataset, path)
    elif path.suffix.lower() == ".vti":
        from spirillum.formats.array_files import write_vti

        write_vti(dataset, path)
    else:
        from spirillum.view.figures.flow import flow_figure
        from spirillum.view.figures.style import save_as

        save_as(flow_figure(flow, dataset), path)
