"""The command `spirillum control`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from spirillum.cli.inputs import loaded_robot
from spirillum.cli.motion_commands import check_movie
from spirillum.cli.shared_options import Eccentricity, Ends, Gap, Json, Pitch, RobotArgument, Settings, starting

if TYPE_CHECKING:
    from spirillum.controllers.lab import Lab
    from spirillum.controllers.sensors import Senses

_TASK = "Task"
_LAB = "Laboratory"
_SCORES = "Seeds and scores"
_PICTURES = "Pictures"
_EYES = ("model", "tracker")


def _complete_tasks(incomplete: str) -> list[str]:
    from spirillum.controllers.control import TASKS

    return starting(TASKS, incomplete)


def _complete_controllers(incomplete: str) -> list[str]:
    from spirillum.controllers.task import CONTROLLERS

    return starting(CONTROLLERS, incomplete)


def _complete_laws(incomplete: str) -> list[str]:
    from typing import get_args

    from spirillum.controllers.steering import Law

    return starting(get_args(Law), incomplete)


def _complete_eyes(incomplete: str) -> list[str]:
    return starting(_EYES, incomplete)


def control(
    robot: RobotArgument,
    task: Annotated[
        str,
        typer.Option(
            autocompletion=_complete_tasks,
            help="What to do: stop-at, hold-speed, ride-out, save-battery, keep-axis.",
            rich_help_panel=_TASK,
        ),
    ] = "stop-at",
    at: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH", help="stop-at: where to stop, x of the body's mid-length.", rich_help_panel=_TASK
        ),
    ] = None,
    tolerance: Annotated[
        str | None,
        typer.Option(metavar="LENGTH", help="How far beside place or course is good.", rich_help_panel=_TASK),
    ] = None,
    speed: Annotated[
        str | None,
        typer.Option(metavar="VELOCITY", help="Tasks of speed: along the robot's way.", rich_help_panel=_TASK),
    ] = None,
    law: Annotated[
        str | None,
        typer.Option(
            autocompletion=_complete_laws,
            help="keep-axis: position (feedback of the place), aim (at the axis ahead).",
            rich_help_panel=_TASK,
        ),
    ] = None,
    rate: Annotated[
        str | None,
        typer.Option(metavar="RATE", help="keep-axis: rate of the field, else the robot's.", rich_help_panel=_TASK),
    ] = None,
    duration: Annotated[
        str | None,
        typer.Option(metavar="TIME", help="Length of a run, else from the predicted speed.", rich_help_panel=_TASK),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="Write the run too: NetCDF (.nc).")
    ] = None,
    controller: Annotated[
        str,
        typer.Option(
            autocompletion=_complete_controllers,
            help="feedback, or a baseline: nothing, open-loop, knowing.",
            rich_help_panel=_TASK,
        ),
    ] = "feedback",
    lab: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="TOML file: camera, meter, remote, pulse, unknown; else usual ones.",
            rich_help_panel=_LAB,
        ),
    ] = None,
    with_: Annotated[
        list[str] | None,
        typer.Option(
            "--with",
            metavar="PATH=VALUE",
            help="A field of the lab, such as camera.latency=50ms; repeatable.",
            rich_help_panel=_LAB,
        ),
    ] = None,
    learn: Annotated[
        bool,
        typer.Option("--learn", help="Estimate friction and gap beside the controller.", rich_help_panel=_LAB),
    ] = False,
    seen_by: Annotated[
        str,
        typer.Option(
            autocompletion=_complete_eyes,
            help="model (the camera of the lab) or tracker (rendered frames, tracked).",
            rich_help_panel=_LAB,
        ),
    ] = "model",
    remote: Annotated[
        str | None,
        typer.Option(
            metavar="PORT",
            help="Send the commands through a remote at a serial port; virtual: a simulated one.",
            rich_help_panel=_LAB,
        ),
    ] = None,
    live: Annotated[
        bool, typer.Option("--live", help="Run at the pace of the clock on the wall.", rich_help_panel=_LAB)
    ] = False,
    seed: Annotated[int, typer.Option(help="Of all that is drawn.", rich_help_panel=_SCORES)] = 0,
    seeds: Annotated[
        int, typer.Option(help="Score all controllers over so many seeds, too.", rich_help_panel=_SCORES)
    ] = 0,
    workers: Annotated[int, typer.Option(help="Processes for the scores.", rich_help_panel=_SCORES)] = 1,
    model: Annotated[str, typer.Option(help="Hydrodynamic model: tube, slender, rft; or auto.")] = "auto",
    gap: Gap = None,
    eccentricity: Eccentricity = None,
    pitch: Pitch = None,
    ends: Ends = None,
    roughness: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="Roughness of the wall, else 1e-4 of the body's radius.")
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Draw the run too: .png, .pdf or .svg.", rich_help_panel=_PICTURES),
    ] = None,
    movie: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Film the run too: .mp4 or .gif (extra `3d`).", rich_help_panel=_PICTURES),
    ] = None,
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Control a robot in a closed loop: late and noisy camera, on/off remote, flow, unknown friction; and score it.

    Example: `spirillum control biorob2012-wide --task stop-at --at 5mm -o run.nc --plot run.png`
    """
    from spirillum.cli import renderer
    from spirillum.controllers.control import control as answer
    from spirillum.files import PICTURES, guard_inputs, netcdf_target, output_target, write_dataset

    target = None if output is None else netcdf_target(output)
    picture = None if plot is None else output_target(plot, PICTURES, "run.png")
    if movie is not None:
        check_movie(movie)
    fields = {"at": at, "tolerance": tolerance, "speed": speed, "law": law, "rate": rate, "duration": duration}
    asked = {"gap": gap, "eccentricity": eccentricity, "pitch": pitch, "ends": ends}
    place = {name: value for name, value in asked.items() if value is not None}
    with guard_inputs(lab), renderer.progress_bar(quiet=json) as progress:
        found = answer(
            loaded_robot(robot, settings),
            {"kind": task, **{name: value for name, value in fields.items() if value is not None}},
            lab=_lab(lab, with_),
            controller=controller,
            seed=seed,
            seeds=seeds,
            plant={"model": model, "placement": place, "roughness": roughness},
            learn=learn,
            workers=workers,
            live=live,
            bench=_bench(seen_by, remote),
            progress=progress,
        )
        files: dict[str, Any] = {"file": None if output is None else str(output)}
        if target is not None:
            write_dataset(found.dataset, target)
        if picture is not None:
            from spirillum.view.figures.control import control_figure
            from spirillum.view.figures.style import save_as

            save_as(control_figure(found), picture)
            files["plot"] = str(plot)
        if movie is not None:
            from spirillum.view.scene3d.film import film

            film(found.dataset, movie, progress=progress)
            files["movie"] = str(movie)
    renderer.show(renderer.with_files(found.to_dict(), **files), json=json)
    if found.interrupted:
        raise KeyboardInterrupt


def _bench(seen_by: str, port: str | None) -> Callable[..., Senses] | None:
    """Factory of camera and remote of a run; None: the modelled ones."""
    from spirillum.errors import InputError

    if seen_by not in _EYES:
        raise InputError(f"seen-by = {seen_by[:40]!r}; allowed: {', '.join(_EYES)}")
    if seen_by == "model" and port is None:
        return None
    from spirillum.interfaces.bench import Bench

    return partial(Bench, tracked=seen_by == "tracker", port=port)


def _lab(path: Path | None, changes: list[str] | None) -> Lab:
    """The lab of a file with fields changed."""
    from spirillum.controllers.lab import Lab
    from spirillum.robot.load import parse_setting

    return Lab.read(path, dict(parse_setting(text, "--with", "camera.latency=50ms") for text in changes or []))
