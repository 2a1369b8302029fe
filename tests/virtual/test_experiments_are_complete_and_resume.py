"""A virtual experiment: its trials, its planted spread, its table; a rerun keeps what is there."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.measurement.observations import read_observations
from spirillum.units import Hz
from spirillum.virtual.experiment import virtual_experiment
from spirillum.vision.setup import load_setup

SMALL: dict[str, Any] = {
    "trials": 2,
    "duration": "0.1 s",
    "camera": {"size": (96, 64)},
    "motion": {"tail_rate": "1.2 Hz"},
}


def test_all_files_are_there_and_a_rerun_keeps_them(tmp_path: Path) -> None:
    told: list[tuple[str, int, int]] = []
    folder = tmp_path / "e"
    first = virtual_experiment(None, folder, **SMALL, jobs=2, progress=lambda *words: told.append(words))
    assert first.robots == ("biorob2012-wide", "biorob2012-narrow")
    assert told[-1][1:] == (4, 4)
    assert all("model" in robot for robot in first.to_dict()["robots"])
    names = {path.name for path in (folder / "biorob2012-wide").iterdir()}
    ends = ("mp4", "truth.json", "truth.nc")
    assert names == {"setup.toml", *(f"trial-{number}.{end}" for number in (1, 2) for end in ends)}
    assert load_setup(folder / "biorob2012-narrow" / "setup.toml")[1].name == "biorob2012-narrow"
    lost = folder / "biorob2012-wide" / "trial-2.mp4"
    before, content = (folder / "biorob2012-wide" / "trial-1.mp4").stat().st_mtime_ns, lost.read_bytes()
    lost.unlink()
    second = virtual_experiment(None, folder, **SMALL)
    assert second.kept == 3
    assert lost.read_bytes() == content
    assert (folder / "biorob2012-wide" / "trial-1.mp4").stat().st_mtime_ns == before
    with pytest.raises(sp.InputError, match="another virtual experiment"):
        virtual_experiment(None, folder, **(SMALL | {"trials": 3}))


def test_damaged_files_are_made_again(tmp_path: Path) -> None:
    options = SMALL | {"trials": 1, "study": {"robots": ["biorob2012-wide"]}, "output": tmp_path / "e"}
    virtual_experiment(**options)
    folder = tmp_path / "e" / "biorob2012-wide"
    assert virtual_experiment(**options).kept == 1
    film = (folder / "trial-1.mp4").read_bytes()
    for name, damage in (
        ("trial-1.mp4", b""),
        ("trial-1.mp4", film[:-100]),
        ("trial-1.mp4", film + b"more"),
        ("trial-1.truth.json", b"{"),
        ("trial-1.truth.nc", b"nc"),
        ("setup.toml", b""),
    ):
        whole = (folder / name).read_bytes()
        (folder / name).write_bytes(damage)
        assert virtual_experiment(**options).kept == 0
        assert (folder / name).read_bytes()[:8] == whole[:8]
    assert virtual_experiment(**options).kept == 1


def test_the_table_is_an_observations_file_and_every_rate_has_the_same_factor(tmp_path: Path) -> None:
    found = virtual_experiment({"robots": ["biorob2012-wide"]}, tmp_path / "e", **SMALL, spread=0.1)
    rows = read_observations(found.observations)
    assert found.observations.read_text().startswith("# SYNTHETIC: ")
    steady = found.rates["biorob2012-wide"]
    assert steady["tail_rotation_rate"] == pytest.approx(1.2 * Hz)
    for row in rows:
        factor = row.tail_rate / (1.2 * Hz)
        assert row.forward_velocity == pytest.approx(factor * steady["forward_velocity"], rel=1e-6)
        assert row.body_rate == pytest.approx(factor * steady["body_rotation_rate"], rel=1e-6)
        assert row.motor_rate == pytest.approx(row.tail_rate - row.body_rate, rel=1e-6)
    assert rows[0].tail_rate != rows[1].tail_rate


def test_the_table_can_be_joined_with_what_is_measured(tmp_path: Path) -> None:
    """The robot's name is that of the robot file beside the films, the trial's that of its film."""
    study = {"robots": ["biorob2012-wide"], "vary": {"tail.wavelength": ["20 mm", "25 mm"]}, "models": ["rft"]}
    found = virtual_experiment(study, tmp_path / "e", **SMALL)
    rows = {(row.robot, row.trial) for row in read_observations(found.observations)}
    films = sorted((tmp_path / "e").glob("*/*.mp4"))
    assert rows == {(load_setup(film.parent / "setup.toml")[1].name, film.stem) for film in films}
    assert len(rows) == len(films) == 4
    assert found.robots != tuple(dict.fromkeys(robot for robot, _ in sorted(rows)))


def test_robots_move_and_are_drawn_where_the_study_lays_them(tmp_path: Path) -> None:
    place = {"gap": "0.2 mm", "pitch": "0 deg"}
    study = {"robots": ["biorob2012-wide"], "models": ["tube"], "placement": place}
    found = virtual_experiment(study, tmp_path / "e", **SMALL)
    there = sp.predict("biorob2012-wide", model="tube", tail_rate="1.2 Hz", placement=place)
    assert found.rates["biorob2012-wide"]["forward_velocity"] == pytest.approx(there.forward_velocity, rel=1e-9)
    setup, robot = load_setup(tmp_path / "e" / "biorob2012-wide" / "setup.toml")
    assert setup.robot.axis_height == pytest.approx(0.002 + 0.5 * robot.body.diameter + 0.0002)


def test_a_grid_gives_each_tail_a_folder_and_the_spread_its_size(tmp_path: Path) -> None:
    grid = {"channels": {"w": "biorob2012-wide"}, "wavelengths": ["20 mm", "25 mm"], "amplitudes": ["2 mm"]}
    found = virtual_experiment({"grid": grid, "models": ["rft"]}, tmp_path / "e", **SMALL)
    assert found.robots == ("biorob2012-wide-20-2", "biorob2012-wide-25-2")
    setup, robot = load_setup(tmp_path / "e" / "biorob2012-wide-20-2" / "setup.toml")
    assert setup.robot.file == "robot.toml"
    assert robot.tail.wavelength == pytest.approx(0.020)


def test_the_planted_spread_has_its_size() -> None:
    from spirillum.robot.load import load
    from spirillum.virtual.experiment import _Plan, _planned
    from spirillum.virtual.trial_options import CameraOptions

    steady = {"forward_velocity": 1e-3, "tail_rotation_rate": 7.0, "body_rotation_rate": -0.5}
    plan = _Plan.of({"trials": 400, "spread": 0.02})
    plans = _planned((0, "w"), load("biorob2012-wide"), None, steady, plan, CameraOptions())
    factors = np.array([plan.rates["tail_rotation_rate"] for plan in plans]) / 7.0
    assert factors.std() == pytest.approx(0.02, rel=0.1)
    assert factors.mean() == pytest.approx(1.0, abs=0.003)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"trials": 0}, "trials"),
        ({"spread": 0.5}, "spread"),
        ({"jobs": 0}, "jobs"),
        ({"motion": {"model": "x"}}, "model"),
        ({"duration": "0 s"}, "duration"),
    ],
)
def test_wrong_options_get_one_sentence(tmp_path: Path, options: dict[str, Any], words: str) -> None:
    with pytest.raises(sp.InputError, match=words):
        virtual_experiment(None, tmp_path / "e", **(SMALL | options))
    assert not (tmp_path / "e").exists()
