"""The commands of robots and files: `robot new|show|check`, `prepare`, `export` and `validate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spirillum.cli import renderer
from spirillum.cli.function_command import Request, from_function, own_options
from spirillum.cli.inputs import loaded_robot, overrides_from, refuse_conflicts
from spirillum.cli.shared_options import (
    Json,
    NotedCommand,
    RobotArgument,
    Settings,
    choices,
    complete_robots,
    starting,
)
from spirillum.cli.wrapping import wrapped
from spirillum.errors import InputError

robot_app = typer.Typer(no_args_is_help=True, help="Make, show and check robot files.", rich_markup_mode="markdown")


@robot_app.command("new", cls=NotedCommand)
@own_options
def robot_new(path: Path, *, preset: str = "biorob2012-wide", force: bool = False) -> None:
    """Write a robot file to edit, with every field of a preset.

    Example: `spirillum robot new my-robot.toml --from biorob2012-wide`
    """
    from spirillum.robot.load import new_robot_file

    new_robot_file(path, preset, overwrite=force)
    typer.echo(wrapped(f"{path} written; see what follows from it with: spirillum robot show {path}"))


@robot_app.command("show", cls=NotedCommand)
def robot_show(robot: RobotArgument, settings: Settings = None, json: Json = False) -> None:
    """Show a robot's fields and what follows from them: arc length, volumes, weight.

    Example: `spirillum robot show biorob2012-narrow`
    """
    from spirillum.envelope import with_notes_last
    from spirillum.robot.load import inherited, robot_answer

    loaded = loaded_robot(robot, settings)
    own = inherited(robot, overrides_from(settings), loaded)
    renderer.show(with_notes_last(robot_answer(loaded), **own), json=json)


@robot_app.command("check", cls=NotedCommand)
def robot_check(robot: RobotArgument, settings: Settings = None, json: Json = False) -> None:
    """Check a robot file and list every problem at once; exit code 1 if there is one.

    Example: `spirillum robot check biorob2012-wide`
    """
    from spirillum.envelope import envelope
    from spirillum.robot.load import checked, inherited
    from spirillum.swimming.preparation import models_without_answer

    problems, warnings = checked(robot, overrides_from(settings))
    content = {"robot": robot, "valid": not problems, "problems": list(problems)}
    if not problems:
        loaded = loaded_robot(robot, settings)
        content |= inherited(robot, overrides_from(settings), loaded)
        warnings = (*warnings, *models_without_answer(loaded))
    renderer.show(envelope("check", content, warnings), json=json)
    if problems:
        raise typer.Exit(1)


def prepare(
    robots: list[str] | None = None,
    study: str | None = None,
    stage: str | None = None,
    *,
    fine: bool = False,
    workers: int = 2,
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Make the tables of robots in their tubes; then `predict`, `simulate` and `study` answer with walls at once.

    Robots that differ in their tails share most of the work. An interrupted preparation goes on where it was.

    Example: `spirillum prepare biorob2012-wide`
    """
    from spirillum.papers.studies import study_of
    from spirillum.studies.study_loader import load_study
    from spirillum.swimming.preparation import preparations_answer, prepare_all

    if not robots and study is None:
        raise InputError("no robot; allowed: a preset's name or a robot file, several of them, or --study FILE")
    if fine and stage is not None:
        raise InputError("--fine and --stage are mutually exclusive; allowed: one of them")
    requested = [loaded_robot(robot, settings) for robot in robots or []]
    if study is not None:
        loaded = load_study(study_of(study), overrides_from(settings))
        requested += [loaded.robot_at(index) for index in range(loaded.count)]
    with renderer.progress_bar(quiet=json) as progress:
        found = prepare_all(
            requested, stage="fine" if fine else "yaw" if stage is None else stage, workers=workers, progress=progress
        )
    renderer.show(found[0].to_dict() if len(found) == 1 else preparations_answer(found), json=json)


@from_function(
    "spirillum.exports.write:export",
    without={
        "path": "an argument of the command",
        **dict.fromkeys(
            ("placement.eccentricity", "placement.yaw", "placement.tail_drop", "placement.ends"),
            "a unit is held at a gap and pitch, with a flow as its input",
        ),
    },
    complete={"unit": choices("m", "mm", "um")},
    robot=Annotated[
        str,
        typer.Argument(
            autocompletion=complete_robots, help="A preset's name or a TOML file; for .mcap a run of `simulate` (.nc)."
        ),
    ],
)
def export(
    request: Request,
    *,
    context: typer.Context,
    target: Path,
    sidecar: bool = False,
    no_sidecar: bool = False,
    film: Path | None = None,
    speed: float = 1.0,
    json: Json = False,
) -> None:
    """Write the robot for a printer, Blender, ParaView, MuJoCo, a simulator of robots or systems; a run for Foxglove.

    Example: `spirillum export biorob2012-wide robot.stl`
    """
    if target.suffix.lower() == ".mcap":
        from spirillum.exports.recording import export_run

        refuse_conflicts(context, "recording")
        renderer.show(export_run(str(request.named_robot), target, film=film, speed=speed).to_dict(), json=json)
        return
    if Path(str(request.named_robot)).suffix == ".nc":
        raise InputError(
            f"{request.named_robot} is a run, which has no shape to write as {target.suffix or 'a file'}; allowed: "
            ".mcap for a run, or a robot (preset or file) for the other formats"
        )
    refuse_conflicts(context, "no recording", ending=target.suffix or "no ending")
    if sidecar and no_sidecar:
        raise InputError("--sidecar with --no-sidecar; allowed: one of them")
    with renderer.at_work("making the files", quiet=json):
        found = request(target, sidecar=sidecar if sidecar or no_sidecar else None)
    renderer.show(found.to_dict(), json=json)


def complete_cases(incomplete: str) -> list[str]:
    """Names of validation cases."""
    cases = (Path(__file__).parent.parent / "papers").glob("*/case.toml")
    return starting(sorted(case.parent.name for case in cases), incomplete)


def validate(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="[NAME]...", autocompletion=complete_cases, help="Cases that ship; else all."),
    ] = None,
    *,
    runs: bool = False,
    output: Path | None = None,
    json: Json = False,
) -> None:
    """Compute published experiments of other groups, with nothing fitted; exit code 1 if a row left its recorded range.

    Example: `spirillum validate rodenborn2013`
    """
    from spirillum.results.validation import validate as answer

    with renderer.progress_bar(quiet=json) as progress:
        found = answer(names or (), runs=runs, output=output, progress=progress)
    renderer.show(found.to_dict(), json=json)
    if found.outside:
        raise typer.Exit(1)
