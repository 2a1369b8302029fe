"""The package installs, and runs, on a machine that has Python and nothing else: the index serves the compiler."""

import os
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def test_a_name_without_a_working_compiler_is_passed_over(tmp_path: Path) -> None:
    """As macOS has it without its developer tools."""
    if os.name != "posix":
        pytest.skip("the stand-in is a shell script")
    stand_in = tmp_path / "cc"
    stand_in.write_text("#!/bin/sh\nexit 1\n")
    stand_in.chmod(0o755)
    question = "import runpy, sys; print(runpy.run_path(sys.argv[1])['needs_zig']())"
    said = subprocess.run(
        [sys.executable, "-c", question, ROOT / "csrc/build.py"],
        env={name: value for name, value in os.environ.items() if name != "SPIRILLUM_CC"} | {"PATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert said.stdout == "True\n"


@pytest.mark.slow
def test_installs_with_nothing_on_the_path_but_python(tmp_path: Path) -> None:
    """From a copy of the sources; the dependencies are those of the tests."""
    sources = tmp_path / "sources"
    sources.mkdir()
    archive = subprocess.run(["git", "archive", "HEAD"], cwd=ROOT, check=True, capture_output=True).stdout
    subprocess.run(["tar", "-x", "-C", sources], input=archive, check=True)
    venv.create(tmp_path / "clean", with_pip=True)
    programs = tmp_path / "clean" / ("Scripts" if os.name == "nt" else "bin")
    alone = {name: value for name, value in os.environ.items() if name not in {"SPIRILLUM_CC", "PYTHONPATH"}}
    alone |= {"PATH": str(programs), "SPIRILLUM_CACHE": "off"}
    install = [programs / "python", "-m", "pip", "install", "-v", "--no-deps", "."]
    said = subprocess.run(install, cwd=sources, env=alone, capture_output=True, text=True, check=False)
    output = said.stdout + said.stderr
    if "No matching distribution found for ziglang" in output:
        pytest.skip("no index serves the compiler here")
    assert said.returncode == 0, output[-3000:]
    lines = [line.strip() for line in output.splitlines() if "compiled csrc/ for" in line]
    assert len(lines) == 1
    assert lines[0].endswith("-m ziglang cc")
    run = [programs / "spirillum", "predict", "biorob2012-wide", "--motion", "held", "--json"]
    dependencies = {"PYTHONPATH": sysconfig.get_path("purelib")}
    said = subprocess.run(run, cwd=tmp_path, env=alone | dependencies, capture_output=True, text=True, check=False)
    assert said.returncode == 0, said.stderr[-3000:]
    assert '"forward_velocity"' in said.stdout
