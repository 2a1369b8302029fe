"""The answer of `flow`: where the fluid is fastest, extremes of the pressure, the grid, the files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from spirillum.answer import envelope, quantity
from spirillum.cli.text import Answer, add_quantities, grid
from spirillum.errors import InputError
from spirillum.files import PICTURES, output_target, write_dataset

if TYPE_CHECKING:
    import xarray as xr

    from spirillum.fields.flow import Flow

__all__ = ["check_targets", "flow_answer", "flow_table", "write"]

_MOTION = {"forward_velocity": "m/s", "tail_rotation_rate": "rad/s", "body_rotation_rate": "rad/s"}


def check_targets(plane: Path | None, volume: Path | None) -> None:
    """Check the files before any work is done.

    Raises:
        InputError: if there is none, both are one, or one of them cannot be written.
    """
    netcdf = {".nc": "a NetCDF file"}
    if plane is None and volume is None:
        raise InputError("no file is asked for; allowed: -o flow.png for a plane, --volume flow.vti for a box, or both")
    if plane is not None:
        output_target(plane, {**PICTURES, **netcdf}, "flow.png")
    if volume is not None:
        output_target(volume, {".vti": "a VTK image file", **netcdf}, "flow.vti")
    if plane is not None and volume is not None and plane.resolve() == volume.resolve():
        raise InputError(f"{plane} is asked for as plane and as box; allowed: two files")


def write(flow: Flow, dataset: xr.Dataset, path: Path) -> None:
    """Write a plane or a box in the form that the file's ending asks for."""
    if path.suffix == ".nc":
        write_dataset(dataset, path)
    elif path.suffix == ".vti":
        from spirillum.formats.vtk_image import write_vti

        write_vti(dataset, path)
    else:
        from spirillum.view.figures.flow import flow_figure
        from spirillum.view.figures.style import save_as

        save_as(flow_figure(flow, dataset), path)


def flow_answer(flow: Flow, written: Mapping[Path, xr.Dataset]) -> dict[str, Any]:
    """Answer of `flow`.

    Args:
        flow: the flow.
        written: what was computed, by the file that holds it.
    """
    content = {
        "robot": flow.robot.name,
        "model": flow.prediction.model.name,
        "friction": flow.prediction.friction,
        "calibrated": flow.prediction.calibrated,
        "frame": flow.frame,
        "phase": quantity(flow.phase, "rad"),
        **{name: quantity(getattr(flow.prediction, name), unit) for name, unit in _MOTION.items()},
        **({} if flow.seat is None else {"plug_velocity": quantity(flow.prediction.plug_velocity, "m/s")}),
        "held_force": quantity(flow.held_force, "N", direction="sideways"),
        "placement": flow.prediction.placement,
        "files": [_file(path, dataset) for path, dataset in written.items()],
        "references": list(flow.prediction.references),
    }
    return envelope("flow", content, flow.warnings)


def _file(path: Path, dataset: xr.Dataset) -> dict[str, Any]:
    import numpy as np

    axes = [str(name) for name in dataset["inside"].dims]
    across = [axis for axis in "xyz" if axis not in axes]
    step = float(dataset[axes[0]][1] - dataset[axes[0]][0])
    found = {
        "file": str(path),
        "grid": {
            "points": {axis: int(dataset.sizes[axis]) for axis in axes},
            "spacing": quantity(step, "m"),
            **{axis: quantity(np.array([dataset[axis].min(), dataset[axis].max()]), "m") for axis in axes},
            **{axis: quantity(float(dataset[axis]), "m") for axis in across},
        },
        "points_inside": int(dataset["inside"].sum()),
        **dict(_extremes(dataset)),
    }
    if across:
        through = dataset[f"velocity_{across[0]}"].fillna(0.0).integrate(axes)
        found["flow_rate_through_plane"] = quantity(float(through), "m^3/s", direction=f"+{across[0]}")
    return found


def _extremes(dataset: xr.Dataset) -> Iterator[tuple[str, Any]]:
    """Largest speed, lowest and highest pressure on the grid, with their places."""
    import numpy as np

    parts = [dataset[f"velocity_{axis}"] ** 2 for axis in "xyz"]
    speed = (parts[0] + parts[1] + parts[2]) ** 0.5
    if not bool(np.isfinite(speed).any()):
        return  # every point lies inside a solid
    for name, values, place, unit in (
        ("largest_speed", speed, speed.argmax(...), "m/s"),
        ("lowest_pressure", dataset["pressure"], dataset["pressure"].argmin(...), "Pa"),
        ("highest_pressure", dataset["pressure"], dataset["pressure"].argmax(...), "Pa"),
    ):
        there = values.isel(place)
        yield name, quantity(float(there), unit, at=quantity([float(there[axis]) for axis in "xyz"], "m"))


def flow_table(answer: Answer, console: Console) -> None:
    """Tables of `flow`."""
    title = f"{answer['robot']}: flow, model {answer['model']}, {answer['frame']} frame"
    table = grid(title, "quantity", "value", "unit", "SI")
    add_quantities(table, {**answer, **answer["placement"]})
    console.print(table)
    if answer["placement"].get("ends"):
        console.print(f"ends of the channel: {answer['placement']['ends']}", highlight=False)
    for item in answer["files"]:
        points = item["grid"]["points"]
        shape = f"plane {''.join(points)}" if len(points) == 2 else "box"
        size = " x ".join(str(count) for count in points.values())
        found = grid(f"{item['file']}: {shape}, {size} points", "quantity", "value", "unit", "SI")
        add_quantities(found, {"spacing": item["grid"]["spacing"], **item})
        console.print(found)
