"""The commands of motion in time: `spirillum simulate` and `spirillum magnetic-sweep`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from spirillum.cli.inputs import loaded_robot, placement_from, time_window
from spirillum.cli.shared_options import (
    Accuracy,
    Calibration,
    Friction,
    Json,
    NoCalibration,
    Output,
    Posterior,
    RobotArgument,
    Settings,
    complete_auto_models,
    complete_models,
)
from spirillum.notes import note_attributes, notes_in

if TYPE_CHECKING:
    import xarray as xr

_START = "Start of a free run, and its tube"
_TIMING = "Timing and remote"
_PICTURES = "Pictures"

_FullModel = Annotated[
    str,
    typer.Option(
        autocompletion=complete_auto_models,
        help="Hydrodynamic model: rft, slender, tube, held also sbt; or auto: that of the posterior or calibration, "
        "else tube in a channel (free: where the robot has a table, see `prepare`) and slender without.",
    ),
]
_RunMotion = Annotated[
    str | None,
    typer.Option(
        help="free (lateral motion and tilt released) or held; else free, but held with a calibration of sbt, or of a "
        "place in the tube without dry friction."
    ),
]


def simulate(
    robot: RobotArgument,
    output: Output,
    model: _FullModel = "auto",
    motion: _RunMotion = None,
    friction: Friction = None,
    turns: Annotated[
        float | None,
        typer.Option(help="Length of the run in turns of the tail (of the field); else 3.", rich_help_panel=_TIMING),
    ] = None,
    duration: Annotated[
        str | None,
        typer.Option(metavar="TIME", help="Length of the run in time instead, such as 2s.", rich_help_panel=_TIMING),
    ] = None,
    on: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FROM:TO",
            help="When the remote switches the drive on, such as 0s:2s; repeatable.",
            rich_help_panel=_TIMING,
        ),
    ] = None,
    duty: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Duty over time instead: CSV with the columns time_s, duty.", rich_help_panel=_TIMING
        ),
    ] = None,
    gap: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH",
            help="Smallest distance of body and wall, free at the start, or where tube holds it; else 1/18 of its "
            "radius.",
            rich_help_panel=_START,
        ),
    ] = None,
    eccentricity: Annotated[
        float | None,
        typer.Option(help="Instead of --gap: the body's offset towards the floor over R - a.", rich_help_panel=_START),
    ] = None,
    pitch: Annotated[
        str | None,
        typer.Option(
            metavar="ANGLE",
            help="Angle by which the nose is raised, free at the start, or where tube holds it.",
            rich_help_panel=_START,
        ),
    ] = None,
    no_weight: Annotated[
        bool, typer.Option("--no-weight", help="Free: leave weight and buoyancy out.", rich_help_panel=_START)
    ] = False,
    roughness: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH", help="Free: roughness under the robot, else 1e-4 of its radius.", rich_help_panel=_START
        ),
    ] = None,
    yaw: Annotated[
        str | None,
        typer.Option(metavar="ANGLE", help="Free, tube: angle of the nose to +y at the start.", rich_help_panel=_START),
    ] = None,
    azimuth: Annotated[
        str | None,
        typer.Option(
            metavar="ANGLE",
            help="Free, tube: azimuth of the body's centre about +x from the lowest place.",
            rich_help_panel=_START,
        ),
    ] = None,
    ends: Annotated[
        str | None, typer.Option(help="Free, tube: ends of the channel, open or closed.", rich_help_panel=_START)
    ] = None,
    flow: Annotated[
        str | None,
        typer.Option(
            metavar="VELOCITY|FILE",
            help="Free, tube: imposed mean flow, such as 1mm/s, or over time: CSV with the columns time_s, flow_mm_s.",
            rich_help_panel=_START,
        ),
    ] = None,
    friction_coefficient: Annotated[
        float | None,
        typer.Option(
            help="Free, tube: coefficient of dry friction where asperities touch; else 0.1.", rich_help_panel=_START
        ),
    ] = None,
    wait: Annotated[
        str | None,
        typer.Option(metavar="TIME", help="Free, tube: lie with the motor off before the run.", rich_help_panel=_START),
    ] = None,
    continued: Annotated[
        Path | None,
        typer.Option(
            "--continue",
            metavar="FILE",
            help="Free, tube: a run that ended early or was interrupted; what comes behind it is written.",
            rich_help_panel=_START,
        ),
    ] = None,
    field_yaw: Annotated[
        str | None,
        typer.Option(
            metavar="ANGLE",
            help="Free, magnetic: angle to +y of the axis about which the field turns, up to 45deg; else along +x.",
            rich_help_panel=_START,
        ),
    ] = None,
    field_pitch: Annotated[
        str | None,
        typer.Option(metavar="ANGLE", help="Free, magnetic: angle of that axis upwards.", rich_help_panel=_START),
    ] = None,
    samples_per_turn: Annotated[
        int, typer.Option(help="Samples of the output per steady turn of the tail.", rich_help_panel=_TIMING)
    ] = 100,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Draw the run too: .png, .pdf or .svg.", rich_help_panel=_PICTURES),
    ] = None,
    column: Annotated[
        str | None,
        typer.Option(
            help="With --plot: its width, single or double, as the columns of a page; else double.",
            rich_help_panel=_PICTURES,
        ),
    ] = None,
    movie: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Film the run too: .mp4 or .gif (extra `3d`; see `film`).", rich_help_panel=_PICTURES
        ),
    ] = None,
    no_calibration: NoCalibration = False,
    calibration: Calibration = None,
    posterior: Posterior = None,
    draws: Annotated[
        int | None,
        typer.Option(help="With --posterior: draws that are run for the intervals of the means, 20 to 1000; else 100."),
    ] = None,
    accuracy: Accuracy = None,
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Simulate swimming from rest: six degrees of freedom, weight, floor, motor and remote; or two (`--motion held`).

    Example: `spirillum simulate biorob2012-wide -o run.nc --duration 4s --on 0s:1s --on 2s:3s`
    """
    from spirillum.cli import renderer
    from spirillum.dynamics.integration import INTERRUPTED
    from spirillum.dynamics.run_summary import run_answer
    from spirillum.dynamics.simulation import simulate as answer
    from spirillum.errors import InputError
    from spirillum.files import PICTURES, guard_inputs, netcdf_target, output_target, write_dataset

    over_time = flow is not None and (flow.lower().endswith(".csv") or Path(flow).is_file())
    with guard_inputs(continued, posterior, calibration, duty, flow if over_time else None):
        target = netcdf_target(output)
        picture = None if plot is None else output_target(plot, PICTURES, "run.png")
    width = column or "double"
    if picture is not None:
        from spirillum.view.figures.trajectory import check_column

        check_column(width)
    elif column is not None:
        raise InputError(f"column = {column[:40]!r} without a plot, whose width it is; allowed: with --plot")
    if movie is not None:
        check_movie(movie)
    loaded = loaded_robot(robot, settings, calibration, posterior)
    with renderer.progress_bar(quiet=json) as progress:
        dataset = answer(
            loaded,
            model=model,
            motion=motion,
            friction=friction,
            timing={
                "turns": turns,
                "duration": duration,
                "samples_per_turn": samples_per_turn,
                "on": [time_window(window) for window in on] if on else None,
                "duty": duty,
            },
            calibrated=not no_calibration,
            calibration=calibration,
            posterior=posterior,
            draws=draws,
            resolution={"accuracy": accuracy},
            placement=placement_from(gap, eccentricity, pitch, None, ends, None if over_time else flow, yaw),
            weight=not no_weight,
            roughness=roughness,
            in_tube={
                "azimuth": azimuth,
                "wait": wait,
                "friction_coefficient": friction_coefficient,
                "flow": flow if over_time else None,
                "continued": continued,
            },
            field={"yaw": field_yaw, "pitch": field_pitch},
            progress=progress,
        )
        write_dataset(dataset, target)
        files, warnings = _drawn(dataset, picture, width, movie, progress)
    found = run_answer(dataset.assign_attrs(note_attributes([*notes_in(dataset.attrs), *warnings])))
    renderer.show(renderer.with_files(found, file=str(output), **files), json=json)
    if any(event["what"] == INTERRUPTED for event in found["events"]):
        raise KeyboardInterrupt


def check_movie(movie: Path) -> None:
    """Refuse a film that cannot be written before anything is computed."""
    from spirillum.files import output_target
    from spirillum.optional_dependencies import import_optional
    from spirillum.view.scene3d.rendering import FILMS

    output_target(movie, FILMS, "run.mp4")
    for package in ("pyvista", "av"):
        import_optional(package, "a film")


def _drawn(
    dataset: xr.Dataset, picture: Path | None, column: str, movie: Path | None, progress: Any
) -> tuple[dict[str, str], list[str]]:
    """Draw and film a run; the files by what they are, and the film's warnings."""
    files: dict[str, str] = {}
    warnings: list[str] = []
    if picture is not None:
        from spirillum.view.figures.style import save_as
        from spirillum.view.figures.trajectory import trajectory_figure

        with _after_the_run("plot"):
            save_as(trajectory_figure(dataset, column), picture)
        files["plot"] = str(picture)
    if movie is not None:
        from spirillum.view.scene3d.film import film

        with _after_the_run("film"):
            warnings += film(dataset, movie, progress=progress).warnings
        files["movie"] = str(movie)
    return files, warnings


@contextmanager
def _after_the_run(what: str) -> Iterator[None]:
    """Say of what cannot be drawn that the run itself is not lost."""
    from spirillum.errors import InputError

    try:
        yield
    except InputError as error:
        raise InputError(f"the run is written, the {what} is not: {error}") from error


def magnetic_sweep(
    robot: RobotArgument,
    output: Output,
    rate: Annotated[
        list[str] | None,
        typer.Option(metavar="RATE", help="Rate of the field, such as 2Hz; repeatable, increasing; else 40 of them."),
    ] = None,
    model: Annotated[
        str,
        typer.Option(autocompletion=complete_models, help="Hydrodynamic model: slender, as `predict` takes, or rft."),
    ] = "slender",
    turns: Annotated[
        float, typer.Option(help="Turns of the field in a stretch; the last of at most 25 is averaged.")
    ] = 30.0,
    plot: Annotated[Path | None, typer.Option(metavar="FILE", help="Draw it too: .png, .pdf or .svg.")] = None,
    accuracy: Accuracy = None,
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Sweep the rate of a rotating field: speed, phase lag, wobble and step-out of a free one-piece swimmer.

    Example: `spirillum magnetic-sweep magnetic-helix -o sweep.nc --plot sweep.png`
    """
    from spirillum.cli import renderer
    from spirillum.dynamics.magnetic_sweep import magnetic_sweep as answer
    from spirillum.dynamics.run_summary import sweep_answer
    from spirillum.files import PICTURES, netcdf_target, output_target, write_dataset

    target = netcdf_target(output)
    picture = None if plot is None else output_target(plot, PICTURES, "sweep.png")
    loaded = loaded_robot(robot, settings)
    with renderer.progress_bar(quiet=json) as progress:
        dataset = answer(loaded, rate, model=model, turns=turns, resolution={"accuracy": accuracy}, progress=progress)
    write_dataset(dataset, target)
    if picture is not None:
        from spirillum.view.figures.magnetic import magnetic_figure
        from spirillum.view.figures.style import save_as

        save_as(magnetic_figure(dataset), picture)
    files = {} if plot is None else {"plot": str(plot)}
    renderer.show(renderer.with_files(sweep_answer(dataset), file=str(output), **files), json=json)
