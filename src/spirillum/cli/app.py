"""The commands: each reads its options, calls the function of the same name, and prints the answer."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from spirillum.cli import renderer
from spirillum.cli.calibrate_commands import calibrate, design, rank_models, suggest
from spirillum.cli.function_command import FunctionCommand, Request, from_function, own_options
from spirillum.cli.inputs import check_apart, overrides_from, refuse_conflicts
from spirillum.cli.measurement_commands import measure, observations_app, render, setup_app, track, virtual_experiment
from spirillum.cli.motion_commands import control, magnetic_sweep, remote, settle, simulate
from spirillum.cli.robot_commands import export, prepare, robot_app, validate
from spirillum.cli.shared_options import (
    NO_FORM,
    NO_START,
    All,
    Json,
    NotedCommand,
    Settings,
    complete_auto_models,
    complete_resistance_models,
    every_note,
)
from spirillum.cli.view_commands import film, flow, page, show

_ROWS = 10


class _Commands(TyperGroup):
    """The tree of commands; an interrupt keeps its sentence, such as what is kept, which the library would drop."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as error:
            raise typer.Abort(str(error)) from error


app = typer.Typer(
    name="spirillum",
    cls=_Commands,
    help="Predict, measure and explain how a robot with a rotating helical tail swims in a fluid-filled channel.",
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:  # noqa: FBT001 - a callback of the library
    if wanted:
        from spirillum.version import package_version

        typer.echo(f"spirillum {package_version()}")
        raise typer.Exit


@app.callback()
def _root(
    _version_wanted: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Predict, measure and explain how a robot with a rotating helical tail swims in a fluid-filled channel.

    ROBOT is a preset (`biorob2012-wide`, `biorob2012-narrow`, `ecoli`, `magnetic-helix`) or a TOML file
    (`spirillum robot new`).
    """


@from_function(
    "spirillum.dynamics.prediction:predict",
    without={
        **NO_FORM,
        **{path: why for path, why in NO_START.items() if path != "in_tube.wait"},
        "in_tube.azimuth": "of the start of a run: settle and simulate",
    },
)
def predict(request: Request, *, plot: Path | None = None, all_of_it: All = False, json: Json = False) -> None:
    """Predict one robot: held at a pose, in a trial after release in its tube, and in the steady state.

    Example: `spirillum predict biorob2012-wide --tail-rate 1.2Hz --gap 0.3mm`
    """
    from spirillum.kernels.native import run_together
    from spirillum.papers.biorob2012.published import other_tube, published_values

    draw = renderer.picture(plot, "prediction.png", "spirillum.view.figures.comparison:prediction_figure")
    with renderer.progress_bar(quiet=json) as progress:
        result = request(progress=progress)
        asked = {
            name: value for name, value in request.arguments.items() if name in ("duration", "roughness", "in_tube")
        }
        beside = other_tube(result, asked)
        compared = json or every_note.get()  # what the terminal says of other models on request only takes a solution
        answer, _ = run_together(
            lambda: result.to_dict(other_models=compared), lambda: None if beside is None else beside.trial
        )
        published = published_values(result, beside)
    if published:
        answer = {**answer, "published": published}
    pictures = {} if plot is None else {"plot": draw}
    renderer.show_with_pictures(answer, result, json=json, draw=pictures, all_of_it=all_of_it)


@from_function("spirillum.dynamics.comparison:compare_models", without=NO_FORM)
def compare_models(
    request: Request,
    *,
    context: typer.Context,
    output: Path | None = None,
    plot: Path | None = None,
    calibrated: bool = False,
    all_of_it: All = False,
    json: Json = False,
) -> None:
    """Predict one robot's swimming with every model, side by side.

    Example: `spirillum compare-models biorob2012-wide --tail-rate 1.2Hz`
    """
    draw = renderer.picture(output, "models.png", "spirillum.view.figures.comparison:comparison_figure")
    named = request.typed.get("models") or ["sbt", "slender"]
    states = [*(["calibrated"] if calibrated else []), *([] if {"sbt", "slender"} <= {*named} else ["no effects"])]
    refuse_conflicts(context, *states, models=" --model ".join(named))
    draw_effects = renderer.picture(plot, "effects.png", "spirillum.view.figures.comparison:effects_figure")
    check_apart(output, plot)
    with renderer.progress_bar(quiet=json) as progress:
        result = request(calibrated=calibrated or None, progress=progress)
    pictures = {"file": draw, "plot": draw_effects}
    renderer.show_with_pictures(result.to_dict(), result, json=json, draw=pictures, all_of_it=all_of_it)


@from_function(
    "spirillum.fluid.registry:resistance",
    without={
        **NO_FORM,
        "resolution.phases": "the matrix is that of one phase",
        "accuracy": "the option is that of the resolution",
    },
    complete={"model": complete_resistance_models},
)
def resistance(request: Request, *, json: Json = False) -> None:
    """Give the resistance matrix of a robot, of one of its parts or of its two links, never calibrated.

    Example: `spirillum resistance biorob2012-wide --part tail --about tail-root`
    """
    tilted = "placement.yaw" in request.typed
    with renderer.patience(request.typed.get("model", "rft"), quiet=json, tilted=tilted):
        result = request()
    renderer.show(result.to_dict(), json=json)


@from_function(
    "spirillum.results.study:study",
    without={"overrides": "--set"},
    complete={"models": complete_auto_models},
    robot=None,
)
def study(
    request: Request,
    *,
    context: typer.Context,
    source: Path | None = None,
    output: Path | None = None,
    workers: int = 2,
    cluster: str | None = None,
    store: Path | None = None,
    rows: int = _ROWS,
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Run a study of many robots: which is best, dataset, figures, report. A rerun resumes.

    Example: `spirillum study -o my-study`
    """
    drawn = request.typed.get("figures", True)
    refuse_conflicts(context, *(["store"] if store else []), *([] if drawn else ["no figures"]), rows=rows)
    with renderer.progress_bar(quiet=json) as progress:
        from spirillum.results.study import study_answer
        from spirillum.results.study_store import store_answer

        folder = output or (Path("spirillum-study") if store is None else None)
        dataset = request(
            source,
            output=folder,
            overrides=overrides_from(settings),
            workers=workers if cluster is None else cluster,
            store=store,
            progress=progress,
        )
    if folder is None:
        found = store_answer(dataset, Path(store or ""))
        renderer.show(found, json=json)
    else:
        found = study_answer(dataset, folder)
        renderer.show(found, json=json, rows=rows, figures=request.arguments.get("figures", True))
    if found["unanswered"] == found["results"]:
        raise typer.Exit(2)


def schema(name: str) -> None:
    """Print the JSON schema of a file: robot, study, calibration or setup.

    Example: `spirillum schema robot`
    """
    from spirillum.envelope import as_json
    from spirillum.schemas import schema_of

    typer.echo(as_json(schema_of(name)))


def citation(model: str | None = None) -> None:
    """Print what to cite: the software, its paper, and a model's references.

    Example: `spirillum citation sbt`
    """
    from spirillum.citations import citation as answer

    typer.echo(answer(model))


@from_function("spirillum.results.installation:report", robot=None)
def report(request: Request, *, json: Json = False) -> None:
    """Print versions, platform and extras of this installation, as text to paste into an issue.

    Example: `spirillum report`
    """
    renderer.show(request().to_dict(), json=json)


_TASKS: dict[str, tuple[Callable[..., None], ...]] = {
    "Predict": (predict, compare_models, study, prepare, resistance),
    "Move": (simulate, settle, control, remote, magnetic_sweep),
    "Look": (page, show, film, flow),
    "Measure": (render, virtual_experiment, measure, track),
    "Learn": (calibrate, rank_models, suggest),
    "Design": (design,),
    "Files": (export, schema, citation, validate, report),
}
"""The commands by what one wants to do, with their panels of the help."""

for _task, _commands in _TASKS.items():
    for _command in _commands:
        _kind = FunctionCommand if hasattr(_command, "source") else NotedCommand
        app.command(cls=_kind, rich_help_panel=_task)(_command if _kind is FunctionCommand else own_options(_command))
app.add_typer(robot_app, name="robot", rich_help_panel="Files")
app.add_typer(setup_app, name="setup", rich_help_panel="Files")
app.add_typer(observations_app, name="observations", rich_help_panel="Files")


@cache
def command_line() -> Any:
    """Return the tree of commands, made once in a process; each makes its parameters when they are needed."""
    return typer.main.get_command(app)
