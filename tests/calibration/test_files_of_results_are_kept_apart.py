"""What a calibration writes, in which order, and what it never touches."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import spirillum as sp
from spirillum import InputError
from spirillum.files import results_folder
from spirillum.files.reading import DAMAGED
from spirillum.results.calibration import check_folder, earlier_results, write_calibration

WIDE = "biorob2012-wide"


@pytest.fixture(scope="module")
def found(made: Callable[..., Path]) -> Any:
    small = {"presets": (WIDE,), "wavelengths": (15.0, 25.0), "amplitudes": (1.5, 2.5), "discrepancy": 0.03}
    return sp.calibrate(made(**small, seed=4), WIDE, method="least-squares", model="sbt")


@pytest.mark.parametrize("name", ["calibration.toml", "predictions.csv", "posterior.nc"])
def test_a_link_to_another_result_is_refused_before_any_work(tmp_path: Path, name: str) -> None:
    (tmp_path / name).symlink_to("../missing")
    with pytest.raises(InputError, match=f"{name} is a link; allowed: a file of its own"):
        sp.calibrate("missing.csv", WIDE, tmp_path)


def small_drawings(_found: Any) -> dict[str, Any]:
    from matplotlib.figure import Figure

    return dict.fromkeys(("residuals", "profiles"), lambda: Figure(figsize=(1, 1)))


@pytest.mark.parametrize("name", ["posterior.nc", "predictions.csv", "calibration.toml", "figures/residuals.png"])
def test_a_file_that_no_calibration_wrote_is_refused_and_stays(found: Any, tmp_path: Path, name: str) -> None:
    foreign = tmp_path / name
    foreign.parent.mkdir(exist_ok=True)
    foreign.write_bytes(b"my own\n")
    with pytest.raises(InputError, match=f"{name} is there and of unknown origin: it {DAMAGED}; allowed"):
        check_folder(tmp_path)
    with pytest.raises(InputError, match="unknown origin"):
        write_calibration(found, tmp_path, figures=False)
    assert foreign.read_bytes() == b"my own\n"
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == [foreign]


def test_an_interrupt_while_figures_are_drawn_leaves_the_earlier_calibration(
    found: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted() -> None:
        raise KeyboardInterrupt

    def files() -> dict[Path, int]:
        return {path: path.stat().st_ino for path in tmp_path.rglob("*") if path.is_file()}

    monkeypatch.setattr("spirillum.view.figures.calibration.calibration_drawings", small_drawings)
    write_calibration(found, tmp_path, vector=True)
    before = files()
    assert len(before) == 6
    drawings = {**small_drawings(found), "posterior": interrupted}
    monkeypatch.setattr("spirillum.view.figures.calibration.calibration_drawings", lambda _found: drawings)
    with pytest.raises(KeyboardInterrupt):
        write_calibration(found, tmp_path)
    assert files() == before
    with pytest.raises(KeyboardInterrupt), results_folder(tmp_path / "new") as folder:
        write_calibration(found, folder)
    assert not (tmp_path / "new").exists()


def test_figures_of_an_earlier_run_go_and_changed_ones_stay(
    found: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("spirillum.view.figures.calibration.calibration_drawings", small_drawings)
    write_calibration(found, tmp_path, vector=True)
    (tmp_path / "figures" / "my-own.png").write_bytes(b"mine")
    assert {path.name for path in earlier_results(tmp_path)} == {
        "calibration.toml",
        "predictions.csv",
        *(f"{name}{suffix}" for name in ("residuals", "profiles") for suffix in (".png", ".svg")),
    }
    write_calibration(found, tmp_path, figures=False)
    kept = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    assert kept == {"calibration.toml", "predictions.csv", "figures/my-own.png"}
    write_calibration(found, tmp_path)
    (tmp_path / "figures" / "residuals.png").write_bytes(b"drawn anew by hand")
    with pytest.raises(InputError, match=r"figures/residuals\.png is there and of unknown origin"):
        check_folder(tmp_path)
