"""The commands about robot files: `spirillum robot new|show|check`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spirillum.cli.inputs import loaded_robot, overrides_from
from spirillum.cli.shared_options import Json, RobotArgument, Settings, complete_presets

robot_app = typer.Typer(no_args_is_help=True, help="Make, show and check robot files.", rich_markup_mode="markdown")


@robot_app.command("new")
def robot_new(
    path: Annotated[Path, typer.Argument(help="Robot file to write.")],
    preset: Annotated[
        str,
        typer.Option("--from", autocompletion=complete_presets, help="Preset or validation robot to start from."),
    ] = "biorob2012-wide",
    force: Annotated[bool, typer.Option("--force", help="Overwrite the file if it is there.")] = False,
) -> None:
    """Write a robot file to edit, with every field of a preset.

    Example: `spirillum robot new my-robot.toml --from biorob2012-wide`
    """
    from spirillum.robot.load import new_robot_file

    new_robot_file(path, preset, overwrite=force)
    typer.echo(f"{path} written; see what follows from it with: spirillum robot show {path}")


@robot_app.command("show")
def robot_show(robot: RobotArgument, settings: Settings = None, json: Json = False) -> None:
    """Show a robot's fields and what follows from them: arc length, volumes, weight.

    Example: `spirillum robot show biorob2012-narrow`
    """
    from spirillum.cli import renderer
    from spirillum.robot.robot_report import robot_answer

    renderer.show(robot_answer(loaded_robot(robot, settings)), json=json)


@robot_app.command("check")
def robot_check(robot: RobotArgument, settings: Settings = None, json: Json = False) -> None:
    """Check a robot file and list every problem at once; exit code 1 if there is one.

    Example: `spirillum robot check biorob2012-wide`
    """
    from spirillum.cli import renderer
    from spirillum.robot.robot_report import check_answer, checked
    from spirillum.swimming.model_choice import models_without_answer

    problems, warnings = checked(robot, overrides_from(settings))
    if not problems:
        warnings = (*warnings, *models_without_answer(loaded_robot(robot, settings)))
    renderer.show(check_answer(robot, problems, warnings), json=json)
    if problems:
        raise typer.Exit(1)
