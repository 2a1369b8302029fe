"""Builds the wheels of all platforms, and the sources, on one machine, by the compiler of the wheel `ziglang`.

python tools/build_wheels.py [FOLDER]

The wheel of this platform is installed into an empty environment, imported and asked for a speed: of each platform the
wheel is tested where that is run.
"""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).parents[1]


def main(folder: str = "dist") -> None:
    """Build one wheel a platform, each from a copy of the sources without what another one left behind, and those."""
    with tempfile.TemporaryDirectory() as work:
        pip = _environment(Path(work, "tools"))
        subprocess.run([*pip, "install", "--quiet", "--no-compile", "hatchling", "ziglang"], check=True)
        for tag in runpy.run_path(str(ROOT / "csrc" / "build.py"))["TARGETS"]:
            copy = _sources(Path(work, tag))
            command = [*pip, "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir", folder, copy]
            subprocess.run(command, check=True, env=os.environ | {"SPIRILLUM_WHEEL": tag})
            print(next(path for path in Path(folder).glob("spirillum-*.whl") if tag in path.name))
        build = [pip[0], "-m", "hatchling", "build", "--target", "sdist", "--directory", Path(folder).resolve()]
        subprocess.run(build, cwd=_sources(Path(work, "sources")), check=True)
        _check_installed(Path(folder).resolve(), Path(work, "installed"))


def _environment(folder: Path) -> list[str]:
    """Make an environment; return the command of its pip."""
    venv.create(folder, with_pip=True)
    return [str(folder / ("Scripts" if os.name == "nt" else "bin") / "python"), "-m", "pip"]


def _check_installed(wheels: Path, folder: Path) -> None:
    """Install the wheel that fits this platform, import it and predict a robot from its tables and compiled loops."""
    pip = _environment(folder)
    subprocess.run(
        [*pip, "install", "--quiet", "--no-index", "--no-deps", "--find-links", wheels, "spirillum"], check=True
    )
    subprocess.run([*pip, "install", "--quiet", "spirillum"], check=True)  # what it depends on
    answer = "import spirillum as sp; found = sp.predict('biorob2012-wide'); print(found, found.trial.values['gap'])"
    alone = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "SPIRILLUM"))}
    subprocess.run([pip[0], "-c", answer], cwd=folder, env=alone, check=True)


def _sources(copy: Path) -> Path:
    """Write the committed sources into a new folder."""
    copy.mkdir()
    files = subprocess.run(["git", "archive", "HEAD"], cwd=ROOT, check=True, capture_output=True).stdout
    subprocess.run(["tar", "-x", "-C", copy], input=files, check=True)
    return copy


if __name__ == "__main__":
    main(*sys.argv[1:])
