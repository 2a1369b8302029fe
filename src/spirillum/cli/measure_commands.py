"""The command `spirillum measure`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from spirillum.cli.inputs import overrides_from, refuse_conflicts
from spirillum.cli.shared_options import Json, Settings

_FEASIBILITY = "Before an experiment"
_BY_HAND = "Instead of the tracker"
_Rate = typer.Option(metavar="RATE", help="Expected rate, such as 1.2Hz; else predicted.", rich_help_panel=_FEASIBILITY)


def measure(
    context: typer.Context,
    videos: Annotated[
        list[Path] | None, typer.Argument(metavar="VIDEO...", help="Films or folders of images, one a trial.")
    ] = None,
    setup: Annotated[Path | None, typer.Option(metavar="FILE", help="Setup file (TOML); see `setup new`.")] = None,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the results.")] = Path(
        "spirillum-measurement"
    ),
    marks: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Readings by hand (CSV); they replace the detections on their frames.",
            rich_help_panel=_BY_HAND,
        ),
    ] = None,
    no_tracking: Annotated[
        bool,
        typer.Option(
            "--no-tracking", help="Readings by hand alone; the video gives scale and times.", rich_help_panel=_BY_HAND
        ),
    ] = False,
    track: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Positions in pixels from trackpy, DeepLabCut or Tracker (CSV).",
            rich_help_panel=_BY_HAND,
        ),
    ] = None,
    no_annotated: Annotated[bool, typer.Option("--no-annotated", help="Write no annotated video.")] = False,
    no_figures: Annotated[bool, typer.Option("--no-figures", help="Draw no figures and write no report.")] = False,
    start: Annotated[
        str | None, typer.Option(metavar="TIME", help="Time in the video from which on to measure, such as 2s.")
    ] = None,
    end: Annotated[str | None, typer.Option(metavar="TIME", help="Time until which to measure.")] = None,
    feasibility: Annotated[
        bool,
        typer.Option(
            "--feasibility", help="Does the camera of --setup resolve the expected rates?", rich_help_panel=_FEASIBILITY
        ),
    ] = False,
    expect_tail_rate: Annotated[str | None, _Rate] = None,
    expect_body_rate: Annotated[str | None, _Rate] = None,
    expect_speed: Annotated[
        str | None,
        typer.Option(
            metavar="VELOCITY", help="Expected speed, such as 1mm/s; else predicted.", rich_help_panel=_FEASIBILITY
        ),
    ] = None,
    duration: Annotated[
        str | None, typer.Option(metavar="TIME", help="Length of a trial; else 20s.", rich_help_panel=_FEASIBILITY)
    ] = None,
    fps: Annotated[
        float | None, typer.Option(help="Frames a second; else the setup's, or 30.", rich_help_panel=_FEASIBILITY)
    ] = None,
    view_width: Annotated[
        str | None,
        typer.Option(metavar="LENGTH", help="Width of the view at the robot's axis.", rich_help_panel=_FEASIBILITY),
    ] = None,
    width: Annotated[
        int | None, typer.Option(help="Width of the picture, pixels; else 640.", rich_help_panel=_FEASIBILITY)
    ] = None,
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Measure speed and rotation rates in videos, each a trial, with 95 % intervals.

    Example: `spirillum measure trial-1.mp4 trial-2.mp4 --setup setup.toml -o measured`
    """
    from spirillum.cli import renderer
    from spirillum.errors import InputError

    if setup is None:
        raise InputError("--setup is missing; allowed: a setup file, see `spirillum setup new`")
    overrides = overrides_from(settings)
    refuse_conflicts(context, "feasibility" if feasibility else "no feasibility")
    if feasibility:
        from spirillum.measurement.feasibility import feasibility as verdict

        if videos and len(videos) > 1:
            raise InputError(f"--feasibility with {len(videos)} videos; allowed: none, or one that shows the ruler")
        found = verdict(
            setup,
            tail_rate=expect_tail_rate,
            body_rate=expect_body_rate,
            speed=expect_speed,
            duration=duration,
            frames_per_second=fps,
            view_width=view_width,
            picture_width=width,
            video=videos[0] if videos else None,
            overrides=overrides,
        )
        renderer.show(found.to_dict(), json=json)
        if not found.feasible:
            raise typer.Exit(1)
        return
    from spirillum.measurement.trials import RATE_NAMES
    from spirillum.results.measurement import measure as answer

    with renderer.progress_bar(quiet=json) as progress:
        result = answer(
            videos or [],
            setup,
            output,
            marks=marks,
            track=track,
            tracking=not no_tracking,
            annotated=not no_annotated,
            figures=not no_figures,
            start=_time("start", start),
            end=_time("end", end),
            overrides=overrides,
            progress=progress,
        )
    renderer.show(result.to_dict(), json=json)
    if result.failures:
        video, sentence = result.failures[0]
        more = "" if len(result.failures) == 1 else f" (and {len(result.failures) - 1} more)"
        where = "" if Path(video).name in sentence else f"{video}: "
        raise InputError(f"{where}{sentence}{more}")
    values = [trial.quantities[name].value for trial in result.trials for name in RATE_NAMES]
    if values and not any(math.isfinite(value) for value in values):
        trial = result.trials[0]
        raise InputError(f"{trial.video}: no rate could be given: {trial.quantities['forward_velocity'].reason}")


def _time(name: str, value: str | None) -> float | None:
    from spirillum.units import KINDS, parse_option

    return None if value is None else parse_option(name, value, KINDS["time"])
