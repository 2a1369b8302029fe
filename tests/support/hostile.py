"""Hostile inputs from a seed: files of every kind that commands read, cut, bent and forged, each with a command.

    python tests/support/hostile.py SEED COUNT

runs COUNT of them and prints what broke a promise.
"""

import contextlib
import hashlib
import io
import json
import resource
import shutil
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import posteriors

WIDE = "biorob2012-wide"
STUDY = f'title = "t"\nmodels = ["sbt", "rft"]\nfriction = ["rotor"]\nrobots = ["{WIDE}"]\n'
CALIBRATION = (
    '[calibration.sbt]\nbody_drag = 1.9\nbody_rotation = 1.1\nsource = "s"\n[calibration.sbt.fitted_to]\n'
    'channel_diameter = "40 mm"\nbody_diameter = "18 mm"\nbody_length = "40 mm"\n'
)
SETUP = (
    '[camera]\nview = "above"\nheight = "300 mm"\nframes_per_second = 30.0\n[tank]\nsurface = "60 mm"\nindex = 1.4\n'
    f'[markers]\nspacing = "10 mm"\nheight = "0 mm"\n[robot]\nfile = "{WIDE}"\naxis_height = "11.5 mm"\n'
    'direction = "right"\n'
)
OBSERVATIONS = (
    "# mine\n"
    "robot,channel_diameter_mm,wavelength_mm,amplitude_mm,trial,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz\n"
    "a,40,20,2.5,1,1.1,1.2,-0.4\na,40,25,2.5,1,1.2,1.2,-0.4\na,40,30,2.5,1,1.25,1.2,-0.4\n"
)
DUTY = "time_s,duty\n0,1\n1,0.5\n2,1\n"
CANDIDATES = "channel_diameter_mm,wavelength_mm,amplitude_mm\n40,20,2.5\n40,25,2.5\n"
LAB = (
    '[camera]\nfps = 30.0\nlatency = "100 ms"\ndropped = 0.02\nposition_noise = "0.01 mm"\n[meter]\nrate = 10.0\n'
    '[remote]\nperiod = "108 ms"\nlost = 0.05\n[pulse]\nvelocity = "0.5 mm/s"\n[unknown]\nfriction_factor = 3.0\n'
)
CONTROL = ["control", WIDE, "--model", "rft", "--at", "2mm", "--tolerance", "0.5mm", "--duration", "0.3s", "-o", "c.nc"]
MARKS = "video,time_s,x_px,y_px\na,0,10,20\na,1,30,20\n"
NASTY = (
    *("nan", "-inf", "1e400", "-0", "1" * 400, "0x7fffffffffffffff", "1979-05-27", "true", '""', '"1 mm"', '"0 mm"'),
    *(
        '"1e308 mm"',
        '"-5 mm"',
        '"1 furlong"',
        '"nan mm"',
        '"mm"',
        "[]",
        "{}",
        "[[[[]]]]",
        '"../../x"',
        '".."',
        '"=1+1"',
    ),
    *('"\\u0000"', '"\\u202e"', '"/dev/zero"', '"http://x"', '"none"', "[" * 300, '"' + "y" * 3000 + '"', "'''", "\\"),
    *(
        "1_0",
        "1__0",
        "0.1.2",
        "a.b.c.d",
        "\u0661",
        "1,5",
        "1e",
        "--1",
        '"1 mm" "2 mm"',
        "#",
        "=",
        "\0",
        "\x7f",
        "\ufeff",
    ),
)


class Promise(Exception):  # noqa: N818
    """What was promised did not hold."""


class Case(NamedTuple):
    """A hostile input."""

    words: str
    files: dict[str, bytes]
    """Written before the command runs; `None` bytes stand for nothing."""
    command: list[str]


def cases(seed: int, count: int, whole: dict[str, bytes]) -> Iterator[Case]:
    """Cases of a seed.

    Args:
        seed: of all chance.
        count: number of cases.
        whole: files that are whole, by name: `run.nc`, `posterior.nc`, `film.mp4`, `dataset.nc`, `part.npz`, ...
    """
    rng = np.random.default_rng(seed)
    makers = [maker for weight, maker in _MAKERS for _ in range(weight)]
    for number in range(count):
        yield makers[int(rng.integers(len(makers)))](rng, whole)._replace(
            words=f"seed {seed}, case {number} of {count}"
        )


def bent_text(rng: np.random.Generator, text: str) -> bytes:
    """A text with one to four things changed."""
    for _ in range(int(rng.integers(1, 5))):
        lines = text.split("\n")
        place = int(rng.integers(len(lines)))
        token = NASTY[int(rng.integers(len(NASTY)))]
        kind = int(rng.integers(9))
        if kind <= 2 and "=" in lines[place]:
            lines[place] = f"{lines[place].split('=')[0]}= {token}"
        elif kind <= 2 and "," in lines[place]:
            cells = lines[place].split(",")
            cells[int(rng.integers(len(cells)))] = token
            lines[place] = ",".join(cells)
        elif kind == 3:
            lines.insert(place, lines[int(rng.integers(len(lines)))])
        elif kind == 4:
            del lines[place]
        elif kind == 5:
            at = int(rng.integers(len(lines[place]) + 1))
            lines[place] = lines[place][:at] + token + lines[place][at:]
        elif kind == 6:
            lines = lines[: place + 1]
        elif kind == 7:
            lines.insert(place, f"{token} = {token}")
        else:
            lines[place] = lines[place] * int(rng.integers(2, 40))
        text = "\n".join(lines)
    data = text.encode("utf-8", "surrogatepass")
    return bent_bytes(rng, data) if rng.integers(6) == 0 else data


def bent_bytes(rng: np.random.Generator, data: bytes) -> bytes:
    """Bytes with some changed, cut, doubled or left out."""
    found = bytearray(data)
    for _ in range(int(rng.integers(1, 6))):
        if not found:
            break
        at = int(rng.integers(len(found)))
        kind = int(rng.integers(6))
        if kind <= 2:
            found[at] = int(rng.integers(256))
        elif kind == 3:
            stop = at + int(rng.integers(1, 17))
            found[at:stop] = bytes([int(rng.choice([0, 1, 127, 255]))]) * len(found[at:stop])
        elif kind == 4:
            del found[at : at + int(rng.integers(1, 2000))]
        else:
            found[at:at] = found[at : at + int(rng.integers(1, 500))]
    return bytes(found)


def _robot(rng: np.random.Generator, whole: dict[str, bytes]) -> Case:
    commands = (["predict", "x.toml"], ["robot", "check", "x.toml"], ["predict", "x.toml", "--model", "rft"])
    return Case("", {"x.toml": bent_text(rng, whole["robot.toml"].decode())}, list(_one(rng, commands)))


def _robot_elsewhere(rng: np.random.Generator, whole: dict[str, bytes]) -> Case:
    """A robot for commands that do not predict."""
    name = str(_one(rng, ("robot.toml", "magnet.toml")))
    commands = (
        ["robot", "show", "x.toml"],
        ["resistance", "x.toml", "--part", "rotor"],
        ["export", "x.toml", "x.urdf"],
        ["export", "x.toml", "x.stl"],
        ["magnetic-sweep", "x.toml", "-o", "sweep.nc", "--rate", "1Hz", "--turns", "4"],
    )
    return Case("", {"x.toml": bent_text(rng, whole[name].decode())}, list(_one(rng, commands)))


def _film_of_a_setup(rng: np.random.Generator, whole: dict[str, bytes]) -> Case:
    files = {"s.toml": bent_text(rng, SETUP), "a.mp4": bent_bytes(rng, whole["film.mp4"])}
    return Case("", files, ["setup", "check", "s.toml", "a.mp4"])


def _study(rng: np.random.Generator, _whole: dict[str, bytes]) -> Case:
    text = STUDY if rng.integers(2) else STUDY.replace(WIDE, "r.toml")
    return Case("", {"s.toml": bent_text(rng, text), "r.toml": b'extends = "..'}, ["study", "s.toml", "-o", "out"])


def _calibration(rng: np.random.Generator, _whole: dict[str, bytes]) -> Case:
    return Case("", {"c.toml": bent_text(rng, CALIBRATION)}, ["predict", WIDE, "--calibration", "c.toml"])


def _observations(rng: np.random.Generator, _whole: dict[str, bytes]) -> Case:
    commands = (
        ["observations", "check", "o.csv"],
        ["calibrate", "o.csv", WIDE, "--method", "paper", "-o", "out"],
        ["observations", "join", "o.csv", "p.csv", "-o", "joined.csv"],
    )
    files = {"o.csv": bent_text(rng, OBSERVATIONS), "p.csv": OBSERVATIONS.replace(",1,1.", ",2,1.").encode()}
    return Case("", files, list(_one(rng, commands)))


def _parquet(rng: np.random.Generator, whole: dict[str, bytes]) -> Case:
    return Case("", {"o.parquet": bent_bytes(rng, whole["o.parquet"])}, ["observations", "check", "o.parquet"])


def _duty(rng: np.random.Generator, _whole: dict[str, bytes]) -> Case:
    command = ["simulate", WIDE, "-o", "run.nc", "--duration", "0.1s", "--duty", "d.csv"]
    return Case("", {"d.csv": bent_text(rng, DUTY)}, command)


def _candidates(rng: np.random.Generator, whole: dict[str, bytes]) -> Case:
    files = {"c.csv": bent_text(rng, CANDIDATES), "p.nc": whole["posterior.nc"]}
    return Case("", files, ["suggest", "p.nc", WIDE, "--candidates", "c.csv"])


def _marks(rng: np.random.Generator, whole: dict[str, bytes]) -> Case:
    files = {"m.csv": bent_text(rng, MARKS), "s.toml": SETUP.encode(), "a.mp4": whole["film.mp4"]}
    return Case("", files, ["measure", "a.mp4", "--setup", "s.toml", "--marks", "m.csv", "--no-tracking", "-o", "out"])


def _setup(rng: np.random.Generator, whole: dict[str, bytes]) -> Case:
    files = {"s.toml": bent_text(rng, SETUP), "a.mp4": whole["film.mp4"]}
    command = (
        ["setup", "check", "s.toml"] if rng.integers(4) else ["measure", "a.mp4", "--setup", "s.toml", "-o", "out"]
    )
    return Case("", files, command)


def _lab(rng: np.random.Generator, _whole: dict[str, bytes]) -> Case:
    return Case("", {"lab.toml": bent_text(rng, LAB)}, [*CONTROL, "--lab", "lab.toml"])


def _goal(rng: np.random.Generator, _whole: dict[str, bytes]) -> Case:
    """Wrong words for a task."""
    options = ("--at", "--tolerance", "--speed", "--duration", "--with", "--seed", "--task", "--controller", "--gap")
    command = list(CONTROL)
    for _ in range(int(rng.integers(1, 3))):
        option, token = str(_one(rng, options)), str(_one(rng, NASTY)).replace("\0", "")
        field = _one(rng, ("camera.latency=", "remote.period=", "unknown.friction_factor=", "pulse.start=", ""))
        command += [option, f"{field}{token}" if option == "--with" else token]
    return Case("", {}, command)


def _design(rng: np.random.Generator, _whole: dict[str, bytes]) -> Case:
    """Wrong words for a search."""
    low, high, token = (str(_one(rng, NASTY)).replace("\0", "") for _ in range(3))
    varied = str(_one(rng, (f"tail.wavelength={low}:30mm", f"tail.amplitude=1mm:{high}", f"{low}=1mm:2mm", token)))
    option = str(_one(rng, ("--subject-to", "--unknown", "--level", "--draws", "--minimise", "--model", "--set")))
    command = ["design", WIDE, "--model", "rft", "--maximise", "forward_velocity", "--vary", varied]
    return Case("", {}, command if rng.integers(2) else [*command, option, token])


def _live(rng: np.random.Generator, whole: dict[str, bytes]) -> Case:
    film = whole["film.mp4"] if rng.integers(2) else bent_bytes(rng, whole["film.mp4"])
    files = {"s.toml": SETUP.encode(), "a.mp4": film, "b.mp4": bent_bytes(rng, whole["film.mp4"])}
    learnt = ["--learn-from", "b.mp4"] if rng.integers(2) else []
    return Case("", files, ["track", "a.mp4", "--setup", "s.toml", "--pace", "fast", *learnt])


def _recording(rng: np.random.Generator, whole: dict[str, bytes]) -> Case:
    files = {"run.nc": bent_bytes(rng, whole["run.nc"])}
    return Case("", files, ["export", "run.nc", "out.mcap"])


def _store(rng: np.random.Generator, whole: dict[str, bytes]) -> Case:
    """A store that holds something bent."""
    names = sorted(name for name in whole if name.startswith("out.zarr/"))
    files = {name: whole[name] for name in names}
    bent = names[int(rng.integers(len(names)))] if rng.integers(2) else "out.zarr/study.json"
    files[bent] = bent_bytes(rng, files[bent])
    return Case("", {"s.toml": STUDY.encode(), **files}, ["study", "s.toml", "--store", "out.zarr"])


def _film(rng: np.random.Generator, whole: dict[str, bytes]) -> Case:
    files = {"s.toml": SETUP.encode(), "a.mp4": bent_bytes(rng, whole["film.mp4"])}
    return Case("", files, ["measure", "a.mp4", "--setup", "s.toml", "-o", "out"])


def _posterior(rng: np.random.Generator, whole: dict[str, bytes]) -> Case:
    return Case("", {"p.nc": bent_bytes(rng, whole["posterior.nc"])}, ["predict", WIDE, "--posterior", "p.nc"])


def _forged(rng: np.random.Generator, _whole: dict[str, bytes]) -> Case:
    """A posterior with a true checksum and a wrong content."""
    about = posteriors.attributes()
    name = str(rng.choice([key for key, value in about.items() if isinstance(value, str)]))
    try:
        content = _bent_json(rng, json.loads(about[name]))
        about[name] = json.dumps(content)
    except ValueError:
        about[name] = about[name] + "x" * int(rng.integers(3))
    with tempfile.TemporaryDirectory() as folder:
        data = posteriors.write(Path(folder) / "p.nc", about).read_bytes()
    return Case(
        "", {"p.nc": data}, ["predict", WIDE, "--posterior", "p.nc", "--for", str(rng.choice(["new", "measured"]))]
    )


def _bent_json(rng: np.random.Generator, value: Any) -> Any:
    """One value somewhere within replaced."""
    if isinstance(value, list) and value and rng.integers(8):
        at = int(rng.integers(len(value)))
        return [*value[:at], _bent_json(rng, value[at]), *value[at + 1 :]]
    if isinstance(value, dict) and value and rng.integers(8):
        key = list(value)[int(rng.integers(len(value)))]
        if rng.integers(6) == 0:
            return {other: item for other, item in value.items() if other != key}
        return {**value, key: _bent_json(rng, value[key])}
    nasty = (
        None,
        0,
        -1,
        1,
        1e300,
        1e-300,
        float("nan"),
        float("inf"),
        "",
        "x",
        [],
        {},
        True,
        10**400,
        [[]],
        0.5,
        "sbt",
    )
    return nasty[int(rng.integers(len(nasty)))]


def _run(rng: np.random.Generator, whole: dict[str, bytes]) -> Case:
    files = {"run.nc": bent_bytes(rng, whole["run.nc"])}
    return Case("", files, ["render", WIDE, "--run", "run.nc", "-o", "v.mp4", "--size", "64x64", "--fps", "5"])


def _study_folder(rng: np.random.Generator, whole: dict[str, bytes]) -> Case:
    """A study whose folder holds something bent."""
    name = str(rng.choice(["study.json", "dataset.nc", "part"]))
    files = {"s.toml": STUDY.encode(), "out/study.json": whole["study.json"]}
    if name == "part":
        parts = f"out/parts-{json.loads(whole['study.json'])['fingerprint'][:16]}"
        files[f"{parts}/part-00000.npz"] = bent_bytes(rng, whole["part.npz"])
    else:
        files[f"out/{name}"] = bent_bytes(rng, whole[name])
    return Case("", files, ["study", "s.toml", "-o", "out"])


def _words(rng: np.random.Generator, _whole: dict[str, bytes]) -> Case:
    """Wrong words on the command line."""
    options = ("--set", "--model", "--tail-rate", "--friction", "--gap", "--pitch", "--calibration", "--ends", "--flow")
    fields = ("tail.wavelength=", "fluid.viscosity=", "name=", "channel=", "drive.duty=", "motor.gear_ratio=", "")
    command = ["predict", WIDE]
    for _ in range(int(rng.integers(1, 4))):
        option, token = str(_one(rng, options)), str(_one(rng, NASTY)).replace("\0", "")
        command += [option, f"{_one(rng, fields)}{token}" if option == "--set" else token]
    return Case("", {}, command)


def _one(rng: np.random.Generator, items: Any) -> Any:
    return items[int(rng.integers(len(items)))]


_Maker = Callable[[np.random.Generator, dict[str, bytes]], Case]
_MAKERS: list[tuple[int, _Maker]] = [
    (6, _robot),
    (2, _robot_elsewhere),
    (1, _film_of_a_setup),
    (3, _study),
    (3, _calibration),
    (4, _observations),
    (2, _parquet),
    (2, _duty),
    (2, _candidates),
    (2, _marks),
    (2, _setup),
    (1, _film),
    (3, _posterior),
    (4, _forged),
    (2, _run),
    (2, _study_folder),
    (6, _words),
    (3, _lab),
    (3, _goal),
    (3, _design),
    (1, _live),
    (1, _recording),
    (2, _store),
]
_LONGEST = 20.0
_LARGEST = 1500 << 10
"""Memory, kB."""
_GROWTH = 256 << 10
"""Growth of the largest memory so far that counts, kB: other tests of the process may have needed much."""
_PRECIOUS = ("mine.txt", "out/mine.txt", "out/mine.png", "joined.txt")


def whole_files(folder: Path) -> dict[str, bytes]:
    """The files that are bent, made once."""
    import spirillum as sp
    from spirillum.cli import main

    with contextlib.suppress(SystemExit), contextlib.redirect_stdout(io.StringIO()):
        main(["simulate", WIDE, "-o", str(folder / "run.nc"), "--duration", "0.2s"])
    posteriors.write(folder / "posterior.nc")
    sp.render(WIDE, folder / "film.mp4", trial={"duration": 0.5}, camera={"size": "64x64", "fps": 5.0})
    (folder / "s.toml").write_text(STUDY)
    from spirillum.results import study as written
    from spirillum.studies import run

    kept, period = run.store_answer, run._PERIOD

    def copied(number: int, task: Any, part: Any, parts: Path) -> None:
        kept(number, task, part, parts)
        if not (folder / "part.npz").exists():
            shutil.copy(next(parts.glob("part-*.npz")), folder / "part.npz")

    report, run.store_answer, written.write_report = written.write_report, copied, lambda *_, **__: None
    run._PERIOD = -1.0  # each part is kept at once
    try:
        sp.study(folder / "s.toml", output=folder / "out")
        sp.study(folder / "s.toml", store=folder / "out.zarr")
    finally:
        run.store_answer, run._PERIOD, written.write_report = kept, period, report
    import pyarrow as pa
    from pyarrow import parquet

    columns = {"channel_diameter_mm": [40.0] * 3, "wavelength_mm": [20.0, 25.0, 30.0], "amplitude_mm": [2.5] * 3}
    columns |= {"forward_velocity_mm_s": [1.0, 1.1, 1.2], "tail_rate_Hz": [1.2] * 3}
    parquet.write_table(pa.table({**columns, "robot": ["a"] * 3}), folder / "o.parquet")
    names = ("run.nc", "posterior.nc", "film.mp4", "part.npz", "o.parquet")
    found = {name: (folder / name).read_bytes() for name in names}
    found |= {name: (folder / "out" / name).read_bytes() for name in ("study.json", "dataset.nc")}
    found |= {
        str(path.relative_to(folder)): path.read_bytes() for path in (folder / "out.zarr").rglob("*") if path.is_file()
    }
    from spirillum.robot.load import preset_text

    return found | {"robot.toml": preset_text(WIDE).encode(), "magnet.toml": preset_text("magnetic-helix").encode()}


def check(case: Case, folder: Path) -> None:
    """Run a case in a folder of its own.

    Raises:
        Promise: if a promise is broken.
    """
    from spirillum.cli import main

    for name, data in {**dict.fromkeys(_PRECIOUS[:1], b"precious"), **case.files}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    before = _state(folder)
    largest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    out, err, code, start = io.StringIO(), io.StringIO(), 0, time.process_time()
    unraisable: list[str] = []
    hook, sys.unraisablehook = sys.unraisablehook, lambda found: unraisable.append(repr(found.exc_value))
    try:
        with (
            warnings.catch_warnings(),
            contextlib.chdir(folder),
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
        ):
            warnings.simplefilter("error")
            main(case.command)
    except SystemExit as stopped:
        code = int(stopped.code or 0)
    except BaseException as error:
        raise Promise(f"{case.words}: {case.command}: {''.join(traceback.format_exception(error))[-1500:]}") from error
    finally:
        sys.unraisablehook = hook
    seconds, memory = time.process_time() - start, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # The peak is that of the process: what ran in it before may have needed more.
    said = err.getvalue()
    after = _state(folder)
    wrong = [
        ("exit code", code not in (0, 1, 2)),
        ("no sentence", code == 2 and not (said.startswith("spirillum: ") and said.count("\n") == 1)),
        ("unprintable", code == 2 and not said[:-1].isprintable()),
        ("printed on failure", code == 2 and out.getvalue() != ""),
        ("ignored errors", bool(unraisable)),
        ("too slow", seconds > _LONGEST),
        ("too much memory", memory > _LARGEST and memory - largest > _GROWTH),
        (
            "changed a user's file",
            any(after.get(name) != before[name] for name in before if not name.startswith(("out/", "out.zarr/"))),
        ),
        ("lost a file", not set(before) <= {*after, *(name for name in before if "/parts-" in name)}),
        ("written on failure", code == 2 and not set(after) <= {*before, "out/study.json"}),
        ("left a temporary file", any(".spirillum-part-" in name for name in after)),
    ]
    broken = [words for words, holds in wrong if holds]
    if broken:
        new = sorted(set(after) - set(before))
        seen = f"code {code}, {said[:300]!r}, {new}, {seconds:.1f} s, {memory} kB, {unraisable}"
        raise Promise(f"{case.words}: {case.command}: {broken}: {seen}")


def _state(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def main_of_this(seed: int, count: int) -> int:
    """Run cases and print what broke."""
    broken = 0
    with tempfile.TemporaryDirectory() as home:
        (Path(home) / "whole").mkdir()
        whole = whole_files(Path(home) / "whole")
        for number, case in enumerate(cases(seed, count, whole)):
            folder = Path(home) / str(number)
            folder.mkdir()
            try:
                check(case, folder)
            except Promise as error:
                broken += 1
                print(error, flush=True)  # noqa: T201
            shutil.rmtree(folder, ignore_errors=True)
    print(f"{count} cases, {broken} broke a promise, {time.process_time():.0f} s of CPU")  # noqa: T201
    return broken


if __name__ == "__main__":
    sys.exit(bool(main_of_this(int(sys.argv[1]), int(sys.argv[2]))))
