"""The commands of motion in time: `simulate`, `magnetic-sweep`, `settle`, `control` and `remote`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from spirillum.cli import renderer
from spirillum.cli.function_command import Request, from_function
from spirillum.cli.inputs import each_once, time_window
from spirillum.cli.shared_options import NO_FORM, NO_START, PANELS, Json, choices_in, complete_models
from spirillum.errors import InputError, check_choice
from spirillum.notes import note_attributes, notes_in

if TYPE_CHECKING:
    import xarray as xr

    from spirillum.controllers.lab import Lab
    from spirillum.controllers.sensors import Senses


@from_function(
    "spirillum.dynamics.simulation:simulate",
    without={
        **NO_FORM,
        "resolution.tolerance": "an option of the robot, model.tube.tolerance",
        "resolution.phases": "an option of the robot, model.tube.phases",
        "placement.tail_drop": "no rigid tail moves with it",
        "in_tube.flow": "--flow takes a velocity or a file",
        "field.rotation_rate": "an option of the robot, drive.rate",
        "field.strength": "an option of the robot, drive.field",
    },
)
def simulate(
    request: Request,
    *,
    output: Path | None = None,
    model: str = "auto",
    on: list[str] | None = None,
    flow: str | None = None,
    plot: Path | None = None,
    panels: str | None = None,
    column: str | None = None,
    movie: Path | None = None,
    json: Json = False,
) -> None:
    """Simulate swimming from rest: six degrees of freedom, weight, floor, motor and remote; or two (`--motion held`).

    A free robot starts where --gap, --pitch and --yaw place it; without --gap at 1/18 of its radius from the wall.

    Example: `spirillum simulate biorob2012-wide -o run.nc --duration 4s --on 0s:1s --on 2s:3s`
    """
    from spirillum.dynamics.integration import INTERRUPTED
    from spirillum.dynamics.run_summary import run_answer
    from spirillum.files import PICTURES, guard_inputs, netcdf_target, output_target, write_dataset

    over_time = flow is not None and (flow.lower().endswith(".csv") or Path(flow).is_file())
    files_read = (request.typed.get(name) for name in ("in_tube.continued", "posterior", "calibration", "timing.duty"))
    with guard_inputs(*files_read, flow if over_time else None):
        target = None if output is None else netcdf_target(output)
        picture = None if plot is None else output_target(plot, PICTURES, "run.png")
    look = {name: word for name, word in (("column", column), ("panels", panels)) if word is not None}
    if picture is not None:
        from spirillum.view.figures.trajectory import COLUMNS, PANELS

        for name, allowed in (("column", COLUMNS), ("panels", PANELS)):
            check_choice(name, look.get(name, next(iter(allowed))), allowed)
    elif look:
        name, word = next(iter(look.items()))
        raise InputError(f"{name} = {word[:40]!r} without a plot, whose look it is; allowed: with --plot")
    if movie is not None:
        check_movie(movie)
    if on:
        request.typed["timing.on"] = [time_window(window) for window in on]
    if flow is not None:
        request.typed["in_tube.flow" if over_time else "placement.flow"] = flow
    with renderer.progress_bar(quiet=json) as progress:
        dataset = request(model=model, progress=progress)
        if target is not None:
            write_dataset(dataset, target)
        look = {"panels": "main", **look}
        with renderer.answer_before_error(lambda: run_answer(dataset), json=json):
            files, warnings = _draw_and_film(dataset, picture, look, movie, progress, written=target is not None)
    found = run_answer(dataset.assign_attrs(note_attributes([*notes_in(dataset.attrs), *warnings])))
    renderer.show(renderer.with_files(found, file=None if output is None else str(output), **files), json=json)
    if any(event["what"] == INTERRUPTED for event in found["events"]):
        raise KeyboardInterrupt("" if output is None else f"the run until then is kept in {output}")


def check_movie(movie: Path) -> None:
    """Refuse a film that cannot be written before anything is computed."""
    from spirillum.files import output_target
    from spirillum.optional_dependencies import import_optional
    from spirillum.view.scene3d.rendering import FILMS

    output_target(movie, FILMS, "run.mp4")
    for package in ("pyvista", "av"):
        import_optional(package, "a film")


def _draw_and_film(
    dataset: xr.Dataset, picture: Path | None, look: dict[str, str], movie: Path | None, progress: Any, *, written: bool
) -> tuple[dict[str, str], list[str]]:
    """Draw and film a run; the files by what they are, and the film's warnings."""
    files: dict[str, str] = {}
    warnings: list[str] = []
    if picture is not None:
        from spirillum.view.figures.style import save_as
        from spirillum.view.figures.trajectory import trajectory_figure

        with _after_the_run("plot", written=written):
            save_as(trajectory_figure(dataset, **look), picture)
        files["plot"] = str(picture)
    if movie is not None:
        from spirillum.view.scene3d.film import film

        with _after_the_run("film", written=written):
            warnings += film(dataset, movie, progress=progress).warnings
        files["movie"] = str(movie)
    return files, warnings


@contextmanager
def _after_the_run(what: str, *, written: bool) -> Iterator[None]:
    """Report that something cannot be plotted, and whether the run itself is kept."""
    try:
        yield
    except InputError as error:
        raise InputError(f"the run is {'' if written else 'not '}written, the {what} is not: {error}") from error


@from_function(
    "spirillum.dynamics.rotating_field:magnetic_sweep",
    without={**NO_FORM, **dict.fromkeys(("resolution.tolerance", "resolution.phases"), "of the model tube")},
    complete={"model": complete_models},
)
def magnetic_sweep(request: Request, *, output: Path, plot: Path | None = None, json: Json = False) -> None:
    """Sweep the rate of a rotating field: speed, phase lag, wobble and step-out of a free one-piece swimmer.

    Example: `spirillum magnetic-sweep magnetic-helix -o sweep.nc --plot sweep.png`
    """
    from spirillum.dynamics.run_summary import sweep_answer
    from spirillum.files import netcdf_target, write_dataset

    target = netcdf_target(output)
    draw = renderer.picture(plot, "sweep.png", "spirillum.view.figures.magnetic:magnetic_figure")
    with renderer.progress_bar(quiet=json) as progress:
        dataset = request(progress=progress)
    write_dataset(dataset, target)
    answer = renderer.with_files(sweep_answer(dataset), file=str(output))
    renderer.show_with_pictures(answer, dataset, json=json, draw={} if plot is None else {"plot": draw})


@from_function(
    "spirillum.dynamics.settling:settle", without={**NO_START, "placement.tail_drop": "no rigid tail moves with it"}
)
def settle(request: Request, *, output: Path | None = None, json: Json = False) -> None:
    """Follow a robot released in its tube to its steady state: path, gap, azimuth, tilt, speed and body rate.

    Example: `spirillum settle biorob2012-wide --gap 0.5mm --roughness 20um`
    """
    draw = renderer.picture(output, "settling.png", "spirillum.view.figures.release:settling_figure")
    with renderer.progress_bar(quiet=json) as progress:
        found = request(progress=progress)
    renderer.show_with_pictures(found.to_dict(), found, json=json, draw={"file": draw})


_EYES = ("model", "tracker")


@from_function(
    "spirillum.controllers.control:control",
    without={
        "plant": "--model, --roughness and the placement",
        "bench": "--seen-by and --remote",
        **dict.fromkeys(("placement.yaw", "placement.tail_drop", "placement.flow"), "of simulate"),
    },
    complete={
        "controller": choices_in("spirillum.controllers.task:CONTROLLERS"),
        "law": choices_in("spirillum.controllers.steering:Law"),
    },
    tables={
        "task": (
            "spirillum.controllers.stop_task:StopAtTask",
            "spirillum.controllers.course_tasks:_CourseTask",
            "spirillum.controllers.steering:KeepAxisTask",
            "spirillum.controllers.task:Task",
        ),
        "placement": ("spirillum.robot.placement:Placement",),
    },
)
def control(
    request: Request,
    *,
    task: Annotated[
        str,
        typer.Option(
            autocompletion=choices_in("spirillum.controllers.control:TASKS"),
            help="What to do: stop-at, hold-speed, ride-out, save-battery, keep-axis.",
            rich_help_panel=PANELS["task."],
        ),
    ] = "stop-at",
    output: Path | None = None,
    with_: list[str] | None = None,
    seen_by: str = "model",
    remote: str | None = None,
    model: str = "auto",
    roughness: str | None = None,
    plot: Path | None = None,
    movie: Path | None = None,
    json: Json = False,
) -> None:
    """Control a robot in a closed loop: late and noisy camera, on/off remote, flow, unknown friction; and score it.

    Example: `spirillum control biorob2012-wide --task stop-at --at 5mm -o run.nc --plot run.png`
    """
    from spirillum.files import guard_inputs, netcdf_target, write_dataset

    target = None if output is None else netcdf_target(output)
    draw = renderer.picture(plot, "run.png", "spirillum.view.figures.control:control_figure")
    if movie is not None:
        check_movie(movie)
    lab = request.typed.pop("lab", None)
    place = request.take("placement")
    with guard_inputs(lab), renderer.progress_bar(quiet=json) as progress:
        found = request(
            {"kind": task, **request.take("task")},
            lab=_lab(lab, with_),
            plant={"model": model, "placement": place, "roughness": roughness},
            bench=_bench(seen_by, remote),
            progress=progress,
        )
        files: dict[str, Any] = {"file": None if output is None else str(output)}
        if target is not None:
            write_dataset(found.dataset, target)
        with renderer.answer_before_error(lambda: renderer.with_files(found.to_dict(), **files), json=json):
            if plot is not None:
                files["plot"] = draw(found)
            if movie is not None:
                from spirillum.view.scene3d.film import film

                film(found.dataset, movie, progress=progress)
                files["movie"] = str(movie)
    renderer.show(renderer.with_files(found.to_dict(), **files), json=json)
    if found.interrupted:
        raise KeyboardInterrupt("" if output is None else f"the run until then is kept in {output}")


def _bench(seen_by: str, port: str | None) -> Callable[..., Senses] | None:
    """Factory of camera and remote of a run; None: the modelled ones."""
    from spirillum.errors import check_choice

    check_choice("seen-by", seen_by, _EYES)
    if seen_by == "model" and port is None:
        return None
    from spirillum.interfaces.bench import Bench

    return partial(Bench, tracked=seen_by == "tracker", port=port)


def _lab(path: Path | None, changes: list[str] | None) -> Lab:
    from spirillum.controllers.lab import Lab
    from spirillum.robot.load import parse_setting

    given = [parse_setting(text, "--with", "camera.latency=50ms") for text in changes or []]
    return Lab.read(path, each_once(given, "--with"))


@from_function("spirillum.interfaces.serial_remote:remote", robot=None)
def remote(request: Request, *, port: str, json: Json = False) -> None:
    """Switch a real motor on for a time, through a remote at a serial port. Needs the extra `control`.

    Example: `spirillum remote /dev/ttyUSB0 --duty 0.5 --duration 2s`
    """
    renderer.show(request(port).to_dict(), json=json)
