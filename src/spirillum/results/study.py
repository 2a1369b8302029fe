"""A study computed and written: `spirillum.study`."""

from __future__ import annotations

import csv
import io
import json
import math
import shutil
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
import xarray as xr

from spirillum.envelope import envelope
from spirillum.errors import InputError
from spirillum.files import check_replaceable, guard_inputs, output_folder, results_folder, write_dataset, write_text
from spirillum.files.writing import Replace
from spirillum.formats.templates import rendered
from spirillum.notes import notes_in
from spirillum.papers.claim import PredictedVerdict, Verdict
from spirillum.papers.registry import claims_of, figures_of, predictions_of
from spirillum.papers.studies import study_of
from spirillum.progress import Progress
from spirillum.results.page import draw_pictures, load_figures
from spirillum.results.study_content import content, ranking_content
from spirillum.results.study_store import stored_study
from spirillum.robot.fields import Section
from spirillum.robot.geometry import Body, Channel, Coupling, Fluid, Tail
from spirillum.robot.robot import Robot
from spirillum.robot.tables import Drive, Motor
from spirillum.studies.dataset import is_dataset, read_dataset
from spirillum.studies.ranking import StudyRanking, ranking_of, robot_dims, unit_of_ranked
from spirillum.studies.run import computed_study, make_tables, study_fingerprint
from spirillum.studies.spec import LARGEST_STORED
from spirillum.studies.study_loader import LARGEST_STUDY, load_study, observed_arrays
from spirillum.worker_pool import pool_of_workers, process_beside

if TYPE_CHECKING:
    from concurrent.futures import ProcessPoolExecutor

    from spirillum.view.figures.sheet import Picture


def robot_picture(dataset: xr.Dataset, ranking: StudyRanking) -> Picture | None:
    """Side view of the study's fastest robot, else of its first; None if the dataset carries no settings of robots."""
    from spirillum.view.figures.robot import robot_figure, robot_words
    from spirillum.view.figures.sheet import Picture

    dumps = json.loads(dataset.attrs.get("settings", "{}")).get("robots") or []
    if not dumps:
        return None
    place = ranking.robots[0].place if ranking.robots else 0
    if "channel" in dataset.dims:  # of a grid the settings name a robot for each channel
        grid = robot_dims(dataset)
        channel, *tail = np.unravel_index(place, [dataset.sizes[name] for name in grid])
        table = dict(dumps[int(channel)])
        own = {name: float(dataset[name].values[at]) for name, at in zip(grid[1:], tail, strict=True)}
        table["tail"] = {**table["tail"], **own}
    else:
        table = dumps[place]
    # The settings were checked when the study was loaded.
    parts: dict[str, Any] = {
        name: kind.model_construct(**table[name]) if table.get(name) else None for name, kind in _PARTS.items()
    }
    robot = Robot.model_construct(name=str(table["name"]), **parts)
    if "channel" in dataset.dims:  # its tail is not the one of the file that names it
        robot = robot.model_copy(update={"name": robot.with_tail})
    words = robot_words(robot)
    first = f"the first of the ranking: {ranking.robots[0].name}" if ranking.robots else "the study's first robot"
    return Picture("The robot", f"{words} Drawn is {first}.", words, lambda: robot_figure(robot))


_PARTS: dict[str, type[Section]] = {"body": Body, "coupling": Coupling, "tail": Tail, "fluid": Fluid}
_PARTS |= {"channel": Channel, "drive": Drive, "motor": Motor}
"""Tables of a robot of which its picture is made."""
_LARGEST_SVG = 2_000_000  # a larger vector picture is embedded as pixels, bytes


def study_pictures(dataset: xr.Dataset) -> dict[str, Picture]:
    """The figures of a study by the names of their files."""
    from spirillum.view.figures.comparison import ranking_picture
    from spirillum.view.figures.release import release_picture

    ranking = ranking_of(dataset)
    first = {"ranking": ranking_picture(ranking)} if ranking.robots else {}
    drawn = {"robot": robot_picture(dataset, ranking), "laid-down": release_picture(dataset, ranking)}
    return {**first, **{name: picture for name, picture in drawn.items() if picture}, **figures_of(dataset)}


def write_report(
    dataset: xr.Dataset,
    folder: Path,
    on_progress: Callable[[str, int, int], None],
    *,
    vector: bool = False,
    beside: ProcessPoolExecutor | None = None,
) -> None:
    """Write `figures/`, a self-contained `report.html`, and the files of `write_tables`."""
    pictures = study_pictures(dataset)
    steps = len(pictures) + 1
    embedded = draw_pictures(
        pictures,
        folder,
        lambda name, done: on_progress(f"figure {name}", done, steps),
        vector=vector,
        largest_svg=_LARGEST_SVG,
        again=partial(study_pictures, dataset),
        beside=beside,
    )
    on_progress("report", len(pictures), steps)
    claims, predictions = write_tables(dataset, folder)
    names = {
        "ranking": ranking_content(ranking_of(dataset)),
        "pictures": embedded,
        "claims": claims,
        "predictions": predictions,
        **content(dataset),
    }
    write_text(folder / "report.html", rendered("results/report.html.jinja", escaped=True, **names))
    on_progress("report", steps, steps)


def write_tables(dataset: xr.Dataset, folder: Path) -> tuple[list[dict[str, Any]], ...]:
    """Write `claims.json` and `ranking.csv`; return the claims and those decided by released robots."""
    claims, predictions = ([claim.to_dict() for claim in found(dataset)] for found in (claims_of, predictions_of))
    text = json.dumps(claims + predictions, indent=2, allow_nan=False, ensure_ascii=False) + "\n"
    write_text(folder / "claims.json", text, begins=text[:_KEY])
    write_text(folder / "ranking.csv", _ranking_rows(ranking_of(dataset)), begins=_BEGIN["ranking.csv"])
    return claims, predictions


def _ranking_rows(ranking: StudyRanking) -> str:
    names = ranking.quantities
    header = ["rank", "robot", *(f"{name}{end}_{_COLUMN[unit_of_ranked(name)]}" for name in names for end in _ENDS)]
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow([title.rstrip("_") for title in header])
    for rank, robot in enumerate(ranking.robots, start=1):
        values = [of[name] for name in names for of in (robot.values, robot.low, robot.high)]
        writer.writerow([rank, robot.name, *("" if math.isnan(value) else repr(value) for value in values)])
    return table.getvalue()


_ENDS = ("", "_low", "_high")
_COLUMN = {"m/s": "m_s", "1": "", "A": "A", "W": "W"}


_BEGIN = {"report.html": "", "claims.json": "[", "ranking.csv": "rank,robot,"}
"""Files of a study that are only replaced where they are its own, and how those begin that carry no mark."""
_KEY = 16  # characters of `claims.json` that name its first key
_RESULTS = ("dataset.nc", "figures", *_BEGIN)
"""What a folder without the mark of a study may not hold, for it would be replaced."""


def study(  # noqa: PLR0913 - the options of the command
    source: str | Path | Mapping[str, Any] | None = None,
    *,
    observations: str | Path | None = None,
    output: str | Path | None = None,
    overrides: Mapping[str, Any] | None = None,
    models: Sequence[str] | None = None,
    band: bool | None = None,
    predicted: bool | None = None,
    settled: bool | None = None,
    trial: bool | None = None,
    interval: bool | None = None,
    workers: int | str = 1,
    store: str | Path | None = None,
    calibration: str | Path | None = None,
    posterior: str | Path | None = None,
    figures: bool = True,
    vector: bool = False,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Run a study of many robots.

    Args:
        source: study file (see `spirillum schema study`) or its tables, or a paper's name; None: the study of
            `biorob2012`.
        observations: observed rates and speeds (CSV); the study then also runs at the rates and infers B_eff.
        output: folder for `dataset.nc`, `figures/`, `report.html`, `claims.json` and `ranking.csv`; a rerun resumes
            there.
            None: nothing is written.
        overrides: dotted robot fields, applied to every robot (``{"tail.taper": "none"}``).
        models: hydrodynamic models, or `auto`; None: the study's.
        band: in models with walls, also the band over gap and pitch left open (seconds with tables, else many minutes);
            None: what the study says.
        predicted: also simulate release from rest over a design of gap, pitch, waiting time, roughness and friction,
            with nothing fitted (minutes); None: what the study says.
        settled: also find each robot's steady state after release (seconds a robot); None: what the study says.
        trial: also simulate a trial of each robot in its tube, as `predict` (seconds a robot); None: what the study
            says.
        interval: also the 90 % interval of each trial over unknown parameters (half a minute a robot; a rerun
            resumes); None: what the study says.
        workers: number of processes, or the address of a Dask scheduler, as `tcp://192.168.1.5:8786`. The results do
            not depend on it.
        store: instead of `output`, a Zarr store (`study.zarr`), written a region after the other: for more robots than
            fit into memory. A rerun adds what is missing.
        calibration: calibration file, applied to every robot.
        posterior: file of a calibration's posterior: its medians are applied to every robot, and the answers of its
            model have 95 % intervals.
        figures: draw figures and write the report.
        vector: write figures as SVG beside PNG.
        progress: called as the work goes on.

    Returns:
        Dataset with dimensions `channel`, `wavelength`, `amplitude` (or `robot`), `model`, `friction`; that of a store
        reads its values where they are asked for. `print` and notebooks show its ranking first.

    Raises:
        InputError: if the study, a robot or the observations are wrong, or the folder holds another study.
    """
    from spirillum.results.study_content import StudyDataset

    pool = pool_of_workers(1, workers) if isinstance(workers, str) else pool_of_workers(workers, None)
    if store is not None and output is not None:
        raise InputError(f"store = {str(store)[:80]!r} together with a folder for results; allowed: one of them")
    loaded = load_study(
        study_of(source),
        overrides,
        models=None if models is None else list(models),
        band=band,
        predicted=predicted,
        settled=settled,
        trial=trial,
        interval=interval,
        calibration=calibration,
        posterior=posterior,
        largest=LARGEST_STUDY if store is None else LARGEST_STORED,
    )
    observed = observed_arrays(observations, loaded) if observations is not None else None
    pool.check()
    fingerprint = study_fingerprint(loaded, observed)
    on_progress = progress or (lambda _what, _done, _total: None)
    inputs = (None if isinstance(source, Mapping) else source, observations, calibration, posterior)
    if store is not None:
        with guard_inputs(*inputs):
            return StudyDataset.of(stored_study(loaded, observed, fingerprint, store, pool, on_progress))
    if output is None:
        make_tables(loaded, pool, on_progress)
        return StudyDataset.of(computed_study(loaded, observed, fingerprint, None, on_progress, pool))
    mark = {"schema": "spirillum.study-folder/1", "title": loaded.study.title, "fingerprint": fingerprint}
    claim = {"mark": "study.json", "content": mark, "what": "study", "results": _RESULTS}
    with guard_inputs(*inputs), results_folder(output, claim=claim) as folder:
        for name, begin in _BEGIN.items():
            if figures or name != "report.html":
                check_replaceable(folder / name, begins=begin.encode())
        make_tables(loaded, pool, on_progress)
        dataset = read_dataset(folder / "dataset.nc", loaded.count)
        with process_beside(partial(load_figures, *_DRAWING)) if figures and workers != 1 else nullcontext() as beside:
            if dataset is None or dataset.attrs.get("fingerprint") != fingerprint:
                replace: Replace = "any" if is_dataset(folder / "dataset.nc") else "own"
                check_replaceable(folder / "dataset.nc", replace)
                parts = output_folder(folder / f"parts-{fingerprint[:16]}", folder)
                dataset = computed_study(loaded, observed, fingerprint, parts, on_progress, pool)
                write_dataset(dataset, folder / "dataset.nc", replace=replace)
                shutil.rmtree(parts, ignore_errors=True)
            if figures:
                write_report(dataset, folder, on_progress, vector=vector, beside=beside)
            else:
                write_tables(dataset, folder)
    return StudyDataset.of(dataset)


_DRAWING = (
    *("spirillum.papers.biorob2012.figures", "spirillum.view.figures.comparison"),
    *("spirillum.view.figures.release", "spirillum.view.figures.robot"),
)
"""Modules that draw the figures of a study."""


def study_answer(dataset: xr.Dataset, output: Path) -> dict[str, Any]:
    """What a study has found and written, as `spirillum study` prints it."""
    claims, predictions = (Counter(claim.verdict for claim in found(dataset)) for found in (claims_of, predictions_of))
    content = {
        "title": dataset.attrs["title"],
        "folder": str(output),
        "files": sorted(str(path.relative_to(output)) for path in output.rglob("*") if path.is_file()),
        "dimensions": {str(name): int(size) for name, size in dataset.sizes.items()},
        **({"model_reason": dataset.attrs["model_reason"]} if "model_reason" in dataset.attrs else {}),
        "ranking": ranking_of(dataset).to_dict(),
        "results": dataset["outside"].size,
        "unanswered": int(np.count_nonzero(dataset["outside"].values)),
        "claims": {verdict: claims[verdict] for verdict in get_args(Verdict)},
        **({"predictions": {name: predictions[name] for name in get_args(PredictedVerdict)}} if predictions else {}),
        "observations": dataset.attrs["observations"],
    }
    return envelope("study", content, notes_in(dataset.attrs))
