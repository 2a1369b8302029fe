"""The commands `calibrate`, `rank-models`, `suggest` and `design`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from spirillum.calibration.methods import METHODS
from spirillum.cli import renderer
from spirillum.cli.function_command import Request, from_function
from spirillum.cli.inputs import loaded_robot, overrides_from, pairs_of, refuse_conflicts
from spirillum.cli.shared_options import Json, Settings, choices, complete_robots
from spirillum.errors import InputError

if TYPE_CHECKING:
    from spirillum.calibration.ranking import Ranking
    from spirillum.calibration.suggest import Suggestion


_Robots = Annotated[
    list[str], typer.Argument(autocompletion=complete_robots, help="A preset's name or a TOML file for each channel.")
]


_SAMPLER = dict.fromkeys(
    (f"sampling.{name}" for name in ("ensembles", "walkers", "warm_up", "steps", "kept")), "of the sampler, in Python"
)
_SAMPLING = {"sampling": ("spirillum.calibration.posterior:Sampling",)}


@from_function(
    "spirillum.results.calibration:calibrate",
    without={**_SAMPLER, "robots": "the argument", "workers": "figures are drawn in two processes"},
    complete={"method": choices(*METHODS)},
    robot=None,
    tables=_SAMPLING,
)
def calibrate(
    request: Request,
    *,
    context: typer.Context,
    observations: Path,
    robot: _Robots,
    friction: str = "rotor",
    assume_uncertainty: list[str] | None = None,
    output: str = "spirillum-calibration",
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Fit parameters of a model to observed speeds and rates, with their uncertainty.

    Example: `spirillum calibrate observations.csv biorob2012-wide biorob2012-narrow -o my-calibration`
    """
    from spirillum.calibration.parameters import check_not_set
    from spirillum.calibration.posterior import Sampling
    from spirillum.kernels.native import processor_count
    from spirillum.robot.arguments import set_fields
    from spirillum.swimming.motions import RELEASED
    from spirillum.swimming.preparation import AUTO

    typed = request.typed
    if tables := [name for name in robot if name.endswith((".csv", ".parquet"))]:
        raise InputError(
            f"{tables[0]} is a second observations file; allowed: one, which `spirillum observations join` makes"
        )
    robots = [loaded_robot(name, settings) for name in robot]
    released = typed.get("answer") == RELEASED
    check_not_set(set_fields(overrides_from(settings)), typed.get("free"), typed.get("model", AUTO), released=released)
    if not typed.get("figures", True):
        refuse_conflicts(context, "no figures")
    if (method := typed.get("method", "posterior")) in METHODS and method != "posterior":
        refuse_conflicts(context, "no posterior", method=method)
    found = request.show(
        observations,
        robots,
        output,
        friction=friction,
        assume_uncertainty=_stated(assume_uncertainty or ()),
        sampling=Sampling(**request.take("sampling")),
        workers=min(2, processor_count()),
        json=json,
    )
    if not found.converged:
        raise typer.Exit(1)


def _stated(given: Sequence[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    for item in given:
        name, equals, share = item.partition("=")
        if not equals or name.strip() in found:
            raise InputError(f"assume-uncertainty = '{item[:60]}'; allowed: FIELD=SHARE, each field once")
        found[name.strip()] = share
    return found


_A = TypeVar("_A", "Ranking", "Suggestion")


def _robots_of(robot: list[str] | None, settings: list[str] | None, posterior: Path | None = None) -> Any:
    """The named robots, or with settings the paper's; None: those that the function takes."""
    from spirillum.robot.load import PAPER_ROBOTS

    names = robot or (PAPER_ROBOTS if settings else ())
    return [loaded_robot(name, settings, posterior=posterior) for name in names] or None


def _note_robots_taken(found: _A, robot: Sequence[str] | None, settings: Sequence[str] | None) -> _A:
    """Refuse settings without a named robot, where the robots come from another file."""
    from spirillum.robot.load import PAPER_ROBOTS_TAKEN

    return found if robot or not settings else replace(found, warnings=(PAPER_ROBOTS_TAKEN, *found.warnings))


@from_function(
    "spirillum.calibration.ranking:rank_models",
    without={**_SAMPLER, "sampling.doublings": "as in calibrate", "robots": "the argument"},
    robot=None,
    tables=_SAMPLING,
)
def rank_models(
    request: Request,
    *,
    observations: Path,
    robot: list[str] | None = None,
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Rank models by cross-validation over the tails, with the tails where each fails.

    Example: `spirillum rank-models observations.csv --model sbt --model rft --model slender`
    """
    from spirillum.calibration.parameters import check_not_set
    from spirillum.calibration.posterior import Sampling
    from spirillum.calibration.ranking import free_by_model
    from spirillum.robot.arguments import set_fields
    from spirillum.swimming.motions import HELD, RELEASED

    fields, answer = set_fields(overrides_from(settings)), request.typed.get("answer", HELD)
    for name, fitted in free_by_model(request.typed.get("models"), request.typed.get("free"), answer).items():
        check_not_set(fields, fitted, name, released=answer == RELEASED)
    with renderer.progress_bar(quiet=json) as progress:
        robots = _robots_of(robot, settings)
        found = request(observations, robots, sampling=Sampling(**request.take("sampling")), progress=progress)
    renderer.show(_note_robots_taken(found, robot, settings).to_dict(), json=json)
    if not all(item.fit.converged for item in found.ranked):
        raise typer.Exit(1)


@from_function("spirillum.calibration.suggest:suggest", without={"robots": "the argument"}, robot=None)
def suggest(
    request: Request,
    *,
    posterior: Path,
    robot: list[str] | None = None,
    rows: int = 10,
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Suggest which tail or channel to measure next: the expected information of each candidate.

    Example: `spirillum suggest my-calibration/posterior.nc --candidates tails.csv`
    """
    from spirillum.calibration.parameters import OBSERVED
    from spirillum.robot.arguments import set_fields

    if rows < 1:
        raise InputError(f"rows = {rows}; allowed: at least 1")
    if own := [field for field in OBSERVED if field in set_fields(overrides_from(settings))]:
        raise InputError(f"{own[0]} is set, and every candidate has its own; allowed: other fields, or --candidates")
    robots = _robots_of(robot, settings, posterior)
    with renderer.progress_bar(quiet=json) as progress:
        found = _note_robots_taken(request(posterior, robots, progress=progress), robot, settings)
    renderer.show(found.to_dict(), json=json, rows=rows)


@from_function("spirillum.designs.design:design")
def design(
    request: Request,
    *,
    vary: list[str],
    output: Path | None = None,
    plot: Path | None = None,
    stl: Path | None = None,
    unknown: list[str] | None = None,
    model: str = "auto",
    json: Json = False,
) -> None:
    """Find the tail to build: the best values of some fields, under conditions and what is not known.

    Example: `spirillum design biorob2012-wide --vary tail.wavelength=5mm:40mm --maximise forward_velocity`
    """
    from spirillum.files import PICTURES, atomic_write_all, guard_inputs, output_target
    from spirillum.robot.robot import robot_text

    with guard_inputs(request.named_robot, request.typed.get("posterior")):
        target = None if output is None else output_target(output, {".toml": "a robot file"}, "design.toml")
        picture = None if plot is None else output_target(plot, PICTURES, "design.png")
        printed = None if stl is None else output_target(stl, {".stl": "a body for a printer"}, "design.stl")
    with renderer.progress_bar(quiet=json) as progress:
        found = request(
            pairs_of(vary, "--vary"), unknown=pairs_of(unknown or [], "--unknown"), model=model, progress=progress
        )
    paths = [path for path in (picture, printed, target) if path is not None]
    with renderer.answer_before_error(found.to_dict, json=json), atomic_write_all(paths) as parts:
        if picture is not None:
            from spirillum.view.figures.design import design_figure
            from spirillum.view.figures.style import save_as

            save_as(design_figure(found), parts[picture])
        if printed is not None:
            from spirillum.exports.write import export

            export(found.robot, parts[printed])
        if target is not None:
            words = f"Best design of {request.robot.name}: {found.objectives[0].words}, model {found.model}."
            parts[target].write_text(robot_text(found.robot, words), encoding="utf-8")
    files = {"file": None if output is None else str(output), "picture": None if plot is None else str(plot)}
    files |= {"stl": None if stl is None else str(stl)}
    renderer.show(renderer.with_files(found.to_dict(), **files), json=json)
