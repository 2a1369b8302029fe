"""The command `spirillum measure`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from spirillum.cli.function_command import Request, from_function
from spirillum.cli.inputs import overrides_from, refuse_conflicts
from spirillum.cli.shared_options import PANELS, Json, Settings


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
    videos: Annotated[
        list[Path] | None, typer.Argument(metavar="VIDEO...", help="Videos or folders of images, one a trial.")
    ] = None,
    setup: Annotated[Path | None, typer.Option(metavar="FILE", help="Setup file (TOML); see `setup new`.")] = None,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the results.")] = Path(
        "spirillum-measurement"
    ),
    feasibility: Annotated[
        bool,
        typer.Option(
            "--feasibility",
            help="Does the camera of --setup resolve the expected rates?",
            rich_help_panel=PANELS["feasibility."],
        ),
    ] = False,
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
    expected = request.take("feasibility")
    if feasibility:
        from spirillum.measurement.feasibility import feasibility as verdict

        if videos and len(videos) > 1:
            raise InputError(f"--feasibility with {len(videos)} videos; allowed: none, or one that shows the ruler")
        found = verdict(
            setup,
            **expected,
            video=videos[0] if videos else None,
            overrides=overrides,
        )
        renderer.show(found.to_dict(), json=json)
        if not found.feasible:
            raise typer.Exit(1)
        return
    from spirillum.measurement.trials import RATE_NAMES

    with renderer.progress_bar(quiet=json) as progress:
        result = request(videos or [], setup, output, overrides=overrides, progress=progress)
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
