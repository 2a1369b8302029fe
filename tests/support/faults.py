"""Kills, full disks, pairs of runs and interrupts, at random from a seed.

    python tests/support/faults.py kills|disks|tmpfs|pairs|interrupts SEED COUNT [COMMAND ...]

runs COUNT of them, of all commands or of those that are named, and prints what broke a promise. A full disk is a limit
on the size of files (`RLIMIT_FSIZE`), which needs no rights, or, with `tmpfs`, a small disk in memory in a name space
of its own (`unshare`), where that is allowed.
"""

import hashlib
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

WIDE = "biorob2012-wide"
_SIZE = ("--size", "64x64", "--fps", "5", "--duration", "0.6s")
_VARY = ("--vary", "tail.wavelength=15mm:30mm")
COMMANDS: dict[str, list[str]] = {
    "simulate": ["simulate", WIDE, "-o", "out.nc", "--duration", "0.2s", "--plot", "out.png"],
    "study": ["study", "s.toml", "-o", "out"],
    "calibrate": ["calibrate", "o.csv", WIDE, "--method", "least-squares", "--free", "body_drag", "-o", "out"],
    "render": ["render", WIDE, "-o", "out.mp4", *_SIZE],
    "frames": ["render", WIDE, "-o", "out", *_SIZE],
    "export": ["export", WIDE, "out.urdf"],
    "mesh": ["export", WIDE, "out.stl"],
    "scene": ["export", WIDE, "out.glb"],
    "unit": ["export", WIDE, "out.fmu"],
    "recording": ["export", "run.nc", "out.mcap"],
    "sweep": ["magnetic-sweep", "magnetic-helix", "-o", "out.nc", "--rate", "1Hz", "--turns", "4", "--plot", "out.png"],
    "track": ["track", "b.mp4", "--setup", "b.setup.toml", "--pace", "fast", "--learn", "1s"],
    "propose": ["setup", "propose", "b.mp4", "--spacing", "2mm", "-o", "out.toml"],
    "setup": ["setup", "new", "out.toml"],
    "page": ["page", "--no-browser"],
    "virtual": ["virtual-experiment", "s.toml", "-o", "out", "--trials", "2", *_SIZE],
    "join": ["observations", "join", "o.csv", "p.csv", "-o", "out.csv"],
    "compare": ["compare-models", WIDE, "--model", "sbt", "--model", "rft", "-o", "out.svg"],
    "measure": ["measure", "a.mp4", "--setup", "a.setup.toml", "--marks", "m.csv", "--no-tracking", "-o", "out"],
    "control": [
        "control",
        WIDE,
        "--model",
        "rft",
        "--at",
        "2mm",
        "--tolerance",
        "0.5mm",
        "--duration",
        "0.3s",
        "-o",
        "out.nc",
    ],
    "design": ["design", WIDE, "--model", "rft", "--maximise", "forward_velocity", *_VARY, "-o", "out.toml"],
    "store": ["study", "s.toml", "--store", "out.zarr"],
    "new": ["robot", "new", "out.toml"],
}
_ROWS = "channel_diameter_mm,wavelength_mm,amplitude_mm,trial,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz\n"
_EDITED = ("new", "setup", "propose", "design")
"""Commands that write a file for users to edit, which is never replaced."""
_PAGE = 5.0
"""The page is open for so long, s."""
_VARIES = re.compile(re.escape(os.fsencode(tempfile.gettempdir())) + rb"/[\w./-]+|[\d.]+ s\b")


class Ended(NamedTuple):
    """How a command ended."""

    code: int
    err: str


def prepared(folder: Path) -> None:
    """Write the inputs of all commands."""
    (folder / "s.toml").write_text(f'title = "t"\nmodels = ["sbt"]\nrobots = ["{WIDE}"]\nfriction = ["rotor"]\n')
    for name, trial in (("o", 1), ("p", 2)):
        rows = "".join(f"40,{w},2.5,{trial},{1 + 0.01 * w},1.2,-0.4\n" for w in (15, 20, 25))
        (folder / f"{name}.csv").write_text(_ROWS + rows)
    (folder / "m.csv").write_text("time_s,x_mm,y_mm\n0,0,0\n0.2,1,0\n0.4,2,0\n0.6,3,0\n")


def started(command: list[str], folder: Path, limit: int | None = None) -> subprocess.Popen[str]:
    """A command in a process of its own."""

    def limited() -> None:
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    process = subprocess.Popen(
        [sys.executable, "-m", "spirillum", *command],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        preexec_fn=limited,  # noqa: PLW1509 - this process only waits for others
        start_new_session=True,
        env=os.environ
        | ({"TMPDIR": str(folder)} if command[0] == "page" else {})
        | ({} if limit is None else {"PYTHONDONTWRITEBYTECODE": "1"}),  # else modules are kept cut off
    )
    if command[0] == "page":
        threading.Timer(_PAGE, process.send_signal, [signal.SIGINT]).start()
    return process


def ended(process: subprocess.Popen[str]) -> Ended:
    """Wait for its end."""
    _, err = process.communicate(timeout=1200)
    return Ended(process.returncode, re.sub(r".* elapsed.*\n", "", err))  # a slow machine prints progress


def files_of(folder: Path) -> dict[str, bytes]:
    """All files and empty folders with what tells them apart: numbers of NetCDF files, bytes of others."""
    return {
        str(path.relative_to(folder)): _content(path) if path.is_file() else b""
        for path in sorted(folder.rglob("*"))
        if not path.is_symlink() and (path.is_file() or not any(path.iterdir()))
    }


def _content(path: Path) -> bytes:
    if path.suffix == ".nc":
        import xarray as xr

        with xr.open_dataset(path, engine="h5netcdf", decode_times=False) as found:
            parts = [f"{name} {item.values.tobytes()!r}" for name, item in sorted(found.variables.items())]
        return hashlib.sha256("".join(parts).encode()).digest()
    return hashlib.sha256(_VARIES.sub(b"", path.read_bytes())).digest()


def wrong_words(found: Ended, allowed: tuple[int, ...]) -> list[str]:
    """What is wrong with how a command ended."""
    wrong = [] if found.code in allowed else [f"code {found.code}"]
    if found.code not in (0, -signal.SIGKILL, -signal.SIGINT) and not (
        found.err.startswith("spirillum: ") and found.err.count("\n") == 1
    ):
        wrong.append(f"no sentence: {found.err[-600:]!r}")
    if found.code == 0 and "Traceback" in found.err:
        wrong.append(f"a traceback: {found.err[-600:]!r}")
    return wrong


class Faults:
    """Faults of a seed, in a home of their own."""

    def __init__(self, home: Path, seed: int) -> None:
        self.home, self.rng, self.number = home, np.random.default_rng(seed), 0
        self._whole: dict[str, tuple[dict[str, bytes], float]] = {}
        (home / "inputs").mkdir()
        prepared(home / "inputs")
        for command in (
            ["render", WIDE, "-o", "a.mp4", *_SIZE],
            ["render", WIDE, "-o", "b.mp4", "--size", "320x240", "--fps", "12", "--duration", "2.4s"],
            ["simulate", WIDE, "-o", "run.nc", "--duration", "0.2s"],
        ):
            assert ended(started(command, home / "inputs")).code == 0

    def folder(self) -> Path:
        """A new folder with all inputs."""
        self.number += 1
        return Path(shutil.copytree(self.home / "inputs", self.home / str(self.number)))

    def whole(self, name: str) -> tuple[dict[str, bytes], float]:
        """What a command writes where nothing disturbs it, and how long it takes."""
        if name not in self._whole:
            folder, start = self.folder(), time.perf_counter()
            found = ended(started(COMMANDS[name], folder))
            assert found.code == 0, found
            self._whole[name] = files_of(folder), time.perf_counter() - start
            shutil.rmtree(folder)
        return self._whole[name]

    def chosen(self, names: Sequence[str]) -> str:
        """A command of these."""
        return names[int(self.rng.integers(len(names)))]

    def kill(self, name: str, number: int = signal.SIGKILL) -> list[str]:
        """Kill or interrupt a command at a random time, and run it again."""
        whole, seconds = self.whole(name)
        folder = self.folder()
        process = started(COMMANDS[name], folder)
        time.sleep(float(self.rng.uniform(0.0, 1.1)) * seconds)
        os.kill(process.pid, number)
        first = ended(process)
        wrong = wrong_words(first, (0, 130, -number)) if number == signal.SIGINT else []
        half = {path: data for path, data in files_of(folder).items() if path in whole and ".spirillum" not in path}
        ours = {path for path, data in half.items() if whole[path] != data and path.endswith((".nc", ".toml", ".csv"))}
        wrong += [f"half or other files: {sorted(ours)}"] if ours else []
        if name in _EDITED and (folder / "out.toml").exists():
            (folder / "out.toml").unlink()
        wrong += [f"again: {word}" for word in wrong_words(ended(started(COMMANDS[name], folder)), (0,))]
        after = files_of(folder)
        different = sorted(path for path in {*whole, *after} if whole.get(path) != after.get(path))
        wrong += [f"another result: {different}"] if different else []
        shutil.rmtree(folder)
        return wrong

    def interrupt(self, name: str) -> list[str]:
        """Interrupt a command as Ctrl-C does."""
        return self.kill(name, signal.SIGINT)

    def disk(self, name: str) -> list[str]:
        """Let no file grow beyond a random size."""
        whole, _ = self.whole(name)
        folder = self.folder()
        before = files_of(folder)
        limit = int(np.exp(self.rng.uniform(np.log(10.0), np.log(400_000.0))))
        found = ended(started(COMMANDS[name], folder, limit))
        return self._after_a_full_disk(name, found, folder, before, whole)

    def tmpfs(self, name: str) -> list[str]:
        """Run on a small disk in memory."""
        whole, _ = self.whole(name)
        folder = self.folder()
        before = files_of(folder)
        inputs = sum(4096 * (path.stat().st_size // 4096 + 1) for path in folder.iterdir())
        size = inputs + int(np.exp(self.rng.uniform(np.log(8_000.0), np.log(600_000.0))))
        source = self.home / "source"
        shutil.rmtree(source, ignore_errors=True)
        shutil.copytree(folder, source)
        script = f"mount -t tmpfs -o size={size} none {folder} && cp {source}/* {folder} 2>/dev/null; cd {folder}; "
        script += f'"$@"; code=$?; mkdir -p {source}.out; cp -r {folder}/. {source}.out/; exit $code'
        command = ["unshare", "-rm", "sh", "-c", script, "sh", sys.executable, "-m", "spirillum", *COMMANDS[name]]
        made = subprocess.run(command, capture_output=True, text=True, check=False)
        result = Path(f"{source}.out")
        wrong = self._after_a_full_disk(name, Ended(made.returncode, made.stderr), result, before, whole)
        shutil.rmtree(folder)
        return wrong

    def _after_a_full_disk(
        self, name: str, found: Ended, folder: Path, before: Mapping[str, bytes], whole: Mapping[str, bytes]
    ) -> list[str]:
        wrong = wrong_words(found, (0, 2))
        after = files_of(folder)
        wrong += [f"lost {path}" for path in before if path in after and after[path] != before[path]]
        half = {path for path, data in after.items() if path in whole and path not in before and whole[path] != data}
        wrong += [f"half files: {sorted(half)}"] if half else []
        left = [path for path in after if ".spirillum-part-" in path]
        wrong += [f"left: {left}"] if left else []
        shutil.rmtree(folder)
        return [f"{word} ({name})" for word in wrong]

    def pair(self, name: str) -> list[str]:
        """Two runs of one command at once."""
        whole, seconds = self.whole(name)
        folder = self.folder()
        first = started(COMMANDS[name], folder)
        time.sleep(float(self.rng.uniform(0.0, 0.3)) * seconds)
        second = started(COMMANDS[name], folder)
        both = ended(first), ended(second)
        wrong = [word for found in both for word in wrong_words(found, (0, 2))]
        if all(found.code for found in both):
            wrong.append(f"none was done: {both}")
        after = files_of(folder)
        different = sorted(path for path in {*whole, *after} if whole.get(path) != after.get(path))
        wrong += [f"another result: {different}"] if different else []
        shutil.rmtree(folder)
        return wrong


def run(kind: str, seed: int, count: int, commands: Sequence[str] = ()) -> list[str]:
    """Some faults of a kind, of some commands or of all; what broke a promise, in words."""
    found = []
    with tempfile.TemporaryDirectory() as home:
        faults = Faults(Path(home), seed)
        one: Callable[[str], list[str]] = {
            "kills": faults.kill,
            "disks": faults.disk,
            "tmpfs": faults.tmpfs,
            "pairs": faults.pair,
            "interrupts": faults.interrupt,
        }[kind]
        for number in range(count):
            name = faults.chosen(commands or list(COMMANDS))
            wrong = one(name)
            found += [f"{kind} {number}, seed {seed}, {name}: {word}" for word in wrong]
            if wrong:
                print(*found[-len(wrong) :], sep="\n", flush=True)  # noqa: T201
    return found


if __name__ == "__main__":
    broken = run(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), sys.argv[4:])
    print(f"{sys.argv[3]} {sys.argv[1]}, {len(broken)} broken promises")  # noqa: T201
    sys.exit(bool(broken))
