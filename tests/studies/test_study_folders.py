"""A study's folder: resumes after an interruption, and is refused to another study."""

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

import spirillum as sp
from spirillum.files import MARK
from spirillum.studies.study_loader import load_study
from spirillum.studies.work import ModelTask, run_job, tasks


@pytest.fixture(autouse=True)
def _no_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures and report have tests of their own."""
    monkeypatch.setattr("spirillum.results.study.write_report", lambda *_, **__: None)


def test_interrupted_study_resumes_where_it_stopped(
    small: dict[str, object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = sp.study(small)
    done: list[int] = []
    most = 3

    def counted(job):
        if isinstance(job.task, ModelTask):
            if len(done) == most:
                raise KeyboardInterrupt
            done.append(job.number)
        return run_job(job)

    monkeypatch.setattr("spirillum.studies.run.run_job", counted)
    with pytest.raises(KeyboardInterrupt):
        sp.study(small, output=tmp_path / "out")
    assert not (tmp_path / "out" / "dataset.nc").exists()
    (parts,) = (tmp_path / "out").glob("parts-*")
    assert len(list(parts.glob("*.npz"))) == 3

    done.clear()
    damaged = parts / "part-00001.npz"
    damaged.write_bytes(damaged.read_bytes()[:100])
    (parts / "part-00003.npz").write_bytes((parts / "part-00000.npz").read_bytes())  # another's, of the same shape
    resumed = sp.study(small, output=tmp_path / "out")
    assert done == [1, 3]
    assert resumed.identical(whole)
    assert not parts.exists()

    done.clear()
    assert sp.study(small, output=tmp_path / "out").identical(resumed)
    assert done == []


def test_parts_of_another_shape_or_study_are_not_taken(small: dict[str, object], tmp_path: Path) -> None:
    """Arrays that a file happens to hold are only taken if they are those of the task."""
    whole = sp.study(small)
    fingerprint = whole.attrs["fingerprint"]
    for name, arrays in {
        "part-00000.npz": {"forward_velocity": np.zeros(1)},
        "part-00001.npz": {"outside": np.array(["x"])},
        "part-00002.npz": {},
    }.items():
        folder = tmp_path / "out" / f"parts-{fingerprint[:16]}"
        folder.mkdir(parents=True, exist_ok=True)
        np.savez(folder / name, **arrays)
    stale = tmp_path / "out" / "parts-0123456789abcdef"
    stale.mkdir()
    np.savez(stale / "part-00003.npz", forward_velocity=np.zeros((4, 3)))
    assert sp.study(small, output=tmp_path / "out").identical(whole)


@pytest.mark.parametrize(("body", "sizes"), [({}, [2]), ({"body.diameter": "16 mm"}, [1, 1])])
def test_robots_without_a_table_are_answered_and_kept_one_by_one(body: dict[str, str], sizes: list[int]) -> None:
    """Each takes as long as hundreds that have one."""
    asked = {"robots": ["biorob2012-wide"], "vary": {"tail.amplitude": ["2 mm", "2.5 mm"]}, "models": ["tube"]}
    assert [task.size for task in tasks(load_study(asked, body))] == sizes


def test_folder_of_another_study_is_refused(small: dict[str, object], tmp_path: Path) -> None:
    sp.study(small, output=tmp_path / "out")
    before = (tmp_path / "out" / "dataset.nc").read_bytes()
    for other in ({**small, "friction": ["none"]}, {**small, "title": "Other"}):
        with pytest.raises(sp.InputError, match="another study"):
            sp.study(other, output=tmp_path / "out")
    with pytest.raises(sp.InputError, match="another study"):
        sp.study(small, output=tmp_path / "out", overrides={"tail.taper": "none"})
    assert (tmp_path / "out" / "dataset.nc").read_bytes() == before


@pytest.mark.parametrize("name", ["dataset.nc", "ranking.csv"])
def test_results_of_unknown_origin_are_not_overwritten(small: dict[str, object], tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("precious")
    with pytest.raises(sp.InputError, match="unknown origin"):
        sp.study(small, output=tmp_path)
    assert (tmp_path / name).read_text() == "precious"
    assert sorted(path.name for path in tmp_path.iterdir()) == [name]


def test_damaged_mark_and_file_in_place_of_a_folder_are_refused(small: dict[str, object], tmp_path: Path) -> None:
    (tmp_path / "study.json").write_text("{")
    with pytest.raises(sp.InputError, match="damaged"):
        sp.study(small, output=tmp_path)
    (tmp_path / "file").touch()
    with pytest.raises(sp.InputError, match="folder for results"):
        sp.study(small, output=tmp_path / "file")


def test_dataset_of_another_version_is_computed_anew(small: dict[str, object], tmp_path: Path) -> None:
    sp.study(small, output=tmp_path / "a")
    shutil.copytree(tmp_path / "a", tmp_path / "b")
    (tmp_path / "b" / "dataset.nc").write_text(f"not NetCDF\n{MARK}\n")
    assert sp.study(small, output=tmp_path / "b").identical(sp.study(small, output=tmp_path / "a"))
    assert json.loads((tmp_path / "b" / "study.json").read_text())["title"] == "Four tails"


@pytest.mark.parametrize("name", ["dataset.nc", "ranking.csv", "claims.json"])
def test_a_rerun_follows_no_link_into_another_study(small: dict[str, object], tmp_path: Path, name: str) -> None:
    for title in ("a", "b"):
        sp.study({**small, "title": title}, output=tmp_path / title, figures=False)
    before = (tmp_path / "b" / name).read_bytes()
    (tmp_path / "a" / name).unlink()
    (tmp_path / "a" / name).symlink_to(f"../b/{name}")
    with pytest.raises(sp.InputError, match=f"{name} is a link; allowed: a file of its own"):
        sp.study({**small, "title": "a"}, output=tmp_path / "a", figures=False)
    assert (tmp_path / "b" / name).read_bytes() == before


@pytest.mark.parametrize("name", ["dataset.nc", "ranking.csv", "claims.json", "report.html"])
def test_a_foreign_file_in_a_folder_of_a_study_is_refused_before_the_work(
    small: dict[str, object], tmp_path: Path, name: str
) -> None:
    sp.study(small, output=tmp_path, figures=False)
    if name == "dataset.nc":  # one's own, cut off
        os.truncate(tmp_path / name, (tmp_path / name).stat().st_size // 2)
        with pytest.raises(
            sp.InputError, match=r"dataset\.nc is there and of unknown origin: it is damaged, cut off, or"
        ):
            sp.study(small, output=tmp_path)
    (tmp_path / "dataset.nc").unlink()
    (tmp_path / name).write_text("rank;robot\n" if name == "ranking.csv" else "{}")
    with pytest.raises(sp.InputError, match=f"{name} is there and of unknown origin"):
        sp.study(small, output=tmp_path)
    assert {path.name for path in tmp_path.iterdir()} & {"dataset.nc", "figures"} <= {name}
    assert (tmp_path / name).stat().st_size < 20
    (tmp_path / name).unlink()
    sp.study(small, output=tmp_path, figures=False)
    sp.study(small, output=tmp_path, figures=False)
