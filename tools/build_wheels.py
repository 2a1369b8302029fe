"""Builds the wheels of all platforms on one machine, by the compiler of the wheel `ziglang` (pip install ziglang).

python tools/build_wheels.py [FOLDER]
"""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]


def main(folder: str = "dist") -> None:
    """Build one wheel a platform, each from a copy of the sources without what another one left behind."""
    for tag in runpy.run_path(str(ROOT / "csrc" / "build.py"))["TARGETS"]:
        with tempfile.TemporaryDirectory() as copy:
            files = subprocess.run(["git", "archive", "HEAD"], cwd=ROOT, check=True, capture_output=True).stdout
            subprocess.run(["tar", "-x", "-C", copy], input=files, check=True)
            command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", folder, copy]
            subprocess.run(command, check=True, env=os.environ | {"SPIRILLUM_WHEEL": tag})
        print(next(path for path in Path(folder).glob("spirillum-*.whl") if tag in path.name))


if __name__ == "__main__":
    main(*sys.argv[1:])
