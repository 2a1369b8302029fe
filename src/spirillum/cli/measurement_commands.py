"""The commands of videos: `measure`, `track`, `render`, `virtual-experiment`, `setup` and `observations`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from spirillum.cli import renderer
from spirillum.cli.function_command import FunctionCommand, Request, from_function, own_options
from spirillum.cli.inputs import overrides_from, refuse_conflicts
from spirillum.cli.shared_options import Json, NotedCommand, Settings, choices, optional_robot
from spirillum.cli.wrapping import wrapped
from spirillum.errors import InputError

if TYPE_CHECKING:
    from spirillum.live.observation import Observation, Tracked


_NO_SETUP = "--setup is missing; allowed: a setup file, see `spirillum setup new`"


@from_function(
    "spirillum.results.measurement:measure",
    without={
        "overrides": "--set",
        **dict.fromkeys(("feasibility.setup", "feasibility.video", "feasibility.overrides"), "those of measure"),
    },
    robot=None,
    tables={"feasibility": ("spirillum.measurement.feasibility:feasibility",)},
)
def measure(
    request: Request,
    *,
    context: typer.Context,
    videos: list[Path] | None = None,
    setup: Path | None = None,
    output: Path = Path("spirillum-measurement"),
    feasibility: bool = False,
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Measure speed and rotation rates in videos, each a trial, with 95 % intervals.

    Example: `spirillum measure trial-1.mp4 trial-2.mp4 --setup setup.toml -o measured`
    """
    if setup is None:
        raise InputError(_NO_SETUP)
    overrides = overrides_from(settings)
    drawn = request.typed.get("figures", True)
    refuse_conflicts(context, "feasibility" if feasibility else "no feasibility", *([] if drawn else ["no figures"]))
    expected = request.take("feasibility")
    if feasibility:
        from spirillum.measurement.feasibility import feasibility as verdict

        if videos and len(videos) > 1:
            raise InputError(f"--feasibility with {len(videos)} videos; allowed: none, or one that shows the ruler")
        found = verdict(setup, **expected, video=videos[0] if videos else None, overrides=overrides)
        renderer.show(found.to_dict(), json=json)
        if not found.feasible:
            raise typer.Exit(1)
        return
    from spirillum.measurement.trials import RATE_NAMES

    result = request.show(videos or [], setup, output, overrides=overrides, json=json)
    if result.failures:
        video, sentence = result.failures[0]
        more = "" if len(result.failures) == 1 else f" (and {len(result.failures) - 1} more)"
        where = "" if Path(video).name in sentence else f"{video}: "
        raise InputError(f"{where}{sentence}{more}")
    values = [trial.quantities[name].value for trial in result.trials for name in RATE_NAMES]
    if values and not any(math.isfinite(value) for value in values):
        trial = result.trials[0]
        raise InputError(f"{trial.video}: no rate could be given: {trial.quantities['forward_velocity'].reason}")


@from_function(
    "spirillum.live.session:track",
    without={"overrides": "--set", "on_observation": "the terminal or --udp"},
    complete={"pace": choices("fast", "real")},
    robot=None,
)
def track(
    request: Request,
    *,
    source: str,
    setup: Path | None = None,
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Track a robot live: a JSON line for every frame, and a last one for all of them.

    With --udp the lines go out as datagrams, and the terminal shows the end alone.

    Example: `spirillum track camera:0 --setup setup.toml --size 640x480 --fps 30`
    """
    from spirillum.argument_validation import as_pixels
    from spirillum.live.session import observation_line
    from spirillum.live.streams import line_of

    if setup is None:
        raise InputError(_NO_SETUP)

    def say(said: Observation, latency: float | None) -> None:
        typer.echo(line_of(observation_line(said, latency)))

    typed = request.typed
    if "size" in typed:
        typed["size"] = as_pixels(typed["size"])
    lines = "udp" not in typed
    result = request(source, setup, overrides=overrides_from(settings), on_observation=say if lines else None)
    if lines:
        typer.echo(line_of(result.to_dict()))
    else:
        renderer.show(result.to_dict(), json=json)
    _end(result, source)


def _end(result: Tracked, source: str) -> None:
    """Leave with the exit code of how it ended."""
    from spirillum.measurement.trials import RATE_NAMES

    if result.interrupted:
        raise KeyboardInterrupt
    if result.stopped:
        raise InputError(result.stopped)
    if result.trial is not None:
        rates = [result.trial.quantities[name] for name in RATE_NAMES]
        if all(rate.value != rate.value for rate in rates):
            slow = result.pace == "real" and Path(source).exists() and result.dropped > result.tracked
            hint = "; most frames passed while the robot was learnt: --pace fast looks at all of them" if slow else ""
            raise InputError(f"{result.source}: no rate could be given: {rates[0].reason}{hint}")


@from_function(
    "spirillum.virtual.trial:render",
    without={"path": "-o FILE", "setup": "it is written beside the video", "troubles.": "--trouble, by name"},
    robot=optional_robot("A preset's name or a TOML file; else that of --run."),
)
def render(
    request: Request,
    *,
    output: Path,
    preset: str = "clean",
    trouble: list[str] | None = None,
    json: Json = False,
) -> None:
    """Film a robot with a virtual laboratory camera, to try `measure` before the experiment. Needs the extra `video`.

    The video is synthetic, and its truth is written beside it. For a film to show to people, see `film`.

    Example: `spirillum render biorob2012-wide -o trial.mp4 --tail-rate 1.2Hz --duration 20s`
    """
    request.typed["degradation.preset"] = preset
    request.show(output, troubles=None if trouble is None else ",".join(trouble), json=json)


@from_function(
    "spirillum.virtual.experiment:virtual_experiment",
    without={
        **dict.fromkeys(("motion.forward_velocity", "motion.body_rate"), "of one robot, render"),
        **dict.fromkeys(("camera.exposure", "camera.field_of_view", "camera.distortion"), "of render"),
    },
    robot=None,
)
def virtual_experiment(
    request: Request,
    *,
    study: Path | None = None,
    output: Path = Path("spirillum-virtual-experiment"),
    preset: str = "clean",
    json: Json = False,
) -> None:
    """Film five trials of each robot of a study with that camera, with their truth: synthetic. A rerun resumes.

    Example: `spirillum virtual-experiment -o experiment --tail-rate 1.2Hz`
    """
    request.typed["degradation.preset"] = preset
    request.show(study, output, json=json)


setup_app = typer.Typer(name="setup", help="Setup files: camera, tank, ruler and robot.", no_args_is_help=True)


@setup_app.command("new", cls=FunctionCommand)
@from_function("spirillum.measurement.setup_template:new_setup_file", without={"path": "the argument"}, robot=None)
def new(request: Request, *, file: Path) -> None:
    """Write a setup file to fill in.

    Example: `spirillum setup new setup.toml`
    """
    request(file)
    typer.echo(wrapped(f"{file}: fill in heights, their uncertainties and the robot; comments explain them"))


@setup_app.command("propose", cls=FunctionCommand)
@from_function("spirillum.measurement.proposal:propose_setup", robot=None)
def propose(
    request: Request,
    *,
    film: Path,
    robot: str | None = None,
    output: Path = Path("setup.toml"),
    json: Json = False,
) -> None:
    """Inspect a video and write a setup file: detected values are filled in, the rest is marked.

    Example: `spirillum setup propose trial-1.mp4 my-robot.toml --spacing 2mm -o setup.toml`
    """
    request.show(film, robot, output, json=json)


@setup_app.command("check", cls=NotedCommand)
@own_options
def check_setup(file: Path, film: Path | None = None, json: Json = False) -> None:
    """Check a setup file, the effect of its uncertain heights on lengths, and its agreement with a video.

    Example: `spirillum setup check setup.toml trial-1.mp4`
    """
    from spirillum.measurement.setup_template import setup_answer

    renderer.show(setup_answer(file, film), json=json)


observations_app = typer.Typer(name="observations", help="Files of observed speeds and rates.", no_args_is_help=True)


@observations_app.command("new", cls=NotedCommand)
@own_options
def new_observations(file: Path, *, force: bool = False) -> None:
    """Write an empty observations file to fill in.

    Example: `spirillum observations new observations.csv`
    """
    from spirillum.measurement.observations import new_observations_file

    new_observations_file(file, overwrite=force)
    typer.echo(wrapped(f"{file}: columns and their units are explained in its comments"))


@observations_app.command("check", cls=NotedCommand)
@own_options
def check_observations(file: Path, json: Json = False) -> None:
    """Check an observations file and count what is in it.

    Example: `spirillum observations check observations.csv`
    """
    from spirillum.measurement.observations import observations_answer

    renderer.show(observations_answer(file), json=json)


@observations_app.command("join", cls=NotedCommand)
@own_options
def join_observations(files: list[Path], output: Path) -> None:
    """Join several observations files, such as one of each robot, to one for `calibrate`.

    Example: `spirillum observations join measured/*/observations.csv -o all.csv`
    """
    from spirillum.measurement.observations import join_observations

    rows = join_observations(files, output)
    typer.echo(wrapped(f"{output}: {rows} rows of {len(files)} files"))
