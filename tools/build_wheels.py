"""Builds the wheels of all platforms, and the sources, on one machine, by the compiler of the wheel `ziglang`.

python tools/build_wheels.py [FOLDER]
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
        venv.create(f"{work}/tools", with_pip=True)
        pip = [f"{work}/tools/{'Scripts' if os.name == 'nt' else 'bin'}/python", "-m", "pip"]
        subprocess.run([*pip, "install", "--quiet", "--no-compile", "hatchling", "ziglang"], check=True)
        for tag in runpy.run_path(str(ROOT / "csrc" / "build.py"))["TARGETS"]:
            copy = _sources(Path(work, tag))
            command = [*pip, "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir", folder, copy]
            subprocess.run(command, check=True, env=os.environ | {"SPIRILLUM_WHEEL": tag})
            print(next(path for path in Path(folder).glob("spirillum-*.whl") if tag in path.name))
        build = [pip[0], "-m", "hatchling", "build", "--target", "sdist", "--directory", Path(folder).resolve()]
        subprocess.run(build, cwd=_sources(Path(work, "sources")), check=True)


def _sources(copy: Path) -> Path:
    """Write the committed sources into a new folder."""
    copy.mkdir()
    files = subprocess.run(["git", "archive", "HEAD"], cwd=ROOT, check=True, capture_output=True).stdout
    subprocess.run(["tar", "-x", "-C", copy], input=files, check=True)
    return copy


if __name__ == "__main__":
    main(*sys.argv[1:])
