"""The commands of the virtual camera: `spirillum render` and `spirillum virtual-experiment`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from spirillum.cli.inputs import loaded_robot
from spirillum.cli.shared_options import (
    MODEL_PANEL,
    Friction,
    Json,
    Settings,
    TailRate,
    complete_auto_models,
    complete_robots,
    starting,
)
from spirillum.errors import InputError

if TYPE_CHECKING:
    from spirillum.robot.arguments import Options
    from spirillum.robot.robot import Robot


def _complete_presets(incomplete: str) -> list[str]:
    return starting(("clean", "degraded"), incomplete)


def _complete_views(incomplete: str) -> list[str]:
    return starting(("side", "top"), incomplete)


def _complete_directions(incomplete: str) -> list[str]:
    return starting(("left", "right"), incomplete)


_CAMERA = "Camera"
_DISTURBED = "Disturbances"
_MOTION = "Motion"
_ERRORS = "Errors of the setup file"

_View = Annotated[
    str, typer.Option(autocompletion=_complete_views, help="Camera: top, or side (level).", rich_help_panel=_CAMERA)
]
_Direction = Annotated[
    str,
    typer.Option(
        autocompletion=_complete_directions,
        help="Where the nose points in the picture: right or left.",
        rich_help_panel=_CAMERA,
    ),
]
_Fps = Annotated[float, typer.Option(help="Frames a second.", rich_help_panel=_CAMERA)]
_Size = Annotated[
    str, typer.Option(metavar="WIDTHxHEIGHT", help="Pixels of the picture, even numbers.", rich_help_panel=_CAMERA)
]
_Seed = Annotated[
    int,
    typer.Option(
        help="Of what is random: noise, drift, lost frames, tilt, glare. A clean film has nothing random.",
        rich_help_panel=_DISTURBED,
    ),
]
_Preset = Annotated[
    str,
    typer.Option(
        "--preset",
        autocompletion=_complete_presets,
        help="clean, or degraded: all disturbances but bubbles and hand.",
        rich_help_panel=_DISTURBED,
    ),
]
_Noise = Annotated[
    float | None, typer.Option(help="Standard deviation of noise, in steps of 255.", rich_help_panel=_DISTURBED)
]
_Lamp = Annotated[
    float | None,
    typer.Option(help="Share by which the lamp's brightness drifts, such as 0.2.", rich_help_panel=_DISTURBED),
]
_Crf = Annotated[
    int | None,
    typer.Option(
        help="Compression of a video (H.264): 0, none lost, to 51; clean 18, degraded 33. PNG files lose none.",
        rich_help_panel=_DISTURBED,
    ),
]
_Model = Annotated[
    str,
    typer.Option(
        autocompletion=complete_auto_models,
        help="Hydrodynamic model: sbt, rft, slender, tube; or auto: tube where the robot has a table of its tube (see "
        "`prepare`), else slender.",
        rich_help_panel=MODEL_PANEL,
    ),
]
_Dropped = Annotated[
    float | None, typer.Option(help="Share of frames that are lost, such as 0.05.", rich_help_panel=_DISTURBED)
]
_Tilt = Annotated[
    str | None,
    typer.Option(metavar="ANGLE", help="Tilt of the camera in a random direction.", rich_help_panel=_DISTURBED),
]
_Glare = Annotated[
    float | None,
    typer.Option(help="Share of the body's picture under a spot of glare, such as 0.2.", rich_help_panel=_DISTURBED),
]
_Fixed = Annotated[
    bool,
    typer.Option(
        "--glare-fixed", help="The glare stands still instead of moving with the body.", rich_help_panel=_DISTURBED
    ),
]
_Bubbles = Annotated[
    int | None, typer.Option(help="Number of bubbles that drift over the robot.", rich_help_panel=_DISTURBED)
]
_Hand = Annotated[
    bool, typer.Option("--hand", help="The shadow of a hand passes over the picture.", rich_help_panel=_DISTURBED)
]

_Trouble = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME,...",
        help="Of a real bench: lost-frames, clock-jump, handheld, rolled, uneven-stripes, blurred, cables, "
        "mirrored-lamps, grid-paper, glass-cover, noise, lamp, compression, missing-frames, tilted, glare, "
        "standing-glare, bubbles, hand; with commas between them, or repeated.",
        rich_help_panel=_DISTURBED,
    ),
]


def render(
    robot: Annotated[
        str | None,
        typer.Argument(autocompletion=complete_robots, help="A preset's name or a TOML file; else that of --run."),
    ] = None,
    *,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FILE", help="The video (.mp4), or a new folder of PNG files.")
    ],
    model: _Model = "auto",
    tail_rate: TailRate = None,
    friction: Friction = None,
    forward_velocity: Annotated[
        str | None,
        typer.Option(metavar="VELOCITY", help="Instead of the model's, such as 1mm/s.", rich_help_panel=_MOTION),
    ] = None,
    body_rate: Annotated[
        str | None,
        typer.Option(
            metavar="RATE", help="Lab rotation rate of the body instead of the model's.", rich_help_panel=_MOTION
        ),
    ] = None,
    run: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="A run of `spirillum simulate` instead of steady swimming.", rich_help_panel=_MOTION
        ),
    ] = None,
    duration: Annotated[
        str | None, typer.Option(metavar="TIME", help="Length of the video; else 20 s, or that of the run.")
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH", help="x of the body at the first frame; else its way is centred.", rich_help_panel=_MOTION
        ),
    ] = None,
    lateral: Annotated[
        str, typer.Option(metavar="LENGTH", help="Horizontal offset across the channel.", rich_help_panel=_MOTION)
    ] = "0mm",
    heading: Annotated[
        str, typer.Option(metavar="ANGLE", help="Angle of the robot's axis to the channel.", rich_help_panel=_MOTION)
    ] = "0deg",
    wobble: Annotated[
        str,
        typer.Option(
            metavar="LENGTH", help="Amplitude of a motion across, at the tail's rate.", rich_help_panel=_MOTION
        ),
    ] = "0mm",
    body_angle: Annotated[
        str, typer.Option(metavar="ANGLE", help="Of the body at the first frame.", rich_help_panel=_MOTION)
    ] = "0deg",
    tail_phase: Annotated[
        str, typer.Option(metavar="ANGLE", help="Of the tail at the first frame.", rich_help_panel=_MOTION)
    ] = "0deg",
    gap: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH",
            help="Between body and tube, of picture and motion; else that of the reference place of tube.",
            rich_help_panel=_MOTION,
        ),
    ] = None,
    view: _View = "top",
    direction: _Direction = "right",
    fps: _Fps = 30.0,
    size: _Size = "640x480",
    exposure: Annotated[
        str, typer.Option(metavar="TIME", help="Of each frame; else 1/120 s.", rich_help_panel=_CAMERA)
    ] = "8.3333333ms",
    field_of_view: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH",
            help="Width of the picture, 1mm to 1m, such as 5mm of a microscope; else 166.8 mm.",
            rich_help_panel=_CAMERA,
        ),
    ] = None,
    distortion: Annotated[
        float, typer.Option(help="Coefficient k1 of the lens's radial distortion.", rich_help_panel=_CAMERA)
    ] = -0.02,
    preset: _Preset = "clean",
    noise: _Noise = None,
    lamp_drift: _Lamp = None,
    crf: _Crf = None,
    dropped: _Dropped = None,
    tilt: _Tilt = None,
    glare: _Glare = None,
    glare_fixed: _Fixed = False,
    bubbles: _Bubbles = None,
    hand: _Hand = False,
    trouble: _Trouble = None,
    seed: _Seed = 0,
    depth_error: Annotated[
        str,
        typer.Option(
            metavar="LENGTH",
            help="By which the setup's height of the axis is wrong, on purpose.",
            rich_help_panel=_ERRORS,
        ),
    ] = "0mm",
    depth_uncertainty: Annotated[
        str,
        typer.Option(
            metavar="LENGTH", help="Standard uncertainty of that height that the setup states.", rich_help_panel=_ERRORS
        ),
    ] = "0mm",
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Film a robot with a virtual laboratory camera, to try `measure` before the experiment. Needs the extra `video`.

    The video is synthetic, and its truth is written beside it. For a film to show to people, see `film`.

    Example: `spirillum render biorob2012-wide -o trial.mp4 --tail-rate 1.2Hz --duration 20s`
    """
    given = locals()
    from spirillum.cli import renderer
    from spirillum.virtual.trial import render as answer
    from spirillum.virtual.trial_options import CameraOptions, MotionOptions, SetupErrors, TrialOptions

    with renderer.progress_bar(quiet=json) as progress:
        found = answer(
            _robot(robot, settings),
            output,
            motion=_fields(MotionOptions, given),
            run=run,
            trial=_fields(TrialOptions, given),
            camera=_fields(CameraOptions, given),
            degradation=_degradation(given),
            setup_errors=_fields(SetupErrors, given),
            troubles=None if trouble is None else ",".join(trouble),
            seed=seed,
            progress=progress,
        )
    renderer.show(found.to_dict(), json=json)


def _robot(robot: str | None, settings: list[str] | None) -> Robot | None:
    """The robot with its fields set; None, for that of a run, where none is named."""
    if robot is not None:
        return loaded_robot(robot, settings)
    if settings:
        raise InputError(f"set = {settings[0]} without a robot; allowed: with a preset's name or a robot file")
    return None


def _fields(options: type[Options], given: Mapping[str, Any]) -> dict[str, Any]:
    """The options of a command that are fields of a table; they have the same names."""
    return {name: given[name] for name in options.model_fields if name in given}


def _degradation(given: Mapping[str, Any]) -> dict[str, Any]:
    """A preset, and the fields that replace its own; a switch that is off replaces none."""
    from spirillum.virtual.artifacts import Degradation

    moves = False if given["glare_fixed"] else None
    hand = given["hand"] or None
    return _fields(Degradation, given) | {"preset": given["preset"], "glare_moves": moves, "hand": hand}


def virtual_experiment(
    study: Annotated[
        Path | None, typer.Argument(help="Study file (see `spirillum schema study`); else the paper's two presets.")
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the videos.")] = Path(
        "spirillum-virtual-experiment"
    ),
    trials: Annotated[int, typer.Option(help="Trials of each robot.")] = 5,
    model: Annotated[
        str | None, typer.Option(help="Hydrodynamic model; else the study's first, or that of predict.")
    ] = None,
    friction: Friction = None,
    tail_rate: TailRate = None,
    spread: Annotated[
        float, typer.Option(help="Planted relative standard deviation of the motor's rate from trial to trial.")
    ] = 0.02,
    duration: Annotated[
        str | None, typer.Option(metavar="TIME", help="Of each trial; else as long as it is in view, at most 20 s.")
    ] = None,
    view: _View = "top",
    direction: _Direction = "right",
    fps: _Fps = 30.0,
    size: _Size = "640x480",
    preset: _Preset = "clean",
    noise: _Noise = None,
    lamp_drift: _Lamp = None,
    crf: _Crf = None,
    dropped: _Dropped = None,
    tilt: _Tilt = None,
    glare: _Glare = None,
    glare_fixed: _Fixed = False,
    bubbles: _Bubbles = None,
    hand: _Hand = False,
    seed: _Seed = 0,
    jobs: Annotated[int, typer.Option(help="Trials that are rendered at the same time.")] = 1,
    json: Json = False,
) -> None:
    """Film five trials of each robot of a study with that camera, with their truth: synthetic. A rerun resumes.

    Example: `spirillum virtual-experiment -o experiment --tail-rate 1.2Hz`
    """
    given = locals()
    from spirillum.cli import renderer
    from spirillum.virtual.experiment import virtual_experiment as answer
    from spirillum.virtual.trial_options import CameraOptions, MotionOptions

    with renderer.progress_bar(quiet=json) as progress:
        found = answer(
            study,
            output,
            trials=trials,
            motion=_fields(MotionOptions, given),
            spread=spread,
            duration=duration,
            camera=_fields(CameraOptions, given),
            degradation=_degradation(given),
            seed=seed,
            jobs=jobs,
            progress=progress,
        )
    renderer.show(found.to_dict(), json=json)
