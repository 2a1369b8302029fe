"""Runs that are killed, interrupted, short of space, or two at once: nothing half, nothing lost, nothing refused."""

import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest

import faults


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["kills", "disks", "pairs", "interrupts"])
@pytest.mark.parametrize("seed", [1, 2])
def test_no_promise_is_broken(kind: str, seed: int) -> None:
    assert faults.run(kind, seed, 12) == []


@pytest.mark.slow
def test_a_small_disk_is_said() -> None:
    tried = subprocess.run(["unshare", "-rm", "mount", "-t", "tmpfs", "none", "/mnt"], capture_output=True, check=False)
    if tried.returncode:
        pytest.skip("no file system may be mounted here")
    assert faults.run("tmpfs", 1, 12) == []


@pytest.fixture
def limited(run: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Any]:
    """Run a command whose files may not grow beyond a size, as on a full disk."""

    def command(arguments: list[str], limit: int) -> Any:
        import resource

        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "dont_write_bytecode", True)  # else modules are kept cut off, for all processes
        before, most = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, most))
        try:
            return run(*arguments)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (before, most))

    return command


@pytest.mark.skipif(sys.platform == "win32", reason="no such limits")
@pytest.mark.parametrize(
    "command",
    [
        ["simulate", "biorob2012-wide", "--model", "rft", "-o", "out.nc", "--duration", "0.1s"],
        ["render", "biorob2012-wide", "-o", "out.mp4", "--size", "64x64", "--fps", "5", "--duration", "0.6s"],
        ["export", "biorob2012-wide", "out.stl"],
    ],
)
def test_a_full_disk_is_said_and_leaves_nothing(
    limited: Callable[..., Any], tmp_path: Path, command: list[str]
) -> None:
    found = limited(command, 1000)
    assert (found.code, found.out) == (2, "")
    # Loops that are compiled for the first time are kept, and may be what finds no space.
    target = "out.stl" if command[0] == "export" else "(out.nc|out.mp4|the output)"
    assert re.fullmatch(rf"spirillum: no space is left for .*{target}; allowed: a place with space\n", found.err)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="no such limits")
def test_a_design_is_written_with_its_body_for_a_printer_or_not_at_all(
    limited: Callable[..., Any], run: Callable[..., Any], tmp_path: Path
) -> None:
    search = ["--vary", "tail.wavelength=20mm:30mm", "--maximise", "forward_velocity"]
    files = ["-o", "best.toml", "--stl", "best.stl"]
    command = ["design", "biorob2012-wide", "--model", "rft", *search, *files]
    found = limited(command, 30_000)
    assert found.code == 2
    assert found.err == "spirillum: no space is left for best.stl; allowed: a place with space\n"
    assert list(tmp_path.iterdir()) == []
    assert run(*command, "--plot", "best.png").code == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["best.png", "best.stl", "best.toml"]


@pytest.mark.skipif(sys.platform == "win32", reason="no such streams")
@pytest.mark.parametrize(
    ("arguments", "streams", "code"),
    [
        pytest.param("predict missing.toml", "2>&-", 2, marks=pytest.mark.slow),
        pytest.param("predict missing.toml", "2>/dev/full", 2, marks=pytest.mark.slow),
        ("robot show biorob2012-wide", ">&- 2>&-", 2),
        ("robot show biorob2012-wide --json", ">/dev/full 2>/dev/full", 2),
    ],
)
def test_a_stream_that_nobody_reads_changes_no_exit_code(arguments: str, streams: str, code: int) -> None:
    command = f"{sys.executable} -m spirillum {arguments} {streams}"
    assert subprocess.run(command, shell=True, check=False, capture_output=True).returncode == code


@pytest.mark.skipif(sys.platform == "win32", reason="no such streams")
@pytest.mark.parametrize("more", ["", pytest.param(" --json", marks=pytest.mark.slow)])
def test_an_answer_for_a_closed_stream_is_not_lost_without_a_word(more: str) -> None:
    command = f"{sys.executable} -m spirillum robot show biorob2012-wide{more} >&-"
    found = subprocess.run(command, shell=True, check=False, capture_output=True, text=True)
    assert found.returncode == 2
    assert found.stderr.startswith("spirillum: standard output is closed, and the answer is lost; allowed: ")


@pytest.mark.parametrize(
    ("entry", "interrupted"), [("spirillum.__main__", "spirillum.cli"), ("spirillum.cli", "spirillum.cli.app")]
)
def test_an_interrupt_while_modules_are_imported_is_one_too(entry: str, interrupted: str) -> None:
    """Also before the program's own handler of signals is there: no traceback, and the exit code of an interrupt."""
    script = (
        "import os, signal, sys\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"  # a shell's background job ignores it
        "class Finder:\n"
        "    def find_spec(self, name, *_):\n"
        f"        if name == '{interrupted}':\n"
        "            os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Finder())\n"
        f"from {entry} import main\n"
        "sys.argv = ['spirillum', '--help']\n"
        "main()\n"
    )
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (found.returncode, found.stderr) == (130, "spirillum: interrupted; finished files are kept\n")


def test_an_interrupt_while_an_object_is_removed_is_not_lost() -> None:
    script = (
        "import os, signal, sys, time\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "class Removed:\n"
        "    def __del__(self):\n"
        "        os.kill(os.getpid(), signal.SIGINT)\n"
        "        [None for _ in range(1000)]\n"
        "class Finder:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'spirillum.cli.app':\n"
        "            Removed()\n"
        "            [time.sleep(0.01) for _ in range(500)]\n"  # one long sleep would first end
        "sys.meta_path.insert(0, Finder())\n"
        "from spirillum.cli import main\n"
        "sys.argv = ['spirillum', '--help']\n"
        "main()\n"
    )
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert (found.returncode, found.stderr) == (130, "spirillum: interrupted; finished files are kept\n")


SETTINGS = "text.usetex: True\nfont.family: nowhere\nbackend: nonsense\nlines.nonsense: 1\nfigure.facecolor: red\n"


def test_figures_are_ours_whatever_the_users_settings_are(tmp_path: Path, run) -> None:  # type: ignore[no-untyped-def]
    asked = ["compare-models", "biorob2012-wide", "--model", "sbt", "-o"]
    assert run(*asked, str(tmp_path / "plain.png")).code == 0
    command = [sys.executable, "-m", "spirillum", *asked]
    (tmp_path / "config").mkdir()
    for fonts in Path(mpl.get_cachedir()).glob("fontlist-*.json"):  # else they are searched for, which is said
        shutil.copy(fonts, tmp_path / "config")
    (tmp_path / "config" / "matplotlibrc").write_bytes(b"\xff\xfe")
    (tmp_path / "matplotlibrc").write_text(SETTINGS)
    settings = os.environ | {"MPLCONFIGDIR": str(tmp_path / "config"), "MPLBACKEND": "nonsense"}
    found = subprocess.run(
        [*command, "set.png"], cwd=tmp_path, env=settings, check=False, capture_output=True, text=True
    )
    said = [line for line in found.stderr.splitlines() if not line.endswith(" elapsed")]
    assert (found.returncode, said) == (0, [])
    assert (tmp_path / "set.png").read_bytes() == (tmp_path / "plain.png").read_bytes()
    (tmp_path / "matplotlibrc").write_bytes(b"\xff\xfe")
    found = subprocess.run([*command, "set.png"], cwd=tmp_path, check=False, capture_output=True, text=True)
    assert found.returncode == 2
    assert found.stderr.startswith("spirillum: the settings of matplotlib cannot be read")


def test_figures_are_ours_in_a_session_with_other_settings(tmp_path: Path) -> None:
    import matplotlib as mpl

    from spirillum.view.figures.style import new_figure, save_as, styled

    def draw(name: str) -> bytes:
        with styled():
            figure = new_figure(2.0, 1.0)
            figure.subplots().plot([0, 1], label="µ")
        save_as(figure, tmp_path / name)
        return (tmp_path / name).read_bytes()

    plain = draw("plain.png")
    with mpl.rc_context({"text.usetex": True, "axes.facecolor": "red", "axes.titlesize": 40, "savefig.bbox": "tight"}):
        assert draw("set.png") == plain
        assert mpl.rcParams["text.usetex"]


@pytest.mark.parametrize(
    "commands",
    [
        (
            "predict biorob2012-wide --model tube --no-band --motion held",
            "compare-models biorob2012-wide --model sbt -o models.png",
        ),
        pytest.param(("calibrate o.csv biorob2012-wide --method paper",), marks=pytest.mark.slow),
        pytest.param(("rank-models o.csv biorob2012-wide --model sbt --model rft",), marks=pytest.mark.slow),
    ],
)
def test_without_a_home_nothing_is_kept_and_nothing_made(tmp_path: Path, commands: tuple[str, ...]) -> None:
    script = (
        "import pwd\n"
        "def unknown(*_): raise KeyError('no such user')\n"
        "pwd.getpwuid = pwd.getpwnam = unknown\n"
        "import shlex, sys\n"
        "from spirillum.cli import main\n"
        "for command in sys.argv[1:]:\n"
        "    sys.argv = ['spirillum', *shlex.split(command)]\n"
        "    try: main()\n"
        "    except SystemExit as left: assert left.code in (0, 2, None), left.code\n"
    )
    kept = {name: value for name, value in os.environ.items() if name not in ("HOME", "USER", "LOGNAME", "USERNAME")}
    kept = {name: value for name, value in kept.items() if not name.startswith(("XDG_", "SPIRILLUM_"))}
    (tmp_path / "o.csv").write_text(
        "channel_diameter_mm,wavelength_mm,amplitude_mm,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz\n"
        "40,20,2.5,1.1,1.2,-0.4\n40,25,2.5,1.2,1.2,-0.4\n40,30,2.5,1.25,1.2,-0.4\n"
    )
    found = subprocess.run(
        [sys.executable, "-c", script, *commands], cwd=tmp_path, env=kept, capture_output=True, text=True, check=False
    )
    assert found.returncode == 0, found.stderr
    assert "Traceback" not in found.stderr
    assert not (tmp_path / "~").exists()


def test_a_command_within_a_program_leaves_its_signals_alone(run) -> None:  # type: ignore[no-untyped-def]
    before = signal.getsignal(signal.SIGINT)
    assert run("--help").code == 0
    assert signal.getsignal(signal.SIGINT) is before
