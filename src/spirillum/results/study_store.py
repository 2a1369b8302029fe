"""A study written as a Zarr store, a region after the other: a kill leaves whole regions, and a rerun adds the rest."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from math import gcd
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from pydantic import TypeAdapter, ValidationError

from spirillum.envelope import envelope
from spirillum.errors import InputError
from spirillum.files import is_whole, opened_store, read_json, results_folder, store_files, store_target, write_pieces
from spirillum.files.reading import DAMAGED
from spirillum.notes import note_attributes, notes_in
from spirillum.optional_dependencies import import_optional
from spirillum.studies.dataset import described
from spirillum.studies.regions import (
    CostEstimate,
    Pace,
    Plan,
    RobotBlock,
    encoded_region,
    estimate_of,
    is_large,
    layout_of,
    plan_of,
    region_jobs,
)
from spirillum.studies.run import make_tables, warnings_of, warnings_of_calibrations
from spirillum.studies.study_loader import LoadedStudy, ObservedArrays
from spirillum.swimming.cautions import Caution, summed
from spirillum.worker_pool import WorkerPool, map_tasks

if TYPE_CHECKING:
    import xarray as xr

_MARK = "study.json"
_NOTES = "notes"
_GOLDEN = 0.618  # share of all regions between one and the next that is computed, so that any number spreads evenly

Tell = Callable[[str, int, int], None]


def stored_study(
    loaded: LoadedStudy,
    observed: ObservedArrays | None,
    fingerprint: str,
    store: str | Path,
    pool: WorkerPool,
    on_progress: Tell,
) -> xr.Dataset:
    """Compute what a store lacks of a study, and open it."""
    import_optional("zarr", "a store", "cluster")
    option = next((name for name in ("band", "predicted", "settled", "trial") if getattr(loaded.study, name)), None)
    if option is not None:
        raise InputError(f"{option} with a store; allowed: a folder for the results (-o DIR), on any number of workers")
    mark = {"schema": "spirillum.study-store/1", "title": loaded.study.title, "fingerprint": f"{fingerprint}-store"}
    claim = {"mark": _MARK, "content": mark, "what": "study"}
    with results_folder(store_target(store), claim=claim) as folder:
        make_tables(loaded, pool, on_progress)
        plan = plan_of(loaded, observed, layout_of(loaded))
        attributes = {**described(loaded, observed, fingerprint, []), "coordinates": " ".join(plan.others)}
        outcome = _outcome_of(folder)
        missing = _missing(plan, folder, finished=outcome is not None)
        if outcome is None:
            _write_headers(plan, folder, {**attributes, "finished": "no"})
        if missing:
            estimate = estimate_of(loaded, observed, plan, len(missing), pool) if is_large(loaded) else None
            _write_regions(_Work(loaded, observed, plan, folder), missing, pool, on_progress, estimate)
        if outcome is None:
            kept = [_note_of(folder / plan.note(region)) for region in plan.layout.regions()]
            warnings = warnings_of(loaded, observed)
            warnings += summed((caution for note in kept for caution in note.cautions), loaded.count)
            notes = note_attributes(dict.fromkeys([*warnings, *warnings_of_calibrations(loaded)]))
            outcome = _Outcome(**notes, unanswered=sum(note.unanswered for note in kept))
        _write_headers(plan, folder, {**attributes, **outcome._asdict(), "finished": "yes"})
        shutil.rmtree(folder / _NOTES, ignore_errors=True)
        return opened_store(folder)


class _Work(NamedTuple):
    """A study, and the folder that its regions are written into."""

    loaded: LoadedStudy
    observed: ObservedArrays | None
    plan: Plan
    folder: Path


class _Note(NamedTuple):
    """Notes of a region, until the study is finished."""

    cautions: list[Caution]
    unanswered: int


_NOTE = TypeAdapter(_Note)


class _Outcome(NamedTuple):
    """What is known once all regions are there."""

    warnings: str  # sentences, one a line
    notes: str  # notes with their codes, as JSON
    unanswered: int


def _missing(plan: Plan, folder: Path, *, finished: bool) -> list[RobotBlock]:
    """Regions of which a file is not there as it was written; until the study is finished, their note is one."""

    def lacks(region: RobotBlock) -> bool:
        note = plan.note(region)
        chunks = [key for key in reversed(plan.pieces(region)) if key != note]
        return not (all(is_whole(folder / key) for key in chunks) and (finished or _has_note(folder / note)))

    return [region for region in plan.layout.regions() if lacks(region)]


def _has_note(path: Path) -> bool:
    with suppress(InputError):
        _note_of(path)
        return True
    return False


def _note_of(path: Path) -> _Note:
    what = "a note of a study"
    found = read_json(path, what)
    try:
        return _NOTE.validate_python(found)
    except ValidationError as error:
        raise InputError(f"{path} {DAMAGED}; allowed: {what}") from error


def _outcome_of(folder: Path) -> _Outcome | None:
    """What the study was finished with; nothing until then."""
    with suppress(InputError, KeyError, TypeError):
        attributes = read_json(folder / "zarr.json", "a store")["attributes"]
        found = _Outcome(**note_attributes(notes_in(attributes)), unanswered=attributes["unanswered"])
        if attributes["finished"] == "yes" and type(attributes["warnings"]) is str and type(found.unanswered) is int:
            return found
    return None


def _write_headers(plan: Plan, folder: Path, attributes: Mapping[str, Any]) -> None:
    """Write the store, except its regions, where it does not exist yet."""
    files = store_files(plan.variables, plan.coordinates, attributes)
    changed = {key: content for key, content in files.items() if not _holds(folder / key, content)}
    if changed:
        write_pieces(folder, changed)


def _holds(path: Path, content: bytes) -> bool:
    with suppress(OSError):
        return path.stat().st_size == len(content) and path.read_bytes() == content
    return False


def _write_regions(
    work: _Work, missing: Sequence[RobotBlock], pool: WorkerPool, on_progress: Tell, estimate: CostEstimate | None
) -> None:
    """Compute and write regions; the remaining time is reported once their pace is known."""
    plan, total = work.plan, work.plan.layout.count
    models = ", ".join(work.loaded.study.models)
    done, here = total - len(missing), [""]

    def at_work(words: str) -> None:
        if words != here[0]:
            here[0] = words
            on_progress(f"{models}: {words}", done, total)

    pace = None if estimate is None else Pace(sum(region.size for region in missing), estimate.workers)
    jobs = region_jobs(work.loaded, work.observed, plan, _spread(missing))
    for job, files in map_tasks(encoded_region, jobs, pool, besides="; what was written is kept", on_progress=at_work):
        write_pieces(work.folder, files)
        done += 1
        seconds = None if pace is None or done == total else pace.seconds(job.region.size)
        if estimate is not None and seconds is not None:
            on_progress(estimate.words(seconds), 0, 0)
            pace = None
        on_progress(f"{models}, {job.region.size} robots{', ' if here[0] else ''}{here[0]}", done, total)


def _spread(regions: Sequence[RobotBlock]) -> list[RobotBlock]:
    """Regions in an order in which the first ones are representative: long tails cost more than short ones."""
    step = max(round(len(regions) * _GOLDEN), 1)
    while gcd(step, len(regions)) > 1:
        step += 1
    return [regions[(len(regions) // 2 + number * step) % len(regions)] for number in range(len(regions))]


def store_answer(dataset: xr.Dataset, store: Path) -> dict[str, Any]:
    """What a study has written into a store, as `spirillum study --store` prints it."""
    sizes = {**dataset["outside"].sizes, **dataset.sizes}  # in the order of the results
    content = {
        "title": dataset.attrs["title"],
        "folder": str(store),
        "dimensions": {str(name): int(size) for name, size in sizes.items()},
        "results": int(np.prod(dataset["outside"].shape)),
        "unanswered": int(dataset.attrs["unanswered"]),
        "observations": dataset.attrs["observations"],
    }
    return envelope("study-store", json.loads(json.dumps(content)), notes_in(dataset.attrs))
