"""Another program's track is held against the robot in the picture: its unit cannot be known from its numbers."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numpy as np
import pytest

from spirillum.errors import InputError
from spirillum.measurement.measure import Measurement
from spirillum.measurement.setup_template import setup_answer
from spirillum.results.measurement import measure

pytest.importorskip("av")
pytest.importorskip("cv2")
pytestmark = pytest.mark.usefixtures("learning_shared")


class Scene(NamedTuple):
    """A drawn film, its setup, and where the robot's middle is in its pictures."""

    film: Path
    setup: Path
    places: np.ndarray

    def table(self, change: Callable[[np.ndarray], np.ndarray]) -> Path:
        rows = [f"{x:.4f},{y:.4f},{k}" for k, (x, y) in enumerate(change(self.places))]
        path = self.film.with_name("track.csv")
        path.write_text("x,y,frame\n" + "\n".join(rows) + "\n")
        return path


@pytest.fixture(scope="module")
def scene(flat_pictures: ModuleType, tmp_path_factory: pytest.TempPathFactory, learning_shared: None) -> Scene:
    """A robot at 2 mm/s for 2 s; where it is, our own tracker says of the whole film."""
    film = tmp_path_factory.mktemp("tracks") / "a.mp4"
    setup = flat_pictures.Flat(frames=20, fps=10.0, velocity=2e-3, tail_rate=5.0, body_rate=-1.0).write(film)
    (trial,) = measure(film, setup).trials
    return Scene(film, setup, trial.track.picture[:, :2])


@pytest.fixture(scope="module")
def taken(scene: Scene) -> Measurement:
    """What is measured by the robot's own places."""
    return measure(scene.film, scene.setup, track=scene.table(lambda places: places))


def test_a_track_in_pixels_is_taken(taken: Measurement) -> None:
    (trial,) = taken.trials
    assert [flag.name for flag in trial.flags if "track" in flag.name] == []
    assert trial.quantities["forward_velocity"].value == pytest.approx(2e-3, rel=0.01)


@pytest.mark.parametrize(
    "change",
    [lambda places: 0.2 * places, lambda places: np.array([0.0, 239.0]) - np.array([-1.0, 0.4]) * places],
    ids=["millimetres", "upwards"],
)
def test_a_track_beside_the_robot_is_refused(scene: Scene, change: Callable[[np.ndarray], np.ndarray]) -> None:
    with pytest.raises(InputError, match=r"track\.csv places the robot at .* but the picture shows .*allowed: pixels"):
        measure(scene.film, scene.setup, track=scene.table(change))


def test_a_track_that_moves_otherwise_is_flagged(scene: Scene) -> None:
    """About the robot's place, in pixels of half the size."""
    table = scene.table(lambda places: places[0] + 0.5 * (places - places[0]))
    (trial,) = measure(scene.film, scene.setup, track=table).trials
    assert "track-moves-otherwise" in [flag.name for flag in trial.flags]


def test_a_track_that_cannot_be_compared_is_flagged(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*_: object) -> None:
        raise InputError("no robot")

    monkeypatch.setattr("spirillum.measurement.imported.learnt_from", none)
    (trial,) = measure(scene.film, scene.setup, track=scene.table(lambda places: 0.2 * places)).trials
    assert "track-not-checked" in [flag.name for flag in trial.flags]


def test_what_a_check_says_of_uncertainties_a_measurement_repeats(
    scene: Scene, taken: Measurement, tmp_path: Path
) -> None:
    table = scene.table(lambda places: places)
    remark = [words for words in setup_answer(scene.setup)["warnings"] if "states no uncertainty" in words]
    assert len(remark) == 1
    assert taken.warnings.count(remark[0]) == 1
    known = tmp_path / "known.toml"
    known.write_text('camera.height_uncertainty = "2 mm"\n' + scene.setup.read_text())
    assert remark[0] not in measure(scene.film, known, track=table).warnings
