"""Large studies: one process, several, a cluster, or runs that were killed leave the same bytes."""

import hashlib
import json
import os
import shutil
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
import xarray as xr

import spirillum as sp
from spirillum.files import Stored, region_files, write_pieces
from spirillum.results import study_store
from spirillum.studies import regions, run
from spirillum.worker_pool import pool_of_workers

AT = "0.5 Hz", "1 Hz"
GRID = {
    "title": "Many tails",
    "models": ["sbt", "rft"],
    "friction": ["none", "rotor"],
    "assumed_motor_rates": list(AT),
    "grid": {
        "channels": {"wide": "biorob2012-wide", "narrow": "biorob2012-narrow"},
        "wavelengths": [f"{value} mm" for value in (15, 20, 25)],
        "amplitudes": ["1.5 mm", "2.5 mm", "40 mm"],
    },
}


@pytest.fixture
def small_regions(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two rows of amplitudes a region, so that there are four: some smaller than the others."""
    monkeypatch.setattr(regions, "BLOCK", 7)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The store of the grid in four regions, written by one process without a break; nobody changes it."""
    store = tmp_path_factory.mktemp("whole") / "study.zarr"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(regions, "BLOCK", 7)
        sp.study(GRID, store=store)
    return store


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same store, interrupted before its notes are summed up; nobody changes it."""
    store = tmp_path_factory.mktemp("interrupted") / "study.zarr"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(regions, "BLOCK", 7)
        patch.setattr(study_store, "note_attributes", Mock(side_effect=KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            sp.study(GRID, store=store)
    return store


def tree(folder: Path) -> dict[str, str]:
    """All files with what stands in them, as a hash."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def without_tube(dataset: xr.Dataset) -> xr.Dataset:
    """A dataset without the columns that `tube` adds beside its models, which a store has not."""
    return dataset.drop_vars([name for name in dataset.data_vars if str(name).endswith("_held")])


def same(one: xr.Dataset, other: xr.Dataset) -> None:
    """Same values, names, units and warnings; coordinates are the same, too."""
    assert set(one.variables) == set(other.variables)
    assert set(one.coords) == set(other.coords)
    for name in one.variables:
        np.testing.assert_array_equal(one[name].values, other[name].values)
        assert one[name].dims == other[name].dims
        assert one[name].attrs["units"] == other[name].attrs["units"]
    assert {key for key in one.attrs if one.attrs[key] != other.attrs.get(key)} <= {"checksum"}


@pytest.mark.usefixtures("small_regions")
def test_store_holds_what_the_study_answers(whole: Path) -> None:
    stored = sp.study(GRID, store=whole)  # which is there: it is opened
    same(without_tube(sp.study(GRID)), stored)
    assert stored.attrs["finished"] == "yes"
    assert stored.attrs["unanswered"] == int(np.count_nonzero(stored["outside"])) > 0
    assert not (whole / "notes").exists()
    chunks = [path for path in (whole / "outside" / "c").rglob("*") if path.is_file()]
    assert len(chunks) == 4


def test_store_of_a_list_with_observed_rates_holds_what_the_study_answers(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, planted: Any
) -> None:
    """Robots of several kinds, one without a motor, in blocks of two."""
    monkeypatch.setattr(regions, "BLOCK", 2)
    names = ["biorob2012-wide", "ecoli.toml", "biorob2012-narrow"]
    (tmp_path / "ecoli.toml").write_text('extends = "biorob2012-wide"\nname = "other"\n[tail]\nwavelength = "20 mm"\n')
    listed = {"models": ["rft"], "robots": [names[0], str(tmp_path / names[1]), names[2]]}
    one = {**GRID, "grid": {**GRID["grid"], "wavelengths": ["25 mm"], "amplitudes": ["2.5 mm"]}}  # type: ignore[dict-item]
    seen = planted(one, "rft", "rotor", 1e-5)
    whole = sp.study(listed, observations=seen)
    same(without_tube(whole), sp.study(listed, observations=seen, store=tmp_path / "study.zarr"))
    assert np.isfinite(whole["forward_velocity_at_observed_rate"]).any()


@pytest.mark.usefixtures("small_regions")
def test_interrupted_store_adds_what_is_missing(tmp_path: Path, whole: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = tmp_path / "part.zarr"
    done: list[int] = []
    original, most = study_store.write_pieces, 3

    def counted(folder: Path, pieces: dict[str, bytes]) -> None:
        if any(key.startswith("notes") for key in pieces):
            if len(done) == most:
                raise KeyboardInterrupt
            done.append(1)
        original(folder, pieces)

    monkeypatch.setattr(study_store, "write_pieces", counted)
    with pytest.raises(KeyboardInterrupt):
        sp.study(GRID, store=store)
    assert xr.open_zarr(store, chunks=None).attrs["finished"] == "no"
    next(path for path in (store / "tail_torque" / "c").rglob("*") if path.is_file()).unlink()
    most = 99
    sp.study(GRID, store=store)
    assert len(done) == 5
    assert tree(store) == tree(whole)
    done.clear()
    sp.study(GRID, store=store)
    assert done == []


def spoilt(path: Path) -> None:
    """Change one byte, and not the size."""
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def rewritten(path: Path, **attributes: Any) -> None:
    found = json.loads(path.read_text())
    found["attributes"] |= attributes
    path.write_text(json.dumps(found))


@pytest.mark.usefixtures("small_regions")
def test_what_was_spoilt_in_a_finished_store_is_made_again(
    tmp_path: Path, whole: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Chunks by their checksum, headers by what they have to hold; all else stays as it is."""
    store = tmp_path / "study.zarr"
    shutil.copytree(whole, store)
    written: list[str] = []
    original = study_store.write_pieces
    monkeypatch.setattr(study_store, "write_pieces", lambda *of: (written.extend(of[1]), original(*of)))
    for damage, pieces in (
        (lambda: spoilt(next(path for path in (store / "tail_torque" / "c").rglob("*") if path.is_file())), 1),
        (lambda: next(path for path in (store / "outside" / "c").rglob("*") if path.is_file()).unlink(), 1),
        (lambda: spoilt(store / "wavelength" / "c" / "0"), 0),
        (lambda: (store / "tail_torque" / "zarr.json").write_text("{}"), 0),
        (lambda: rewritten(store / "zarr.json", title="Other tails", units="m"), 0),
        (lambda: rewritten(store / "zarr.json", unanswered="many"), 4),
        (lambda: rewritten(store / "zarr.json", warnings=[1]), 4),
    ):
        damage()
        written.clear()
        same(sp.study(GRID, store=store), xr.open_zarr(whole, chunks=None))
        assert tree(store) == tree(whole)
        assert sum(key.startswith("notes") for key in written) == pieces
        assert written


@pytest.mark.usefixtures("small_regions")
@pytest.mark.parametrize(
    "note", ["[]", '{"cautions": 3, "unanswered": 0}', '{"cautions": [[1]], "unanswered": 0}', "{"]
)
def test_a_spoilt_note_of_an_interrupted_store_is_made_again(
    note: str, tmp_path: Path, whole: Path, interrupted: Path
) -> None:
    store = tmp_path / "study.zarr"
    shutil.copytree(interrupted, store)
    next((store / "notes").iterdir()).write_text(note)
    sp.study(GRID, store=store)
    assert tree(store) == tree(whole)


def test_processes_answer_what_one_answers(
    small: dict[str, object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where the work is long enough to be shared out; studies below that stay in one process."""
    monkeypatch.setattr("spirillum.results.study.write_report", lambda *_, **__: None)
    alone = sp.study(small, output=tmp_path / "one")
    monkeypatch.setattr(run, "_SHORT", 0)
    assert sp.study(small, output=tmp_path / "two", workers=2).identical(alone)
    assert (tmp_path / "one" / "dataset.nc").read_bytes() == (tmp_path / "two" / "dataset.nc").read_bytes()


def test_slices_that_share_a_chunk_are_refused() -> None:
    """Zarr itself would take them, and one of two writers would lose what it wrote."""
    stored = {"a": Stored(("x",), (10,), (4,), "float64", {})}
    for start, stop in ((0, 4), (4, 8), (8, 10)):
        assert list(region_files(stored, {"a": np.zeros(stop - start)}, {"a": [(start, stop)]})) == [
            f"a/c/{start // 4}"
        ]
    for start, stop in ((0, 3), (1, 5), (0, 8), (8, 9)):
        with pytest.raises(ValueError, match="no chunk"):
            region_files(stored, {"a": np.zeros(stop - start)}, {"a": [(start, stop)]})


def test_a_store_never_leads_out_of_its_folder(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "study.zarr").mkdir()
    (tmp_path / "study.zarr" / "a").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(sp.InputError, match="is a link"):
        write_pieces(tmp_path / "study.zarr", {"a/c/0": b"x"})
    assert list((tmp_path / "elsewhere").iterdir()) == []
    (tmp_path / "study.zarr" / "b" / "c" / "0").mkdir(parents=True)
    with pytest.raises(sp.InputError, match=r"b.c.0 is a folder; allowed: a file of the store"):
        write_pieces(tmp_path / "study.zarr", {"b/c/0": b"x"})


def test_what_cannot_be_stored_gets_a_sentence(tmp_path: Path) -> None:
    tiny = {"models": ["rft"], "robots": ["biorob2012-wide"]}
    store = tmp_path / "study.zarr"
    sp.study(tiny, store=store)
    before = tree(store)
    (tmp_path / "foreign.zarr").mkdir()
    (tmp_path / "foreign.zarr" / "zarr.json").write_text("{}")
    (tmp_path / "file.zarr").write_text("precious")
    for path, words in (
        (store, "another study"),
        (tmp_path / "foreign.zarr", "unknown origin"),
        (tmp_path / "file.zarr", "is a file"),
        (tmp_path / "study.nc", "ends in .zarr"),
    ):
        with pytest.raises(sp.InputError, match=words):
            sp.study({**tiny, "friction": ["none"]}, store=path)
    with pytest.raises(sp.InputError, match="one of them"):
        sp.study(tiny, store=store, output=tmp_path / "out")
    walled = {"models": ["tube"], "robots": ["biorob2012-wide"], "band": True}
    with pytest.raises(sp.InputError, match="band with a store"):
        sp.study(walled, store=tmp_path / "band.zarr")
    wavelengths, amplitudes = ([f"{1 + n / 1e4} mm" for n in range(count)] for count in (3_000, 100))
    many = {**GRID, "grid": {**GRID["grid"], "wavelengths": wavelengths, "amplitudes": amplitudes}}  # type: ignore[dict-item]
    with pytest.raises(sp.InputError, match=r"at most 5000000, or 500000000 in a store"):
        sp.study(many)
    assert tree(store) == before


def test_a_store_prints_no_ranking_to_shorten(run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    outcome = run("study", "--store", str(tmp_path / "study.zarr"), "--rows", "10")
    assert (outcome.code, outcome.out) == (2, "")
    assert "--rows 10 with --store, which prints no ranking; allowed: " in outcome.err
    assert not (tmp_path / "study.zarr").exists()


@contextmanager
def little_space() -> Iterator[None]:
    """No file can be larger than 6 kB: it stands for a full disk."""
    import resource

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (6000, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


@pytest.mark.skipif(sys.platform == "win32", reason="no limit on the size of files")
def test_a_full_disk_gets_a_sentence_and_the_rest_is_added_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, run: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # else modules are kept cut off, for all who import them
    tiny = {"models": ["rft"], "robots": ["biorob2012-wide"]}
    sp.study(tiny, store="whole.zarr")
    Path("study.toml").write_text('models = ["rft"]\nrobots = ["biorob2012-wide"]\n')
    with little_space():
        found = run("study", "study.toml", "--store", "study.zarr")
    assert found.code == 2
    (line,) = [line for line in found.err.splitlines() if not line.startswith("estimate")]
    assert line.startswith("spirillum: no space is left for ")
    assert line.endswith("; allowed: a place with space")
    again = sp.study(tiny, store="study.zarr")
    assert np.isfinite(again["forward_velocity"]).all()
    assert tree(tmp_path / "study.zarr") == tree(tmp_path / "whole.zarr")


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "here", "tcp://"])
def test_a_scheduler_that_is_not_there_gets_a_sentence(
    address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("spirillum.worker_pool._PATIENCE", 0.5)
    begun = time.monotonic()
    with pytest.raises(sp.InputError, match=r"cluster = .*allowed: the address of a Dask scheduler"):
        sp.study({"models": ["rft"], "robots": ["biorob2012-wide"]}, store=tmp_path / "study.zarr", workers=address)
    assert time.monotonic() - begun < 60.0
    with pytest.raises(sp.InputError, match="workers = 0"):
        pool_of_workers(0, None)


@pytest.fixture
def cluster() -> Iterator[Any]:
    """A scheduler with two small workers, each a process of its own."""
    from distributed import LocalCluster

    made = LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, memory_limit=0, silence_logs=50)
    yield made
    made.close()


@pytest.mark.filterwarnings("ignore")
@pytest.mark.usefixtures("small_regions")
def test_a_cluster_leaves_the_bytes_of_one_process(tmp_path: Path, whole: Path) -> None:
    """Two workers of one thread each, here in this process; workers of more threads are refused."""
    from distributed import LocalCluster

    words: list[str] = []
    settings = {"processes": False, "dashboard_address": None, "silence_logs": 50}
    with LocalCluster(n_workers=2, threads_per_worker=1, **settings) as made:
        address = made.scheduler_address
        sp.study(GRID, store=tmp_path / "a.zarr", workers=address, progress=lambda what, *_: words.append(what))
    assert tree(tmp_path / "a.zarr") == tree(whole)
    assert any("2 workers on 1 machine" in line for line in words)
    with (
        LocalCluster(n_workers=1, threads_per_worker=2, **settings) as wide,
        pytest.raises(sp.InputError, match="has 2 threads; allowed: workers of one thread"),
    ):
        sp.study(GRID, store=tmp_path / "b.zarr", workers=wide.scheduler_address)
    with LocalCluster(n_workers=0, **settings) as empty, pytest.raises(sp.InputError, match="has no workers"):
        sp.study(GRID, store=tmp_path / "c.zarr", workers=empty.scheduler_address)
    assert not (tmp_path / "b.zarr").exists()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.usefixtures("small_regions")
def test_a_cluster_whose_workers_are_killed_leaves_the_same_bytes(tmp_path: Path, whole: Path, cluster: Any) -> None:
    """Each of them once, while the study runs; another takes its place."""
    victims = iter(list(cluster.workers.values()))

    def kill(what: str, done: int, _total: int) -> None:
        if done and (victim := next(victims, None)) is not None:
            os.kill(victim.pid, signal.SIGKILL)

    sp.study(GRID, store=tmp_path / "killed.zarr", workers=cluster.scheduler_address, progress=kill)
    assert tree(tmp_path / "killed.zarr") == tree(whole)
