"""A file that this program has not written stays as it is, whatever a command is asked to do beside it."""

import contextlib
import os
import re
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import spirillum as sp
from spirillum.errors import InputError
from spirillum.files import (
    MARK,
    atomic_folder,
    atomic_write,
    atomic_write_all,
    file_name,
    guard_inputs,
    output_folder,
    results_folder,
    text_cell,
    write_text,
    written_by_us,
)
from spirillum.files.locks import LEFTOVER, private_folder, sweep

WIDE = "biorob2012-wide"
Refused = Callable[..., str]
TINY = {"trials": 1, "camera": {"size": "64x64", "fps": 10.0}, "duration": 0.2}


def small(tmp_path: Path, *names: str) -> Path:
    """A study of robots with these names."""
    for place, name in enumerate(names):
        text = f'extends = "{WIDE}"\nname = {name!r}\ntail.wavelength = "{20 + place} mm"\n'
        (tmp_path / f"r{place}.toml").write_text(text)
    robots = ", ".join(f'"r{place}.toml"' for place in range(len(names)))
    (tmp_path / "s.toml").write_text(f'title = "t"\nrobots = [{robots}]\nmodels = ["sbt"]\n')
    return tmp_path / "s.toml"


def test_names_stay_in_their_folder_and_apart(tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    (home / "setup.toml").write_text("precious")
    names = ("..", "truth-observations.csv", "Virtual-Experiment.json", "a/b", "A?B")
    found = sp.virtual_experiment(small(tmp_path, *names), home / "exp", **TINY)
    assert (home / "setup.toml").read_text() == "precious"
    assert {path.name for path in home.iterdir()} == {"setup.toml", "exp"}
    made = {path.name for path in (home / "exp").iterdir()}
    assert made == {*found.robots, "truth-observations.csv", "virtual-experiment.json"}
    assert len({name.casefold() for name in made}) == 7


@pytest.mark.parametrize(
    ("name", "safe"),
    [
        ("..", "unnamed"),
        ("../x", "x"),
        ("a/../b", "a-..-b"),
        (".hidden", "hidden"),
        ("", "unnamed"),
        ("nul", "nul-"),
        ("COM1.txt", "COM1.txt-"),
        ("-rf", "rf"),
        ("µ robot", "µ-robot"),
        ("x" * 300, "x" * 100),
        ("a\0b\n", "a-b-"),
        ("end.", "end"),
    ],
)
def test_a_name_becomes_one_part_of_a_path(name: str, safe: str) -> None:
    assert file_name(name) == safe
    assert file_name(name, {safe.upper()}) == f"{safe}-2"


@pytest.mark.parametrize("text", ["=HYPERLINK(1)", "+1", "-1", "@a", "\t=1"])
def test_a_cell_is_no_formula(text: str) -> None:
    assert text_cell(text) == f"'{text.strip()}"


def test_a_formula_as_a_name_is_text_in_tables(tmp_path: Path) -> None:
    found = sp.virtual_experiment(small(tmp_path, "=cmd|1"), tmp_path / "exp", **TINY)
    cells = [line.split(",")[0] for line in found.observations.read_text().splitlines() if not line.startswith("#")]
    assert not any(cell.startswith(("=", "+", "-", "@")) for cell in cells)


@pytest.mark.parametrize("name", ["run.nc", "run.png", "run.mp4"])
def test_commands_refuse_files_that_they_did_not_write(tmp_path: Path, refused: Refused, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(b"precious")
    option = {".nc": "-o", ".png": "--plot", ".mp4": "--movie"}[path.suffix]
    more = [] if option == "-o" else ["-o", str(tmp_path / "other.nc")]
    assert "unknown origin" in refused("simulate", WIDE, option, str(path), *more)
    assert path.read_bytes() == b"precious"
    assert list(tmp_path.iterdir()) == [path]


def test_what_was_written_here_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "a.html"
    for text in ("<p>first</p>", "<p>second</p>"):
        write_text(path, text)
        assert path.read_text() == f"{text}<!-- {MARK} -->\n"
    path.write_text("mine")
    with pytest.raises(InputError, match="unknown origin"):
        write_text(path, "third")
    path.write_bytes(b"")  # a place that was kept free, as tempfile makes one
    write_text(path, "third")


@pytest.mark.parametrize("name", ["f.png", "f.svg", "f.pdf"])
def test_pictures_say_who_drew_them(tmp_path: Path, name: str) -> None:
    from spirillum.view.figures.style import new_figure, save_as

    save_as(new_figure(1.0, 1.0), tmp_path / name)
    assert written_by_us(tmp_path / name)
    save_as(new_figure(1.0, 1.0), tmp_path / name)


def test_an_input_is_not_written_over(tmp_path: Path) -> None:
    path = tmp_path / "a.html"
    write_text(path, "ours")
    (tmp_path / "link").symlink_to(path)
    with guard_inputs(tmp_path / "link"), pytest.raises(InputError, match="read by this command"):
        write_text(path, "new")
    (tmp_path / "images").mkdir()
    (tmp_path / "images" / "a.html").touch()
    with guard_inputs(tmp_path / "images"), pytest.raises(InputError, match="read by this command"):
        write_text(tmp_path / "images" / "a.html", "new")
    write_text(path, "new")


def test_measuring_does_not_replace_films_or_files_of_others(tmp_path: Path, refused: Refused) -> None:
    trial = sp.render(WIDE, tmp_path / "a.mp4", trial={"duration": 0.2}, camera={"size": "64x64", "fps": 10.0})
    other = tmp_path / "a.annotated.mp4"
    other.write_bytes(trial.path.read_bytes())
    command = ("measure", str(trial.path), str(other), "--setup", str(trial.setup), "-o", str(tmp_path))
    before = other.read_bytes()
    assert "read by this command" in refused(*command)
    assert other.read_bytes() == before
    other.unlink()
    for name in ("a.nc", "report.html", "observations.csv", "a.annotated.mp4", "a.movement.nc"):
        (tmp_path / name).write_text("precious")
        assert f"{name} is there and of unknown origin" in refused(*command[:2], *command[3:])
        assert (tmp_path / name).read_text() == "precious"
        (tmp_path / name).unlink()


def test_a_planted_link_at_a_temporary_name_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "target").write_text("precious")
    with atomic_write(tmp_path / "a.txt") as temporary:
        assert temporary.parent.stat().st_mode & 0o077 == 0  # nobody else can plant one
        temporary.write_text("text")
    assert (tmp_path / "target").read_text() == "precious"
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "figures").symlink_to(tmp_path)
    with pytest.raises(InputError, match="figures is a link"):
        output_folder(tmp_path / "out" / "figures", tmp_path / "out")


@pytest.mark.parametrize("target", ["../other/a.json", "../missing", "b.json", "figures"])
@pytest.mark.parametrize("name", ["a.json", "figures/a.json"])
def test_no_link_within_a_folder_of_results_is_followed(tmp_path: Path, name: str, target: str) -> None:
    (tmp_path / "out" / "figures").mkdir(parents=True)
    (tmp_path / "other").mkdir()
    for own in ("other/a.json", "out/b.json"):
        write_text(tmp_path / own, MARK)
    (tmp_path / "out" / name).symlink_to(target)
    (tmp_path / "named").symlink_to("out")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    for folder in ("out", "named"):
        with results_folder(tmp_path / folder) as results:
            with pytest.raises(InputError, match=r"a\.json is a link; allowed: a file of its own in"):
                write_text(results / name, "new", replace="any")
            write_text(results / "c.json", MARK)
            (results / "c.json").unlink()
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_two_runs_in_one_folder_are_kept_apart(tmp_path: Path) -> None:
    with (
        results_folder(tmp_path / "out") as folder,
        pytest.raises(InputError, match="being written by another run"),
        results_folder(folder),
    ):
        pass
    assert not (tmp_path / "out").exists()  # made here, and empty
    with results_folder(tmp_path / "out"):
        (tmp_path / "out" / "a").touch()
    with results_folder(tmp_path / "out"):
        pass
    assert (tmp_path / "out" / "a").exists()


def test_leftovers_of_dead_runs_go_and_those_of_living_ones_stay(tmp_path: Path) -> None:
    dead = tmp_path / f"{LEFTOVER}0123abcd"
    dead.mkdir()
    (dead / "half.nc").write_text("half")
    with private_folder(tmp_path) as living:
        sweep(tmp_path, again=True)
        assert living.is_dir()
        assert not dead.exists()
    (tmp_path / ".r.part").mkdir()
    (tmp_path / ".r.part" / "mine").touch()
    with atomic_folder(tmp_path / "r") as part:
        (part / "1.png").touch()
    assert {path.name for path in tmp_path.iterdir()} == {"r", ".r.part"}
    assert (tmp_path / ".r.part" / "mine").exists()


def test_a_folder_that_has_come_meanwhile_is_not_replaced(tmp_path: Path) -> None:
    writing = atomic_folder(tmp_path / "r")
    (writing.__enter__() / "1.png").touch()
    (tmp_path / "r").mkdir()
    (tmp_path / "r" / "other").touch()
    with pytest.raises(InputError, match="cannot be written"):
        writing.__exit__(None, None, None)
    assert [path.name for path in tmp_path.rglob("*")] == ["r", "other"]


def test_an_interrupted_calibration_is_run_again_and_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = [f"40,{w},2.5,{1 + 0.01 * w},{1.2},{-0.4}" for w in (15, 20, 25)]
    header = "channel_diameter_mm,wavelength_mm,amplitude_mm,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz"
    (tmp_path / "o.csv").write_text("\n".join([header, *rows]) + "\n")
    options = {"method": "least-squares", "free": "body_drag", "output": tmp_path / "c"}
    from spirillum.results import calibration
    from spirillum.view.figures import style

    sp.calibrate(tmp_path / "o.csv", WIDE, **options, figures=False)
    first = {path: path.stat().st_ino for path in (tmp_path / "c").iterdir()}
    drawings = "spirillum.view.figures.calibration.calibration_drawings"
    monkeypatch.setattr(drawings, lambda _found: dict.fromkeys(("residuals", "profiles"), lambda: None))
    monkeypatch.setattr(style, "save", _stopped_at_the_second(style.save))
    with pytest.raises(KeyboardInterrupt):
        sp.calibrate(tmp_path / "o.csv", WIDE, **options)
    assert {path: path.stat().st_ino for path in (tmp_path / "c").iterdir()} == first

    def full(*_: object) -> str:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(calibration, "predictions_text", full)
        with pytest.raises(OSError, match="No space"):
            sp.calibrate(tmp_path / "o.csv", WIDE, **options, figures=False)
    assert {path: path.stat().st_ino for path in (tmp_path / "c").iterdir()} == first
    found = sp.calibrate(tmp_path / "o.csv", WIDE, **options, figures=False)
    assert found.files == ("calibration.toml", "predictions.csv")


def test_an_interrupt_does_not_part_files_that_belong_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(part: Path, place: Path) -> Path:
        if place == paths[1]:
            monkeypatch.undo()
            raise KeyboardInterrupt
        return replaced(part, place)

    replaced, paths = Path.replace, [tmp_path / "a", tmp_path / "b"]
    (tmp_path / "c").touch()
    monkeypatch.setattr(Path, "replace", interrupted)
    with contextlib.suppress(KeyboardInterrupt), atomic_write_all(paths, earlier=[tmp_path / "c"]) as parts:
        for path in paths:
            parts[path].write_text("new")
    assert Path.replace is replaced  # it was interrupted
    assert sorted(tmp_path.iterdir()) == paths


def _stopped_at_the_second(drawn: Callable[..., list[Path]]) -> Callable[..., list[Path]]:
    from spirillum.view.figures.style import new_figure

    count = 0

    def save(_figure: object, path: Path, **options: bool) -> list[Path]:
        nonlocal count
        count += 1
        if count == 2:
            raise KeyboardInterrupt
        return drawn(new_figure(1.0, 1.0), path, **options)

    return save


def test_files_appear_with_the_permissions_of_new_files(tmp_path: Path) -> None:
    mask = os.umask(0o027)
    try:
        write_text(tmp_path / "a.txt", "text")
    finally:
        os.umask(mask)
    assert (tmp_path / "a.txt").stat().st_mode & 0o777 == 0o640


def test_files_that_belong_together_appear_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sp.export(WIDE, tmp_path / "r.urdf", sidecar=False, fineness=0.2)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    write = Path.write_bytes

    def full(self: Path, data: bytes) -> int:
        if self.name == "r.urdf":
            raise OSError(28, "No space left on device")
        return write(self, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OSError, match="No space"):
        sp.export(WIDE, tmp_path / "r.urdf", sidecar=False, fineness=0.5)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


def test_marks_do_not_disturb_readers(tmp_path: Path) -> None:
    import xarray as xr

    from spirillum.files import write_dataset

    dataset = xr.Dataset({"a": ("x", np.arange(5.0))})
    for _ in range(2):
        write_dataset(dataset, tmp_path / "a.nc")
        with xr.open_dataset(tmp_path / "a.nc", engine="h5netcdf") as found:
            assert found.identical(dataset)
    assert (tmp_path / "a.nc").read_bytes().endswith(f"\n{MARK}\n".encode())


def test_frames_are_drawn_again_and_those_of_others_stay(tmp_path: Path) -> None:
    options = {"trial": {"duration": 0.4}, "camera": {"size": "64x64", "fps": 5.0}}
    sp.render(WIDE, tmp_path / "r", **options)
    first = {path.name: path.read_bytes() for path in (tmp_path / "r").iterdir()}
    sp.render(WIDE, tmp_path / "r", **options)
    assert {path.name: path.read_bytes() for path in (tmp_path / "r").iterdir()} == first
    (tmp_path / "r" / "00000.png").write_bytes(b"mine")
    with pytest.raises(InputError, match="not empty"):
        sp.render(WIDE, tmp_path / "r", **options)
    assert (tmp_path / "r" / "00000.png").read_bytes() == b"mine"


@pytest.mark.parametrize(
    "command",
    [
        ["study", "-o", "closed"],
        ["study", "-o", "within"],
        ["study", "--store", "closed.zarr"],
        ["validate", "-o", "closed"],
        ["measure", "film/a.mp4", "--setup", "film/a.setup.toml", "-o", "closed"],
        ["calibrate", "o.csv", "biorob2012-wide", "-o", "within"],
        ["virtual-experiment", "-o", "closed"],
        ["render", "biorob2012-wide", "--run", "trial", "-o", "closed/trial.mp4"],
        ["simulate", "biorob2012-wide", "-o", "closed/run.nc"],
        [
            "design",
            "magnetic-helix",
            "--maximise",
            "forward_velocity",
            "--vary",
            "tail.length=1mm:2mm",
            "-o",
            "closed/b.toml",
        ],
    ],
)
def test_a_closed_folder_is_refused_before_the_work(
    command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: Refused
) -> None:
    """Tables, films and runs would be computed for nothing; `within` has closed `figures`."""
    (tmp_path / "closed").mkdir()
    (tmp_path / "within" / "figures").mkdir(parents=True)
    (tmp_path / "film").mkdir()
    sp.render(WIDE, tmp_path / "film" / "a.mp4", trial={"duration": 0.2}, camera={"size": "64x64", "fps": 10.0})
    (tmp_path / "o.csv").write_text("")
    (tmp_path / "closed.zarr").symlink_to("closed")
    shut, access = {tmp_path / "closed", tmp_path / "within" / "figures"}, os.access

    def closed(path: str, mode: int, **more: bool) -> bool:
        return access(path, mode, **more) and not (mode & os.W_OK and Path(path).resolve() in shut)

    def made(suffix: str | None = None, prefix: str | None = None, dir: str | None = None) -> str:  # noqa: A002
        if dir is not None and Path(dir).resolve() in shut:
            raise PermissionError(13, "permission denied", dir)
        return make(suffix, prefix, dir)

    monkeypatch.setattr(os, "access", closed)
    make = tempfile.mkdtemp
    monkeypatch.setattr(tempfile, "mkdtemp", made)
    monkeypatch.chdir(tmp_path)
    for work in ("study.computed_study", "study.make_tables", "study_store.make_tables"):
        monkeypatch.setattr(f"spirillum.results.{work}", None)
    assert re.search(r"cannot be (written|written to) \(permission denied\); allowed: a folder", refused(*command))
