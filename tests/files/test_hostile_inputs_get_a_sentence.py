"""Hostile inputs of all kinds, from seeds: a sentence or an answer, nothing lost, nothing written on failure."""

from pathlib import Path

import pytest

import hostile


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The files that are bent."""
    return hostile.whole_files(tmp_path_factory.mktemp("whole"))


@pytest.fixture
def plain(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports and figures have tests of their own, and take most of the time."""
    monkeypatch.setattr("spirillum.results.study.write_report", lambda *_, **__: None)
    monkeypatch.setattr("spirillum.view.figures.calibration.calibration_drawings", lambda _: {})
    monkeypatch.setattr("spirillum.worker_pool.BUSY", 0.0)  # no second process, which takes none of these


@pytest.mark.usefixtures("plain")
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_no_promise_is_broken(whole: dict[str, bytes], tmp_path: Path, seed: int) -> None:
    for number, case in enumerate(hostile.cases(seed, 50, whole)):
        folder = tmp_path / str(number)
        folder.mkdir()
        hostile.check(case, folder)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 110))
def test_no_promise_is_broken_by_thousands(whole: dict[str, bytes], tmp_path: Path, seed: int) -> None:
    for number, case in enumerate(hostile.cases(seed, 500, whole)):
        folder = tmp_path / str(number)
        folder.mkdir()
        hostile.check(case, folder)
