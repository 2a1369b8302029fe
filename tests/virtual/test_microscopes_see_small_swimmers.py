"""A smaller field of view: the ruler becomes a stage micrometer, and a swimmer of 2 mm is measured as any other."""

from pathlib import Path

import numpy as np
import pytest

import spirillum as sp
from spirillum.virtual.optics import lens_of, tank_of
from spirillum.virtual.trial_options import CameraOptions

SMALL = {
    "extends": "magnetic-helix",
    "name": "two-millimetres",
    "body": {"diameter": "0.4 mm", "length": "0.8 mm", "mass": "0.12 mg"},
    "coupling": {"diameter": "0.1 mm", "length": "0.1 mm", "clearance": "0.01 mm"},
    "tail": {"wavelength": "0.6 mm", "amplitude": "0.12 mm", "length": "1.2 mm", "wire_diameter": "0.05 mm"},
    "magnetic": {"moment": "7e-5 A m^2", "rotation_rate": "5 Hz"},
}


@pytest.mark.parametrize("width", ["1 mm", "6 mm", "50 mm", "1 m"])
def test_picture_is_as_wide_as_asked_for(width: str) -> None:
    camera = CameraOptions.of({"field_of_view": width, "size": "320x240", "distortion": 0.0})
    lens = lens_of(camera, (0.0, 0.0))
    left, right = lens.points(np.array([[0.0, 119.5], [319.0, 119.5]]), 0.0)[:, 0]
    # refraction at the surface makes the picture's edges see a little less than rays along the axis say
    assert right - left == pytest.approx(camera.field_of_view * 319.0 / 320.0, rel=0.15 if width == "1 m" else 3e-3)


@pytest.mark.parametrize(
    ("width", "spacing"), [(None, 2e-3), ("1 m", 2e-2), ("20 mm", 5e-4), ("6 mm", 1e-4), ("1 mm", 2e-5)]
)
def test_ruler_is_one_that_exists_with_about_as_many_lines(width: str | None, spacing: float) -> None:
    camera = CameraOptions.of({"field_of_view": width})
    assert tank_of(sp.load(SMALL), "top", camera.shrunk).spacing == pytest.approx(spacing, rel=1e-12)


def test_a_swimmer_of_two_millimetres_is_measured(tmp_path: Path) -> None:
    camera = {"field_of_view": "4 mm", "size": "320x240"}
    trial = sp.render(SMALL, tmp_path / "small.mp4", trial={"duration": "3 s"}, camera=camera)
    found = sp.measure(trial.path, trial.setup).trials[0]
    for name in ("forward_velocity", "tail_rotation_rate"):
        rate, truth = found.fits[name], trial.rates[name]
        assert rate.low < truth < rate.high
        assert rate.high - rate.low < 0.02 * truth


def test_what_the_field_cannot_show_is_refused() -> None:
    with pytest.raises(sp.InputError, match=r"two-millimetres is 2\.1 mm long; allowed: 6\.\d+ to"):
        sp.render(SMALL, "never.mp4")
    with pytest.raises(sp.InputError, match=r"field_of_view = 0\.5 mm; allowed: 1 to 1000 mm"):
        sp.render(SMALL, "never.mp4", camera={"field_of_view": "0.5 mm"})
    with pytest.raises(sp.InputError, match=r"field_of_view = -5 mm; allowed: 1 to 1000 mm"):
        sp.render(SMALL, "never.mp4", camera={"field_of_view": "-5 mm"})


@pytest.mark.parametrize(
    ("view", "lateral", "words"),
    [
        ("top", "1 m", "never in the picture, 1000 mm beside its centre; allowed: a lateral nearer to 0"),
        ("top", "-20 mm", "never in the picture, -20 mm beside its centre; allowed: a lateral nearer to 0"),
        ("side", "1 m", "under the floor|above the oil"),
        ("side", "-1 m", "under the floor|above the oil"),
    ],
)
def test_a_robot_beside_the_picture_is_refused(view: str, lateral: str, words: str) -> None:
    with pytest.raises(sp.InputError, match=words):
        sp.render(SMALL, "never.mp4", camera={"field_of_view": "6 mm", "view": view}, trial={"lateral": lateral})
