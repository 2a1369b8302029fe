"""What a film tells of its setup is found at any scale, and what it cannot tell is left to be filled in."""

from dataclasses import replace

import numpy as np
import pytest

import spirillum as sp
from spirillum.errors import InputError
from spirillum.measurement.setup_template import setup_answer, setup_text
from spirillum.units import KINDS, parse_option
from spirillum.vision.setup import load_setup
from spirillum.vision.track import setup_free_detection

pytest.importorskip("av")
cv2 = pytest.importorskip("cv2")


@pytest.fixture(scope="module")
def film(flat_pictures, tmp_path_factory):
    """A robot that swims to the left, in a flat drawing."""
    path = tmp_path_factory.mktemp("proposal") / "a.mp4"
    flat_pictures.Flat(frames=12, fps=4.0, velocity=2e-3, direction="left", tail_rate=5.0, body_rate=-1.0).write(path)
    return path


@pytest.fixture(scope="module")
def proposed(film):
    """What is proposed for it, written beside it."""
    return sp.propose_setup(film, "biorob2012-wide", film.with_name("setup.toml"), spacing="2 mm")


def test_what_the_film_shows_is_found_and_the_rest_is_marked(film, proposed):
    found = proposed
    assert {name: found.found(name).value for name in ("direction", "robot")} == {
        "direction": "left", "robot": "biorob2012-wide",
    }  # fmt: skip
    assert found.found("frame_rate").value == pytest.approx(4.0)
    assert found.found("ruler").value == pytest.approx(350.0 * 0.002 / 0.2, rel=1e-2)
    assert found.found("travel").value == pytest.approx(2e-3 * 350.0 / (0.2 - 0.015), rel=0.05)
    assert found.found("stripes").value[:4] == ["red", "yellow", "green", "blue"]
    ((rear, nose),) = found.found("robot").pixels
    assert np.hypot(nose[0] - rear[0], nose[1] - rear[1]) == pytest.approx(35e-3 * 350.0 / (0.2 - 0.015), rel=0.03)
    assert nose[0] < rear[0]
    left = {field for field, _ in found.to_fill}
    assert left == {"camera.view", "camera.height", "tank.surface", "tank.index", "markers.height", "robot.axis_height"}
    written = film.with_name("setup.toml")
    assert written.read_text() == found.text
    with pytest.raises(InputError, match=r"camera.view = 'FILL IN' is not allowed.*\(and 5 more: camera.height, "):
        load_setup(written)


def test_a_setup_that_is_there_is_refused_before_the_work(film, tmp_path):
    (tmp_path / "setup.toml").touch()
    looks: list[str] = []
    with pytest.raises(sp.InputError, match=r"setup\.toml exists; allowed: a new file, or --force"):
        sp.propose_setup(film, output=tmp_path / "setup.toml", progress=lambda what, *_: looks.append(what))
    assert not looks


def test_heights_to_fill_in_are_not_exact(film, proposed):
    """Each has an uncertainty that is active, as in the file of `setup new`."""
    import tomllib

    table, example = tomllib.loads(proposed.text), tomllib.loads(setup_text())
    for part, key in (("camera", "height"), ("tank", "surface"), ("tank", "index"), ("markers", "height"),
                      ("robot", "axis_height")):  # fmt: skip
        assert table[part][key] == "FILL IN"
        assert table[part][f"{key}_uncertainty"] == example[part][f"{key}_uncertainty"]


def test_a_filled_in_proposal_is_a_setup_that_fits_the_film(film, proposed, tmp_path):
    known = {"view": '"top"', "height": '"200 mm"', "axis_height": '"15 mm"'}
    lines, section = [], ""
    for line in proposed.text.splitlines():
        name = line.partition(" = ")[0]
        section = line if line.startswith("[") else section
        if section == "[tank]":
            continue
        value = '"0 mm"' if section == "[markers]" else known.get(name)
        lines.append(f"{name} = {value}" if '"FILL IN"' in line else line)
    (tmp_path / "setup.toml").write_text("\n".join(lines))
    answer = setup_answer(tmp_path / "setup.toml", film)
    assert answer["film"]["frames_with_robot"] > 10
    assert answer["film"]["apparent_body_size"] == pytest.approx(1.0, abs=0.01)
    assert answer["film"]["length_per_pixel"]["value"] == pytest.approx((0.2 - 0.015) / 350.0, rel=2e-3)
    assert not any("does not" in warning for warning in answer["warnings"])


@pytest.mark.slow
def test_a_wrong_spacing_is_named(film):
    warnings = sp.propose_setup(film, spacing="3 mm").warnings
    assert any("spacing = 3 mm does not fit: by the robot's size the lines are 1.8" in one for one in warnings)


@pytest.mark.slow
@pytest.mark.parametrize("spacing", ["1 nm", "0.05 mm", "20 m"])
def test_a_spacing_of_another_order_is_named(film, spacing):
    """By it the robot would be a dot, or kilometres away."""
    assert any(
        f"spacing = {1e3 * parse_option('', spacing, KINDS['length']):.4g} mm" in one
        for one in sp.propose_setup(film, spacing=spacing).warnings
    )


@pytest.mark.slow
def test_without_a_ruler_the_robot_gives_the_scale_and_another_order_of_stripes_is_read(flat_pictures, tmp_path):
    order = ("red", "green", "yellow", "blue") * 2
    film = flat_pictures.Flat(frames=20, fps=8.0, ruler=False, stripes=order, body_rate=-3.0)
    film.write(tmp_path / "a.mp4")
    found = sp.propose_setup(tmp_path / "a.mp4", "biorob2012-wide")
    assert tuple(found.found("stripes").value) == order
    assert 'stripes = ["red", "green", "yellow", "blue"' in found.text
    assert found.found("ruler").confidence == "not found"
    (line,) = [line for line in found.text.splitlines() if line.startswith("length_per_pixel =")]
    assert float(line.split('"')[1].removesuffix(" mm")) == pytest.approx(1e3 * (0.2 - 0.015) / 350.0, rel=0.03)


def test_a_film_without_a_robot_says_what_is_missing(flat_pictures, tmp_path, monkeypatch):
    """With a ruler the setup is written as far as it goes; without one there is nothing to write."""
    monkeypatch.setattr(setup_free_detection, "best_other_size", lambda *given: None)  # it takes a while
    monkeypatch.setattr(setup_free_detection, "SETUP_FREE", replace(setup_free_detection.SETUP_FREE, shares=(0.25,)))
    empty = {"frames": 2, "start": (1.0, 0.0), "noise": 4.0}
    flat_pictures.Flat(**empty, size=(240, 120), focal=260.0, spacing=3e-3).write(tmp_path / "a.mp4")
    looks = []
    found = sp.propose_setup(tmp_path / "a.mp4", progress=lambda what, done, total: looks.append((what, done, total)))
    assert found.found("robot").confidence == "not found"
    assert any("give the right ROBOT" in warning for warning in found.warnings)
    assert looks[:2] == [("reading frames", 0, 1), ("looking for the ruler", 0, 1)]
    assert looks[2][:2] == ("looking for the robot", 0)  # before the first look, which takes a while
    assert looks[-1][0] == "looking for the robot"
    assert looks[-1][1] == looks[-1][2]
    with pytest.raises(InputError, match=r"spacing .* out of range"):
        sp.propose_setup(tmp_path / "a.mp4", spacing=0.0)
    monkeypatch.setattr(
        setup_free_detection, "_looked", lambda *given: None
    )  # where the robot is not in the first film either
    flat_pictures.Flat(**empty, size=(160, 120), focal=175.0).write(tmp_path / "b.mp4")
    with pytest.raises(InputError, match=r"b\.mp4 shows neither a ruler nor a robot like 'biorob2012-wide'"):
        sp.propose_setup(tmp_path / "b.mp4", output=tmp_path / "setup.toml")
    assert not (tmp_path / "setup.toml").exists()


@pytest.mark.parametrize("frames", [1, 12])
def test_noise_is_no_robot_and_no_film(tmp_path, frames):
    rng = np.random.default_rng(0)
    for index in range(frames):
        cv2.imwrite(str(tmp_path / f"{index:02d}.png"), rng.integers(0, 256, (240, 320, 3), dtype=np.uint8))
    with pytest.raises(InputError, match=r"shows noise alone: neighbouring pixels correlate by -?0\.0"):
        sp.propose_setup(tmp_path, fps=30.0)


@pytest.mark.slow
def test_in_a_large_picture_the_body_lies_at_both_its_ends(tmp_path):
    """A body 3 % too long lay now at its nose, now at its rear, 14 pixels apart, and its speed was a fifth off."""
    sp.render(
        "biorob2012-wide",
        tmp_path / "large.mp4",
        motion={"forward_velocity": "1.5 mm/s", "tail_rate": "1.3 Hz", "body_rate": "-0.12 Hz"},
        trial={"duration": 2.0, "heading": 0.02},
        camera={"size": "1920x1440", "direction": "left"},
        seed=3,
    )
    found = sp.propose_setup(tmp_path / "large.mp4", spacing="2 mm")
    pixels_per_metre = 2220.0 / (0.15 + (0.06 - 0.0115) / 1.4)  # lens 150 mm above the oil, axis at 11.5 mm
    ((rear, nose),) = found.found("robot").pixels
    assert np.hypot(nose[0] - rear[0], nose[1] - rear[1]) == pytest.approx(35e-3 * pixels_per_metre, rel=5e-3)
    assert found.found("travel").value == pytest.approx(1.5e-3 * pixels_per_metre, rel=0.02)
