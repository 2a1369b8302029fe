"""Compiles csrc/ into the package: by the system's C compiler, else by the one that comes as a wheel (ziglang).

The build hook of the package calls it. In a clone on PYTHONPATH, after a change of csrc/: `python csrc/build.py`.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

SOURCES = Path(__file__).parent
PACKAGE = SOURCES.parent / "src/spirillum/kernels"
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
FLAGS = (
    *("-std=c11", "-O3", "-shared", "-fPIC", "-fvisibility=hidden"),
    # The same numbers on every processor: no fused products, no sums in another order; `errno` and traps are not read.
    *("-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"),
)
STRICT = ("-Wall", "-Wextra", "-Wshadow", "-Wconversion", "-Wno-sign-conversion", "-Werror")
"""Of the project's own tests: a compiler of tomorrow may warn of more."""
VARIANTS = {"": (), "_v3": ("-march=x86-64-v3",)}
"""Builds by the end of their names: for every processor, and for those with 256-bit vectors (x86-64 since 2013)."""


def compiler() -> list[str]:
    """Return the command that compiles C: `SPIRILLUM_CC`, the system's `cc`, or that of the `ziglang` wheel."""
    if stated := os.environ.get("SPIRILLUM_CC"):
        return stated.split()
    return [found] if (found := shutil.which("cc")) else [sys.executable, "-m", "ziglang", "cc"]


def digest() -> str:
    """Return the digest of all C sources, which the library states as `csrc_digest`."""
    found = hashlib.sha256()
    for path in sorted(SOURCES.glob("*.[ch]")):
        found.update(path.read_bytes())
    return found.hexdigest()


def is_current() -> bool:
    """Whether the package's library was compiled from these sources."""
    library = PACKAGE / f"_core{SUFFIX}"
    return library.exists() and digest().encode() in library.read_bytes()


def compile_all(folder: Path = PACKAGE, flags: tuple[str, ...] = ()) -> list[Path]:
    """Compile csrc/ for this machine into a folder; return the libraries, each replaced as a whole."""
    command = [*compiler(), *FLAGS, *flags, f'-DCSRC_DIGEST="{digest()}"']
    files = [str(path) for path in sorted(SOURCES.glob("*.c"))]
    variants = VARIANTS if platform.machine().lower() in {"x86_64", "amd64"} else {"": ()}
    libraries = []
    for name, more in variants.items():
        library = folder / f"_core{name}{SUFFIX}"
        partial = library.with_name(f"{library.stem}.{os.getpid()}{SUFFIX}")
        subprocess.run([*command, *more, "-o", str(partial), *files, "-lm"], check=True)  # noqa: S603
        partial.replace(library)
        libraries.append(library)
    return libraries


if __name__ == "__main__":
    compile_all()
