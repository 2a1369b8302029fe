"""The commands of the virtual camera: `spirillum render` and `spirillum virtual-experiment`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spirillum.cli.function_command import Request, from_function
from spirillum.cli.shared_options import DISTURBANCES_PANEL, Json, optional_robot, starting


def _complete_presets(incomplete: str) -> list[str]:
    return starting(("clean", "degraded"), incomplete)


_Preset = Annotated[
    str,
    typer.Option(
        "--preset",
        autocompletion=_complete_presets,
        help="clean, or degraded: all disturbances but bubbles and hand.",
        rich_help_panel=DISTURBANCES_PANEL,
    ),
]
_Trouble = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME,...",
        help="Artifacts of a recording: lost-frames, clock-jump, handheld, rolled, uneven-stripes, blurred, cables, "
        "mirrored-lamps, grid-paper, glass-cover, noise, lamp, compression, missing-frames, tilted, glare, "
        "standing-glare, bubbles, hand; with commas between them, or repeated.",
        rich_help_panel=DISTURBANCES_PANEL,
    ),
]


@from_function(
    "spirillum.virtual.trial:render",
    without={"path": "-o FILE", "setup": "it is written beside the video", "troubles.": "--trouble, by name"},
    robot=optional_robot("A preset's name or a TOML file; else that of --run."),
)
def render(
    request: Request,
    *,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The video (.mp4), or a new folder of PNG files.")
    ],
    preset: _Preset = "clean",
    trouble: _Trouble = None,
    json: Json = False,
) -> None:
    """Film a robot with a virtual laboratory camera, to try `measure` before the experiment. Needs the extra `video`.

    The video is synthetic, and its truth is written beside it. For a film to show to people, see `film`.

    Example: `spirillum render biorob2012-wide -o trial.mp4 --tail-rate 1.2Hz --duration 20s`
    """
    from spirillum.cli import renderer

    request.typed["degradation.preset"] = preset
    with renderer.progress_bar(quiet=json) as progress:
        found = request(output, troubles=None if trouble is None else ",".join(trouble), progress=progress)
    renderer.show(found.to_dict(), json=json)


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
    study: Annotated[
        Path | None, typer.Argument(help="Study file (see `spirillum schema study`); else the paper's two presets.")
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the videos.")] = Path(
        "spirillum-virtual-experiment"
    ),
    preset: _Preset = "clean",
    json: Json = False,
) -> None:
    """Film five trials of each robot of a study with that camera, with their truth: synthetic. A rerun resumes.

    Example: `spirillum virtual-experiment -o experiment --tail-rate 1.2Hz`
    """
    from spirillum.cli import renderer

    request.typed["degradation.preset"] = preset
    with renderer.progress_bar(quiet=json) as progress:
        found = request(study, output, progress=progress)
    renderer.show(found.to_dict(), json=json)
