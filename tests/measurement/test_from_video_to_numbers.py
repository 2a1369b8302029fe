"""A flat drawn film of known motion, through tracking, statistics and files, against its truth."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flat_pictures
from spirillum.results.measurement import measure

av = pytest.importorskip("av")
pytest.importorskip("cv2")


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Path, Path]:
    """The film's truth, its file and its setup: 3 s at 8 frames a second, two of them dropped."""
    flat = flat_pictures.flat(
        frames=24, fps=8.0, velocity=1.5e-3, body_rate=-1.1, fine=3, dropped=frozenset({11, 12}), direction="left"
    )
    path = tmp_path_factory.mktemp("film") / "flat.mp4"
    setup = flat.write(path)
    lines = setup.read_text().splitlines(keepends=True)
    setup.write_text("".join(line for line in lines if "frames_per_second" not in line))  # the film's own times count
    return flat, path, setup


@pytest.fixture(scope="module")
def measured(film: tuple[Any, Path, Path], tmp_path_factory: pytest.TempPathFactory) -> tuple[Any, Path]:
    _, path, setup = film
    folder = tmp_path_factory.mktemp("out")
    return measure(path, setup, folder), folder


def test_speed_and_rates_against_what_was_drawn(film: tuple[Any, Path, Path], measured: tuple[Any, Path]) -> None:
    flat, found = film[0], measured[0]
    truth = {
        "forward_velocity": flat.velocity,
        "body_rotation_rate": flat.body_rate,
        "tail_rotation_rate": flat.tail_rate,
        "motor_rotation_rate": flat.tail_rate - flat.body_rate,
    }
    for name, value in truth.items():
        item = found.trials[0].quantities[name]
        assert item.value == pytest.approx(value, rel=0.01)
        assert item.low < item.value < item.high
    assert found.trials[0].track.time.size == 22


def test_the_annotated_film_keeps_frames_and_times_and_draws_the_outline(
    film: tuple[Any, Path, Path], measured: tuple[Any, Path]
) -> None:
    def decoded(path: Path) -> tuple[np.ndarray, np.ndarray]:
        with av.open(str(path)) as container:
            frames = [(float(f.time), f.to_ndarray(format="rgb24").astype(int)) for f in container.decode(video=0)]
        return np.array([time for time, _ in frames]), np.array([image for _, image in frames])

    times, drawn = decoded(measured[1] / "flat.annotated.mp4")
    original, plain = decoded(film[1])
    assert times - times[0] == pytest.approx(original - original[0], abs=1e-4)
    changed = np.abs(drawn - plain).max(axis=3) > 60
    u, v = measured[0].trials[0].track.picture[20, :2].round().astype(int)
    assert changed[20, v - 40 : v + 40, u - 80 : u + 80].sum() > 100
    lower = changed[20, -30:]
    assert lower.mean() < 0.01


def test_the_page_shows_a_frame(measured: tuple[Any, Path]) -> None:
    page = (measured[1] / "report.html").read_text()
    assert "data:image/jpeg;base64," in page
    assert set(measured[0].files) >= {"flat.annotated.mp4", "flat.nc", "report.html", "observations.csv"}


def test_clicks_on_the_same_film_give_the_same_speed(film: tuple[Any, Path, Path], tmp_path: Path) -> None:
    """Every ninth frame, clicked exactly on the projected mid-length: scale and times come from the video."""
    flat, path, setup = film
    rows = ["frame,x_px,y_px"]
    for index, time in enumerate(flat.times):
        if index % 9 == 0:
            u, v = flat.pixels(flat.placed(np.zeros((1, 3)), float(time)))[0]
            rows.append(f"{index},{u:.6f},{v:.6f}")
    marks = tmp_path / "marks.csv"
    marks.write_text("\n".join(rows))
    found = measure(path, setup, marks=marks, tracking=False).to_dict()
    velocity = found["trials"][0]["forward_velocity"]
    assert velocity["value"] == pytest.approx(flat.velocity, rel=2e-3)
    assert json.dumps(found, allow_nan=False)


def test_readings_of_a_synthetic_film_are_synthetic_too(film: tuple[Any, Path, Path], tmp_path: Path) -> None:
    _, path, setup = film
    synthetic, marks = tmp_path / "computed.mp4", tmp_path / "marks.csv"
    with av.open(str(path)) as source, av.open(str(synthetic), "w") as target:
        stream = target.add_stream_from_template(source.streams.video[0])
        target.metadata["comment"] = "synthetic"
        for packet in source.demux(video=0):
            if packet.dts is not None:
                packet.stream = stream
                target.mux(packet)
    marks.write_text("time_s,x_mm,tail_phase_deg\n0,0,0\n1,1.5,300\n2,3.1,610\n")
    found = measure(synthetic, setup, tmp_path / "out", marks=marks, tracking=False, figures=False)
    assert "synthetic" in [flag.name for flag in found.trials[0].flags]
    assert "SYNTHETIC" in (tmp_path / "out" / "observations.csv").read_text(encoding="utf-8")
