"""The commands `spirillum calibrate`, `rank-models` and `suggest`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from spirillum.calibration.methods import METHODS
from spirillum.cli.inputs import loaded_robot, overrides_from, refuse_conflicts
from spirillum.cli.shared_options import (
    MODEL_PANEL,
    Json,
    Settings,
    complete_answers,
    complete_auto_models,
    complete_models,
    complete_robots,
    starting,
)
from spirillum.errors import InputError
from spirillum.fluid.tube.progress_messages import TABLE_TAKES

if TYPE_CHECKING:
    from spirillum.calibration.ranking import Ranking
    from spirillum.calibration.suggest import Suggestion

_FittedAs = Annotated[
    str,
    typer.Option(
        "--as",
        autocompletion=complete_answers,
        help="What model tube is fitted as: held at a pose, or a trial, released in its tube as predict has it.",
    ),
]
_Observations = Annotated[Path, typer.Argument(help="Observations file (CSV or Parquet).")]
_Robots = Annotated[
    list[str],
    typer.Argument(autocompletion=complete_robots, help="A preset's name or a TOML file for each channel."),
]


def _complete_methods(incomplete: str) -> list[str]:
    return starting(METHODS, incomplete)


def calibrate(
    context: typer.Context,
    observations: _Observations,
    robot: _Robots,
    model: Annotated[
        str,
        typer.Option(
            autocompletion=complete_auto_models,
            help="Hydrodynamic model: sbt, rft, slender, tube; or auto: tube in a channel (--prepare makes missing "
            "tables), else sbt.",
            rich_help_panel=MODEL_PANEL,
        ),
    ] = "auto",
    free: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...",
            help="Free parameters; else those that the paper fitted with this model, with tube gap,friction.",
        ),
    ] = None,
    method: Annotated[
        str,
        typer.Option(autocompletion=_complete_methods, help="posterior, least-squares or paper (its own inversion)."),
    ] = "posterior",
    fitted_as: _FittedAs = "held",
    friction: Annotated[str, typer.Option(help="Friction model of B_eff in (18): rotor or paper.")] = "rotor",
    assume_uncertainty: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FIELD=SHARE",
            help="Uncertainty of fluid.viscosity, motor.torque_constant or motor.back_emf_constant: half of its "
            "relative 95 % interval, such as fluid.viscosity=5%; repeatable. Else taken as exact.",
        ),
    ] = None,
    prepare: Annotated[
        bool,
        typer.Option("--prepare", help=f"With tube, compute missing tables first, {TABLE_TAKES} each."),
    ] = False,
    output: Annotated[
        str, typer.Option("--output", "-o", metavar="DIR", help="Folder for the results.")
    ] = "spirillum-calibration",
    no_figures: Annotated[
        bool, typer.Option("--no-figures", help="Draw no figures, which takes some seconds.")
    ] = False,
    seed: Annotated[int, typer.Option(help="Seed of the sampler.")] = 1,
    doublings: Annotated[
        int, typer.Option(help="How often the length of the chains may be doubled, until they have mixed.")
    ] = 3,
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Fit parameters of a model to observed speeds and rates, with their uncertainty.

    Example: `spirillum calibrate observations.csv biorob2012-wide biorob2012-narrow -o my-calibration`
    """
    from spirillum.calibration.parameters import check_not_set
    from spirillum.calibration.posterior import Sampling
    from spirillum.cli import renderer
    from spirillum.fitted.replaced import set_fields
    from spirillum.results.calibration import calibrate as answer

    robots = [loaded_robot(name, settings) for name in robot]
    check_not_set(set_fields(overrides_from(settings)), free, model)
    if method in METHODS and method != "posterior":
        refuse_conflicts(context, "no posterior", method=method)
    with renderer.progress_bar(quiet=json) as progress:
        found = answer(
            observations,
            robots,
            output,
            model=model,
            free=free,
            method=method,
            friction=friction,
            assume_uncertainty=_stated(assume_uncertainty or ()),
            sampling=Sampling(seed=seed, doublings=doublings),
            prepare=prepare,
            answer=fitted_as,
            figures=not no_figures,
            progress=progress,
        )
    renderer.show(found.to_dict(), json=json)
    if not found.converged:
        raise typer.Exit(1)


def _stated(given: Sequence[str]) -> dict[str, str]:
    """Field to share of `--assume-uncertainty`."""
    found: dict[str, str] = {}
    for item in given:
        name, equals, share = item.partition("=")
        if not equals or name.strip() in found:
            raise InputError(f"assume-uncertainty = '{item[:60]}'; allowed: FIELD=SHARE, each field once")
        found[name.strip()] = share
    return found


_A = TypeVar("_A", "Ranking", "Suggestion")


def _saying_whose(found: _A, robot: Sequence[str] | None, settings: Sequence[str] | None) -> _A:
    """Refuse settings without a named robot, where the robots come from another file."""
    from spirillum.robot.load import PAPER_ROBOTS_TAKEN

    return found if robot or not settings else replace(found, warnings=(PAPER_ROBOTS_TAKEN, *found.warnings))


def rank_models(
    observations: _Observations,
    robot: Annotated[
        list[str] | None,
        typer.Argument(autocompletion=complete_robots, help="A robot for each channel; without, the paper's two."),
    ] = None,
    model: Annotated[
        list[str] | None,
        typer.Option(
            autocompletion=complete_models, help="sbt, rft, slender or tube; repeatable. Without it, sbt and rft."
        ),
    ] = None,
    free: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...", help="Free parameters of all; else body_drag,body_rotation, for tube gap,pitch."
        ),
    ] = None,
    prepare: Annotated[
        bool,
        typer.Option("--prepare", help=f"With tube, compute missing tables first, {TABLE_TAKES} each."),
    ] = False,
    fitted_as: _FittedAs = "held",
    seed: Annotated[int, typer.Option(help="Seed of the sampler.")] = 1,
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Rank models by cross-validation over the tails, with the tails where each fails.

    Example: `spirillum rank-models observations.csv --model sbt --model rft --model slender`
    """
    from spirillum.calibration.parameters import check_not_set
    from spirillum.calibration.posterior import Sampling
    from spirillum.calibration.ranking import free_by_model
    from spirillum.calibration.ranking import rank_models as answer
    from spirillum.cli import renderer
    from spirillum.fitted.replaced import set_fields
    from spirillum.robot.load import PAPER_ROBOTS

    fields = set_fields(overrides_from(settings))
    for name, fitted in free_by_model(model, free, fitted_as).items():
        check_not_set(fields, fitted, name)
    names = robot or (PAPER_ROBOTS if settings else ())
    with renderer.progress_bar(quiet=json) as progress:
        found = answer(
            observations,
            [loaded_robot(name, settings) for name in names] or None,
            models=model,
            free=free,
            sampling=Sampling(seed=seed),
            prepare=prepare,
            answer=fitted_as,
            progress=progress,
        )
    renderer.show(_saying_whose(found, robot, settings).to_dict(), json=json)
    if not all(item.fit.converged for item in found.ranked):
        raise typer.Exit(1)


def suggest(
    posterior: Annotated[Path, typer.Argument(help="Posterior of a calibration (posterior.nc).")],
    robot: Annotated[
        list[str] | None,
        typer.Argument(autocompletion=complete_robots, help="A robot for each channel; without, the paper's two."),
    ] = None,
    candidates: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Channels and tails to choose from (CSV); else a grid of tails.")
    ] = None,
    trials: Annotated[int, typer.Option(help="Trials of each candidate.")] = 5,
    rows: Annotated[int, typer.Option(help="Candidates in the table.")] = 10,
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Suggest which tail or channel to measure next: the expected information of each candidate.

    Example: `spirillum suggest my-calibration/posterior.nc --candidates tails.csv`
    """
    from spirillum.calibration.parameters import OBSERVED
    from spirillum.calibration.suggest import suggest as answer
    from spirillum.cli import renderer
    from spirillum.fitted.replaced import set_fields
    from spirillum.robot.load import PAPER_ROBOTS

    if rows < 1:
        raise InputError(f"rows = {rows}; allowed: at least 1")
    if own := [field for field in OBSERVED if field in set_fields(overrides_from(settings))]:
        raise InputError(f"{own[0]} is set, and every candidate has its own; allowed: other fields, or --candidates")
    names = robot or (PAPER_ROBOTS if settings else ())
    robots = [loaded_robot(name, settings, posterior=posterior) for name in names] or None
    found = _saying_whose(answer(posterior, robots, candidates=candidates, trials=trials), robot, settings)
    renderer.show(found.to_dict(), json=json, rows=rows)
