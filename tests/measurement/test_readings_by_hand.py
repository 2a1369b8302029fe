"""Readings by hand, and other programs' tracks, give the same statistics; bad tables one sentence each."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spirillum import InputError
from spirillum.measurement.imported import read_track
from spirillum.measurement.marks import (
    Ruled,
    check_pixels,
    check_times,
    corrected,
    frames_read,
    read_marks,
    track_of_marks,
)
from spirillum.measurement.trials import trial_of
from spirillum.vision.camera.scale import Scale
from spirillum.vision.track.track import Track

PIXEL = 0.25e-3
RULED = Ruled.plain(Scale(PIXEL, 0.0, {}, 80, 0.05), (640, 480), leftward=False)


def seconds(frames: np.ndarray) -> np.ndarray:
    return frames / 30.0


def frames_at(times: np.ndarray) -> np.ndarray:
    """Frames at 30 frames a second; none is as far off as a third of a step."""
    near = np.round(30.0 * times)
    return np.where(np.abs(30.0 * times - near) < 0.33, near, np.nan)


def written(folder: Path, text: str) -> Path:
    path = folder / "marks.csv"
    path.write_text(text)
    return path


def test_a_few_readings_give_speed_and_rates(tmp_path: Path, make_track: Callable[..., Track], robot: Any) -> None:
    """Every tenth frame of a robot at 1 mm/s with its tail at 0.5 Hz and its body at -0.05 Hz, exact."""
    rows = [f"{f},{319.5 + 1e-3 * f / 30 / PIXEL:.9f},{180 * f / 30:.9f},{-18 * f / 30:.9f}" for f in range(0, 301, 10)]
    path = written(tmp_path, "# by hand\nframe,x_px,tail_phase_deg,body_angle_deg\n" + "\n".join(rows))
    track = track_of_marks(read_marks(path)[""], make_track().setup, "a.mp4", RULED, seconds)
    found = trial_of(track, robot).quantities
    assert found["forward_velocity"].value == pytest.approx(1e-3, rel=1e-6)
    assert found["tail_rotation_rate"].value == pytest.approx(np.pi, rel=1e-6)
    assert found["body_rotation_rate"].value == pytest.approx(-np.pi / 10, rel=1e-6)
    assert found["motor_rotation_rate"].value == pytest.approx(1.1 * np.pi, rel=1e-6)
    assert np.isnan(found["heading"].value)
    assert track.flags[0].name == "by-hand"


def test_angles_within_a_turn_are_counted_on_and_others_stay(tmp_path: Path) -> None:
    within = read_marks(written(tmp_path, "frame,tail_phase_deg\n0,300\n10,350\n20,40\n30,90\n"))[""]
    assert np.degrees(within.tail_phase) == pytest.approx([300, 350, 400, 450])
    beyond = read_marks(written(tmp_path, "frame,tail_phase_deg\n0,0\n10,250\n20,500\n30,750\n"))[""]
    assert np.degrees(beyond.tail_phase) == pytest.approx([0, 250, 500, 750])


def test_what_was_counted_within_a_turn_is_flagged(tmp_path: Path, make_track: Callable[..., Track]) -> None:
    for text, flags in (("0,300\n10,40\n20,90", ["by-hand", "counted-within-a-turn"]), ("0,0\n10,400", ["by-hand"])):
        marks = read_marks(written(tmp_path, f"frame,tail_phase_deg\n{text}\n"))[""]
        track = track_of_marks(marks, make_track().setup, "a.mp4", None, seconds)
        assert [flag.name for flag in track.flags] == flags


def test_a_time_after_the_end_of_the_video_is_refused(tmp_path: Path) -> None:
    marks = read_marks(written(tmp_path, "time_s,tail_phase_deg\n0,0\n8,20\n100,40\n"))[""]
    check_times(marks, None)
    check_times(marks, 100.0)
    with pytest.raises(InputError, match=r"row 4, column time_s: 100; allowed: 0 to 8\.03 s"):
        check_times(marks, 8.03)


@pytest.mark.parametrize("scale", ["mm", "px"])
def test_three_readings_on_a_line_have_the_interval_of_an_eyes_error(
    tmp_path: Path, make_track: Callable[..., Track], robot: Any, scale: str
) -> None:
    """No residuals but the eye's own: s^2 = eye^2 / 2 of two, and times -1, 0, 1 s have a sum of squares of 2."""
    rows = [(time, time if scale == "mm" else 100 + 1e-3 * time / PIXEL) for time in (0, 1, 2)]
    text = "\n".join(f"{time},{x:.9f}" for time, x in rows)
    marks = read_marks(written(tmp_path, f"time_s,x_{scale}\n{text}\n"))[""]
    track = track_of_marks(marks, make_track().setup, "a.mp4", None if scale == "mm" else RULED, None)
    item = trial_of(track, robot).quantities["forward_velocity"]
    assert item.value == pytest.approx(1e-3)
    eye = 0.5e-3 if scale == "mm" else PIXEL
    student = 4.302653  # 97.5 %, two degrees of freedom: one of the line, one of the eye
    assert 0.5 * (item.high - item.low) == pytest.approx(student * np.sqrt(eye**2 / 2 / 2), rel=1e-3)


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("640,240", "row 3, column x_px: 640; allowed: 0 to 639, inside the picture"),
        ("-1000,240", "row 3, column x_px: -1000; allowed: 0 to 639"),
        ("0,99999", "row 3, column y_px: 99999; allowed: 0 to 479"),
    ],
)
def test_a_reading_outside_the_picture_is_refused(tmp_path: Path, row: str, words: str) -> None:
    check_pixels(read_marks(written(tmp_path, "time_s,x_px,y_px\n0,0,0\n1,639,479\n2,,\n"))[""], (640, 480))
    with pytest.raises(InputError, match=words):
        check_pixels(read_marks(written(tmp_path, f"time_s,x_px,y_px\n0,1,1\n1,{row}\n"))[""], (640, 480))


def test_a_corrected_frame_replaces_what_was_seen(tmp_path: Path, make_track: Callable[..., Track], robot: Any) -> None:
    track = make_track(tail=7.0)
    spoiled = track.tail_phase.copy()
    spoiled[100:200] += 1.0  # a third of the track read wrongly
    from dataclasses import replace

    wrong = replace(track, tail_phase=spoiled)
    degrees = np.degrees(7.0 * track.time[100:200]) % 360.0
    rows = [f"{frame},{angle:.6f}" for frame, angle in zip(range(100, 200), degrees, strict=True)]
    path = written(tmp_path, "frame,tail_phase_deg\n" + "\n".join(rows))
    right = corrected(wrong, read_marks(path)[""], None)
    assert right.tail_phase[100:200] == pytest.approx(7.0 * track.time[100:200], abs=1e-6)
    assert np.array_equal(right.tail_phase[:100], track.tail_phase[:100])
    item = trial_of(right, robot).quantities["tail_rotation_rate"]
    assert item.low <= 7.0 <= item.high


def test_readings_by_hand_stay_in_a_track_that_is_far_smoother(
    tmp_path: Path, make_track: Callable[..., Track], robot: Any
) -> None:
    """Half a pixel off is 15 times the track's own noise, and nothing for a click; 100 pixels are a slip of the pen."""
    track = make_track()
    clicked = (319.5 + 1e-3 * frame / 30 / PIXEL + 0.5 for frame in (30, 90, 150, 210))
    rows = [f"{frame},{x:.6f}" for frame, x in zip((30, 90, 150, 210), clicked, strict=True)]
    path = written(tmp_path, "frame,x_px\n" + "\n".join([*rows, "270,900"]))
    marks = read_marks(path)[""]
    read = frames_read(track, marks)
    assert list(np.flatnonzero(read)) == [30, 90, 150, 210, 270]
    trial = trial_of(corrected(track, marks, RULED), robot, read=read)
    residual = trial.fits["forward_velocity"].residual
    assert np.isfinite(residual[[30, 90, 150, 210]]).all()
    assert np.isnan(residual[270])
    item = trial.quantities["forward_velocity"]
    assert item.low <= 1e-3 <= item.high


def test_two_readings_have_no_interval_and_say_why(
    tmp_path: Path, make_track: Callable[..., Track], robot: Any
) -> None:
    marks = read_marks(written(tmp_path, "time_s,x_mm\n0,0\n2,3\n"))[""]
    track = track_of_marks(marks, make_track().setup, "a.mp4", None, None)
    assert track.flags[0].sentence == "both readings were taken by hand, from marks.csv"
    answer = trial_of(track, robot).to_dict()["forward_velocity"]
    assert answer == {"value": pytest.approx(1.5e-3), "unit": "m/s", "reason": answer["reason"]}
    assert answer["reason"].startswith("two readings")


def test_trackpy_and_deeplabcut_give_the_same_speed(
    tmp_path: Path, make_track: Callable[..., Track], robot: Any
) -> None:
    frames = np.arange(0, 120)
    u = 200.0 + 1e-3 * frames / 30 / PIXEL
    trackpy = tmp_path / "trackpy.csv"
    trackpy.write_text(
        ",y,x,mass,frame,particle\n" + "\n".join(f"{i},239.5,{x:.6f},9.0,{i},0" for i, x in zip(frames, u, strict=True))
    )
    lab = tmp_path / "dlc.csv"
    lab.write_text(
        "scorer,s,s,s,s,s,s\nbodyparts,nose,nose,nose,rear,rear,rear\ncoords,x,y,likelihood,x,y,likelihood\n"
        + "\n".join(
            f"{i},{x + 70:.6f},239.5,0.99,{x - 70:.6f},239.5,{0.1 if i == 50 else 0.99}"
            for i, x in zip(frames, u, strict=True)
        )
    )
    setup = make_track().setup
    tracks = [read_track(path, setup, "a.mp4", RULED, seconds) for path in (trackpy, lab)]
    for track in tracks:
        found = trial_of(track, robot).quantities
        assert found["forward_velocity"].value == pytest.approx(1e-3, rel=1e-5)
        assert found["tail_rotation_rate"].to_dict()["value"] is None
    assert np.isnan(tracks[1].position[50]).all()
    assert tracks[1].heading[0] == pytest.approx(0.0)


_ROWS = [(index, 200.0 + 0.25 * index, 239.5) for index in range(40)]
_TRACKS = {
    "trackpy": ["x,y,frame", *(f"{x},{y},{k}" for k, x, y in _ROWS)],
    "trailing commas": ["x,y,frame,,", *(f"{x},{y},{k},," for k, x, y in _ROWS)],
    "commas after the rows alone": ["x,y,frame", *(f"{x},{y},{k},," for k, x, y in _ROWS)],
    "decimal commas": ["x;y;frame", *(f"{x};{y};{k}".replace(".", ",") for k, x, y in _ROWS)],
    "tabs": ["x\ty\tframe", *(f"{x}\t{y}\t{k}" for k, x, y in _ROWS)],
    "Tracker": ["mass_A", "t,x,y", *(f"{k / 30:.3f},{x},{y}" for k, x, y in _ROWS)],
    "Tracker, German": ["mass_A", " t;x;y", *(f"{k / 30:.3f};{x};{y}".replace(".", ",") for k, x, y in _ROWS)],
    "Tracker, trailing": ["mass_A;;", "t;x;y;", *(f"{k / 30:.3f};{x};{y};".replace(".", ",") for k, x, y in _ROWS)],
    "DeepLabCut": [
        "scorer,s,s,s", "bodyparts,centre,centre,centre", "coords,x,y,likelihood",
        *(f"{k},{x},{y},0.9" for k, x, y in _ROWS),
    ],
    "DeepLabCut, one animal of one": [
        "scorer,s,s", "individuals,ind1,ind1", "bodyparts,centre,centre", "coords,x,y",
        *(f"{k},{x},{y}" for k, x, y in _ROWS),
    ],
    "DeepLabCut, one animal of two has points, short rows": [
        "scorer,s,s,s,s", "individuals,one,one,two,two", "bodyparts,centre,centre,centre,centre", "coords,x,y,x,y",
        *(f"{k},{x},{y}" for k, x, y in _ROWS),
    ],
    "DeepLabCut, marks that belong to no animal": [
        "scorer,s,s,s,s", "individuals,one,one,single,single", "bodyparts,centre,centre,lamp,lamp", "coords,x,y,x,y",
        *(f"{k},{x},{y},5,6" for k, x, y in _ROWS),
    ],
    "DeepLabCut, labels of images": [
        "scorer,,,s,s", "bodyparts,,,centre,centre", "coords,,,x,y",
        *(f"labeled-data,film,img{k:04d}.png,{x},{y}" for k, x, y in _ROWS),
    ],
    "DeepLabCut, labels by path": [
        "scorer,s,s", "bodyparts,centre,centre", "coords,x,y",
        *(f"labeled-data/film/img{k:04d}.png,{x},{y}" for k, x, y in _ROWS),
    ],
}  # fmt: skip
"""The same positions, as programs and spreadsheets write them."""


@pytest.mark.parametrize("kind", _TRACKS)
def test_tables_of_other_programs(tmp_path: Path, make_track: Callable[..., Track], kind: str) -> None:
    path = written(tmp_path, "\n".join(_TRACKS[kind]) + "\n")
    track = read_track(path, make_track().setup, "a.mp4", RULED, seconds, frames_at)
    assert track.frame == pytest.approx([row[0] for row in _ROWS])
    assert track.picture[:, :2] == pytest.approx(np.array([row[1:] for row in _ROWS]))


def test_pixels_of_other_programs_are_those_of_the_stored_picture(
    tmp_path: Path, make_track: Callable[..., Track]
) -> None:
    """The pixel in column k of a picture stretched by 4/3 covers the columns 4/3 k to 4/3 (k + 1)."""
    ruled = Ruled(RULED.scale, RULED.size, RULED.points, (4 / 3, 1.0))
    path = written(tmp_path, "x,y,frame\n0,10,0\n479,20,1\n")
    track = read_track(path, make_track().setup, "a.mp4", ruled, seconds)
    assert track.picture[:, 0] == pytest.approx([4 / 6 - 0.5, 4 / 3 * 479.5 - 0.5])
    assert track.picture[:, 1] == pytest.approx([10, 20])
    with pytest.raises(InputError, match="row 2, column x: '480'; allowed: 0 to 479"):
        read_track(written(tmp_path, "x,y,frame\n480,10,0\n"), make_track().setup, "a.mp4", ruled, seconds)


@pytest.mark.parametrize("mark", [";", "\t"])
def test_readings_between_other_marks(tmp_path: Path, mark: str) -> None:
    text = "frame,x_px,\n0,1.5,\n10,2.5,\n".replace(",", mark).replace(".", ",")
    assert read_marks(written(tmp_path, text))[""].pixels[:, 0] == pytest.approx([1.5, 2.5])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("frame,x_pixel\n1,2\n", "column 'x_pixel' is unknown (did you mean x_px?)"),
        ("x_px\n1\n", "neither column 'frame' nor 'time_s' is there"),
        ("frame,video\n1,a\n", "holds no readings; allowed: at least one column of x_px"),
        ("frame,x_px,x_px\n1,2,3\n", "column 'x_px' is a duplicate"),
        ("frame,x_px\n1,2\n2,two\n", "row 3, column x_px: 'two'; allowed: a number, or empty"),
        ("frame,x_px\n1,2\n2,1_0\n", "row 3, column x_px: '1_0'"),
        ("frame,x_px\n1,inf\n", "row 2, column x_px: 'inf'"),
        ("frame,x_px\n1.5,2\n", "row 2, column frame: '1.5'; allowed: a whole number from 0"),
        ("frame,x_px\n1,2\n1,3\n", "rows 2 and 3 are of the same frame"),
        ("frame,x_px\n1,2,3\n", "row 2: 3 cells; allowed: 2"),
        ("frame,time_s,x_px\n,,3\n", "row 2: neither frame nor time_s"),
        ("time_s,x_px\n0,1\n-5,1\n", "row 3, column time_s: '-5'; allowed: 0 or later"),
        ("frame,x_px,x_mm\n1,2,\n2,3,0.5\n", "row 3: x_px = 3 and x_mm = 0.5 in one row; allowed: one of them"),
        ("frame,x_px\n", "holds no readings"),
        ("", "is empty"),
    ],
)
def test_a_bad_table_of_readings_is_one_sentence(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(InputError) as caught:
        read_marks(written(tmp_path, text))
    assert words in str(caught.value)
    assert "marks.csv" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x,y\n1,2\n", "column 'frame' is missing"),
        ("x,y,frame,particle\n1,2,0,0\n1,2,1,1\n", "column particle: 2 particles; allowed: the robot's alone"),
        ("x,y,frame\n1,2,0\n1,2,0\n", "frame 0 is a duplicate"),
        ("x,y,frame\n1,2,-1\n", "row 2, column frame: '-1'"),
        ("x,y,frame\n1,2,0\n15000,2,1\n", "row 3, column x: '15000'; allowed: 0 to 639, inside the picture"),
        (
            "scorer,s,s\nbodyparts,centre,centre\ncoords,x,y\n0,1,-9\n",
            "row 4, column centre y: '-9'; allowed: 0 to 479",
        ),
        ("scorer,s,s\nbodyparts,eye,eye\ncoords,x,y\n0,1,2\n", "points eye; allowed: nose and rear, or centre"),
        (
            "scorer,s,s,s,s\nindividuals,a,a,b,b\nbodyparts,centre,centre,centre,centre\ncoords,x,y,x,y\n0,1,2,3,4\n",
            "holds several individuals (a, b); allowed: a table of one",
        ),
        (
            "scorer,s,s\nindividuals,a,a\nbodyparts,nose,nose\n0,1,2\n1,2,3\n",
            "header rows are 'individuals', 'bodyparts', '0'",
        ),
        ("t,x,y\n0.5,1,2\n0.516,1,2\n", "row 3, column t: '0.516'; allowed: the time of a frame of the video, s"),
        ("x|y|frame\n1|2|0\n", "its columns are separated by '|'; allowed: commas, semicolons or tabs"),
        ("x;y;frame\n1,5;2;zero\n", "row 2, column frame: 'zero'"),
        ("scorer,s,s\nbodyparts,centre,centre\ncoords,x,y\n0,1,far\n", "row 4, column centre y: 'far'"),
    ],
)
def test_a_bad_track_of_others_is_one_sentence(
    tmp_path: Path, make_track: Callable[..., Track], text: str, words: str
) -> None:
    with pytest.raises(InputError) as caught:
        read_track(written(tmp_path, text), make_track().setup, "a.mp4", RULED, seconds, frames_at)
    assert words in str(caught.value)


def test_a_reading_of_a_frame_that_is_not_there_is_refused(tmp_path: Path, make_track: Callable[..., Track]) -> None:
    marks = read_marks(written(tmp_path, "frame,x_mm\n5,1\n9999,2\n"))[""]
    with pytest.raises(InputError, match="row 3: frame 9999 was not measured"):
        corrected(make_track(), marks, None)


def test_frame_and_time_of_a_reading_have_to_agree(tmp_path: Path, make_track: Callable[..., Track]) -> None:
    track = make_track()
    frame, time = int(track.frame[60]), float(track.time[60])
    marks = read_marks(written(tmp_path, f"frame,time_s,x_mm\n{frame},{time + 0.5:.3f},1\n"))[""]  # to whole seconds
    corrected(track, marks, None)
    marks = read_marks(written(tmp_path, f"frame,time_s,x_mm\n0,0,0\n{frame},{time + 2:.3f},1\n"))[""]
    with pytest.raises(InputError, match=f"row 3: frame {frame} is at .* s, but time_s is"):
        corrected(track, marks, None)
    with pytest.raises(InputError, match=f"row 3: frame {frame} is at .* s, but time_s is"):
        track_of_marks(marks, track.setup, "a.mp4", RULED, seconds)  # the film alone knows the times of its frames
