"""The commands of pictures: `page`, `show`, `film` and `flow`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from spirillum.cli import renderer
from spirillum.cli.function_command import Request, from_function
from spirillum.cli.inputs import refuse_conflicts
from spirillum.cli.shared_options import NO_FORM, Json, choices, choices_in, optional_robot
from spirillum.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

    from spirillum.fields.flow import Flow


@from_function(
    "spirillum.pages.launch:page",
    robot=optional_robot("A preset's name or a robot file (TOML); else that of --run, or biorob2012-wide."),
)
def page(request: Request) -> None:
    """Show a robot alive in the browser: it swims, its knobs turn, its numbers follow. Needs the extra `page`.

    Example: `spirillum page biorob2012-wide`
    """
    if not request.settings:
        request.robot = request.named_robot  # the page offers its name in commands
    request(tell=typer.echo)


_VIEWS = choices("front", "perspective", "rear", "side", "top")


@from_function("spirillum.view.scene3d.show:show", without={"path": "-o FILE"}, complete={"view": _VIEWS})
def show(request: Request, *, output: Path | None = None, window: bool = False, json: Json = False) -> None:
    """Draw a robot in three dimensions: a picture of its shape. Needs the extra `3d`.

    Example: `spirillum show biorob2012-wide -o robot.png --view side`
    """
    target = output if output is not None or window else Path("robot.png")
    with renderer.at_work("drawing the robot", quiet=json):
        found = request(target, window=window)
    renderer.show(found.to_dict(), json=json)


@from_function(
    "spirillum.view.scene3d.film:film",
    without={"dataset": "the argument", "path": "-o FILE"},
    complete={"camera": choices("auto", "fixed", "follow")},
    robot=None,
)
def film(request: Request, *, run: Path, output: Path, view: str = "perspective", json: Json = False) -> None:
    """Film a run of `simulate` in three dimensions, to show to people. Needs the extra `3d`.

    Example: `spirillum film run.nc -o run.mp4 --speed 0.5`
    """
    from spirillum.dynamics.run_file import open_run
    from spirillum.files import output_target
    from spirillum.view.scene3d.rendering import FILMS

    output_target(output, FILMS, "run.mp4")
    request.show(open_run(run), output, view=view, json=json)


@from_function(
    "spirillum.fields.flow:flow",
    without={
        **NO_FORM,
        "resolution.phases": "an option of the robot, model.tube.phases",
        "calibrated": "factors represent walls that are not in the flow",
    },
    complete={"model": choices_in("spirillum.fields.flow:FLOW_MODELS", "auto"), "frame": choices("body", "lab")},
    robot=optional_robot("A preset's name or a TOML file; none with --run."),
)
def flow(
    request: Request,
    *,
    context: typer.Context,
    output: Path | None = None,
    volume: Path | None = None,
    plane: str = "xz",
    offset: str = "0mm",
    extent: str | None = None,
    resolution: int = 240,
    volume_resolution: int = 80,
    run: Path | None = None,
    time: str | None = None,
    json: Json = False,
) -> None:
    """Compute velocity and pressure of the fluid around the swimming robot: a picture, or numbers on a grid.

    Example: `spirillum flow biorob2012-wide -o flow.png --tail-rate 1.2Hz`
    """
    from spirillum.fields.flow import find_tube_pose, flow_answer
    from spirillum.fields.grid import box_around, plane_around
    from spirillum.files import guard_inputs
    from spirillum.fluid.tube.domain import pose_of

    with guard_inputs(run):
        _check_targets(output, volume)
    model = request.typed.get("model", "auto")
    states = {"no plane": output is None, "no volume": volume is None, "run": run is not None}
    states["run with another model"] = run is not None and model not in ("auto", "tube")
    refuse_conflicts(context, *(state for state, holds in states.items() if holds))
    fineness = request.arguments.get("resolution")
    if run is None:
        if request.named_robot is None or time is not None:
            problem = "no robot" if request.named_robot is None else f"time = {time} without a run"
            raise InputError(f"{problem}; allowed: a preset's name or a robot file, or --run RUN.nc --time TIME")
        loaded = request.robot
        seat = find_tube_pose(loaded, model, request.arguments.get("placement"), fineness)
    else:
        from spirillum.dynamics.flow_of_run import flow_of_run, moment_of_run

        if time is None:
            raise InputError("no moment of the run; allowed: --time, such as 0.5s")
        moment = moment_of_run(run, time, fineness).prediction
        loaded, seat = moment.robot, pose_of(moment.batch)
    plane_around(loaded, plane, offset, extent, resolution, seat)
    if volume is not None:
        box_around(loaded, extent, volume_resolution, seat)
    with renderer.progress_bar(quiet=json) as progress, guard_inputs(run):
        if run is None:
            progress("flow: forces on the robot", 0, 1)
            found = request()
        else:
            frame = request.typed.get("frame", "lab")
            found = flow_of_run(run, str(time), frame=frame, resolution=fineness, progress=progress)
        written = {}
        if output is not None:
            written[output] = found.plane(plane, offset=offset, extent=extent, resolution=resolution, progress=progress)
        if volume is not None:
            written[volume] = found.volume(extent=extent, resolution=volume_resolution, progress=progress)
        for path, dataset in written.items():
            _write_flow(found, dataset, path)
    renderer.show(flow_answer(found, written), json=json)


def _check_targets(plane: Path | None, volume: Path | None) -> None:
    """Check the files before any work is done."""
    from spirillum.files import PICTURES, output_target

    netcdf = {".nc": "a NetCDF file"}
    if plane is None and volume is None:
        raise InputError("no file is requested; allowed: -o flow.png for a plane, --volume flow.vti for a box, or both")
    if plane is not None:
        output_target(plane, {**PICTURES, **netcdf}, "flow.png")
    if volume is not None:
        output_target(volume, {".vti": "a VTK image file", **netcdf}, "flow.vti")
    if plane is not None and volume is not None and plane.resolve() == volume.resolve():
        raise InputError(f"{plane} is requested as plane and as box; allowed: two files")


def _write_flow(flow: Flow, dataset: xr.Dataset, path: Path) -> None:
    """Write a plane or a box in the format of the file's suffix."""
    if path.suffix.lower() == ".nc":
        from spirillum.files import write_dataset

        write_dataset(dataset, path)
    elif path.suffix.lower() == ".vti":
        from spirillum.formats.array_files import write_vti

        write_vti(dataset, path)
    else:
        from spirillum.view.figures.flow import flow_figure
        from spirillum.view.figures.style import save_as

        save_as(flow_figure(flow, dataset), path)
