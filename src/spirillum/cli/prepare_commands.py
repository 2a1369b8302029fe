"""The command `spirillum prepare`."""

from __future__ import annotations

from typing import Annotated

import typer

from spirillum.cli.inputs import loaded_robot, overrides_from
from spirillum.cli.shared_options import Json, Settings, complete_robots


def prepare(
    robots: Annotated[
        list[str] | None,
        typer.Argument(metavar="[ROBOT]...", autocompletion=complete_robots, help="Presets' names or TOML files."),
    ] = None,
    study: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="All robots of a study file; biorob2012 is the paper's study."),
    ] = None,
    stage: Annotated[
        str | None,
        typer.Option(
            help="straight (constrained motion), yaw (motion after release too; the default) or fine (for publication)."
        ),
    ] = None,
    fine: Annotated[bool, typer.Option("--fine", help="Short for --stage fine.")] = False,
    workers: Annotated[int, typer.Option(min=1, max=64, help="Number of processes.")] = 2,
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Make the tables of robots in their tubes; then `predict`, `simulate` and `study` answer with walls at once.

    Robots that differ in their tails share most of the work. An interrupted preparation goes on where it was.

    Example: `spirillum prepare biorob2012-wide`
    """
    from spirillum.cli import renderer
    from spirillum.errors import InputError
    from spirillum.papers.studies import study_of
    from spirillum.studies.study_loader import load_study
    from spirillum.swimming.preparation import preparations_answer, prepare_all

    if not robots and study is None:
        raise InputError("no robot; allowed: a preset's name or a robot file, several of them, or --study FILE")
    if fine and stage is not None:
        raise InputError("--fine and --stage are mutually exclusive; allowed: one of them")
    asked = [loaded_robot(robot, settings) for robot in robots or []]
    if study is not None:
        loaded = load_study(study_of(study), overrides_from(settings))
        asked += [loaded.robot_at(index) for index in range(loaded.count)]
    with renderer.progress_bar(quiet=json) as progress:
        found = prepare_all(asked, stage="fine" if fine else stage or "yaw", workers=workers, progress=progress)
    renderer.show(found[0].to_dict() if len(found) == 1 else preparations_answer(found), json=json)
