"""What is sent to the bench: refused where it is no film, kept under the page's own names, and removed with it."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from spirillum.errors import InputError
from spirillum.pages import video_store as films_module
from spirillum.pages.measurement_session import MeasurementSession, form_fields
from spirillum.pages.video_store import TooLargeError
from spirillum.robot.load import load

WHOLE = {
    "robot.file": "biorob2012-wide",
    "camera.height": "210 mm",
    "markers.spacing": "2 mm",
    "markers.height": "0 mm",
    "robot.axis_height": "11.5 mm",
}


@pytest.fixture
def session() -> Any:
    pytest.importorskip("av")
    pytest.importorskip("cv2")
    made = MeasurementSession()
    yield made
    made.close()
    assert not made._folder.exists()


def test_a_file_that_is_no_film_is_refused_and_removed(session: MeasurementSession) -> None:
    for kind in ("exe", "mp4/../../x", "m3u8", ""):
        with pytest.raises(InputError, match=r"allowed: \.mp4"):
            session.films.room_for(kind, 1)
    path = session.films.room_for("mp4", 14)
    path.write_bytes(b"no film at all")
    with pytest.raises(InputError) as refused:
        session.films.add(path)
    assert str(session._folder) not in str(refused.value)
    assert not path.exists()
    assert session.films.describe() == []


def test_films_on_their_way_count_with_all_their_bytes(
    session: MeasurementSession, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(films_module, "_LARGEST_ALL", 1000)
    coming = session.films.room_for("mp4", 400)
    session.films.room_for("mp4", 600).write_bytes(bytes(600))
    with pytest.raises(TooLargeError, match="room on the disk"):
        session.films.room_for("mp4", 1)
    coming.unlink()
    session.films.room_for("mp4", 400)
    monkeypatch.setattr(films_module, "_LARGEST_FILM", 100)
    with pytest.raises(TooLargeError, match="GB per video"):
        session.films.room_for("mp4", 101)


def test_the_disk_has_room_for_films_on_their_way(session: MeasurementSession, monkeypatch: pytest.MonkeyPatch) -> None:
    free = films_module._SPARE + 1000
    monkeypatch.setattr(films_module.shutil, "disk_usage", lambda _: SimpleNamespace(free=free))
    session.films.room_for("mp4", 700).write_bytes(bytes(200))  # 500 of the free bytes are still to come
    with pytest.raises(TooLargeError, match="room on the disk"):
        session.films.room_for("mp4", 501)
    session.films.room_for("mp4", 500)


@pytest.mark.parametrize(
    "fields",
    [
        {"robot.file": "/etc/passwd"},
        {"robot.file": "../robot.toml"},
        {"robot.file": "robot.toml"},
        {"camera.checkerboard.images": "/etc"},
        {"camera.height": ["210 mm"]},
        {"camera.height": "9" * 500},
        {"camera.height": "\ud800"},
        {"robot.stripes": "red\0"},
    ],
)
def test_no_field_names_a_file(session: MeasurementSession, fields: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="allowed"):
        session.editor.set_fields(fields)


def test_a_dropped_robot_may_not_rest_on_another_file(session: MeasurementSession, tmp_path: Path) -> None:
    (tmp_path / "secret.toml").write_text("secret = 1\n")
    with pytest.raises(InputError, match="allowed on the page") as refused:
        session.editor.add_text(f'extends = "{tmp_path / "secret.toml"}"\n')
    assert "secret = 1" not in str(refused.value)
    session.editor.add_text('extends = "biorob2012-wide"\nname = "mine"\n[tail]\nwavelength = "20 mm"\n')
    assert session.editor.fields()["robot.file"] == "robot.toml"
    assert session.editor.robot_text() == session.editor.robot_text()
    assert 'wavelength = "20 mm"' in session.editor.robot_text()


def test_a_dropped_setup_fills_the_form_and_is_the_same_file_again(session: MeasurementSession, tmp_path: Path) -> None:
    from spirillum.vision.setup import load_setup

    session.editor.set_fields(WHOLE)
    assert session.editor.checked()["problems"] == []
    text = session.editor.setup_text()
    session.editor.set_fields({"robot.file": "biorob2012-wide"})
    assert session.editor.checked()["problems"]
    session.editor.add_text(text)
    assert session.editor.setup_text() == text
    (tmp_path / "setup.toml").write_text(text)
    setup, robot = load_setup(tmp_path / "setup.toml")
    assert setup.camera.height == pytest.approx(0.21)
    assert robot == load("biorob2012-wide")


def test_wrong_numbers_get_a_sentence_with_their_field(session: MeasurementSession) -> None:
    session.editor.set_fields({**WHOLE, "tank.index": "oil", "robot.axis_height": "3 km"})
    problems = session.editor.checked()["problems"]
    assert any(one.startswith("tank.index") for one in problems)
    assert any(one.startswith("robot.axis_height") for one in problems)
    with pytest.raises(InputError, match="no video"):
        session.measure()


@pytest.mark.parametrize("value", ["nan", "-inf", "1e400", float("nan")])
@pytest.mark.parametrize("field", ["tank.index", "tank.index_uncertainty", "camera.frames_per_second"])
def test_numbers_that_json_has_not_are_told_by_their_field(session: MeasurementSession, field: str, value: Any) -> None:
    session.editor.set_fields({**WHOLE, "tank.surface": "60 mm", field: value})
    assert [one for one in session.editor.checked()["problems"] if one.startswith(field)]
    json.dumps(session.state(), allow_nan=False)


def test_places_are_counted_when_they_are_given(session: MeasurementSession, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(films_module, "_MOST_FILMS", 2)
    session.films.room_for("mp4", 1).unlink()
    session.films.room_for("mp4", 1)
    session.films.room_for("mp4", 1)
    with pytest.raises(TooLargeError, match="2 videos are uploaded already"):
        session.films.room_for("mp4", 1)


def test_decimal_commas_are_numbers() -> None:
    assert form_fields({"tank.index": "1,4", "end": ""}, ()) == {"tank.index": 1.4}
