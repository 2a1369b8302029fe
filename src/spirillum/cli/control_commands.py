"""The commands `control` and `remote`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from spirillum.cli import renderer
from spirillum.cli.function_command import Request, from_function
from spirillum.cli.inputs import each_once
from spirillum.cli.motion_commands import check_movie
from spirillum.cli.shared_options import PANELS, Json, choices_in

if TYPE_CHECKING:
    from spirillum.controllers.lab import Lab
    from spirillum.controllers.sensors import Senses


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
        "placement": ("spirillum.robot.tube_pose:Placement",),
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
