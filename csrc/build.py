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
import sysconfig
from pathlib import Path
from typing import NamedTuple

SOURCES = Path(__file__).parent
PACKAGE = SOURCES.parent / "src/spirillum/kernels"
SUFFIXES = {"win": ".dll", "mac": ".dylib"}
"""Of libraries, by the first letters of a wheel's tag; else .so."""
FLAGS = (
    *("-std=c11", "-O3", "-shared", "-fPIC", "-fvisibility=hidden"),
    # The same numbers on every processor: no fused products, no sums in another order; `errno` and traps are not read.
    *("-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"),
    "-fopenmp-simd",  # heeds `omp simd`, which needs no library
)
STRICT = ("-Wall", "-Wextra", "-Wshadow", "-Wconversion", "-Wno-sign-conversion", "-Werror")
"""Of the project's own tests: a compiler of tomorrow may warn of more."""
WIDE = ("-mavx2", "-mbmi2")
"""Of a second build for x86-64, which processors since 2013 take."""
ZIG = [sys.executable, "-m", "ziglang", "cc"]
TARGETS = {
    "manylinux_2_17_x86_64": "x86_64-linux-gnu.2.17",
    "manylinux_2_17_aarch64": "aarch64-linux-gnu.2.17",
    "macosx_11_0_arm64": "aarch64-macos.11.0",
    "macosx_11_0_x86_64": "x86_64-macos.11.0",
    "win_amd64": "x86_64-windows-gnu",
}
"""What zig calls the platform of a wheel."""


class Compiler(NamedTuple):
    """How C is compiled."""

    command: list[str]
    tag: str
    """Platform that is compiled for, as the names of wheels have it."""

    @property
    def suffix(self) -> str:
        """End of a library's name."""
        return SUFFIXES.get(self.tag[:3], ".so")


def compiler() -> Compiler:
    """Return the compiler: `SPIRILLUM_CC`, the system's `cc` or zig for this machine, zig for `SPIRILLUM_WHEEL`."""
    if tag := os.environ.get("SPIRILLUM_WHEEL"):
        return Compiler([*ZIG, "-target", TARGETS[tag]], tag)
    own = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    if stated := os.environ.get("SPIRILLUM_CC"):
        return Compiler(stated.split(), own)
    return Compiler([found] if (found := shutil.which("cc")) else ZIG, own)


def needs_zig() -> bool:
    """Whether the compiler is the one that comes as a wheel."""
    return compiler().command[: len(ZIG)] == ZIG


def digest() -> str:
    """Return the digest of all C sources, which the library states as `csrc_digest`."""
    found = hashlib.sha256()
    for path in sorted(SOURCES.glob("*.[ch]")):
        found.update(path.read_bytes())
    return found.hexdigest()


def is_current() -> bool:
    """Whether the package's library was compiled from these sources."""
    library = PACKAGE / f"_core{compiler().suffix}"
    return library.exists() and digest().encode() in library.read_bytes()


def compile_all(folder: Path = PACKAGE, flags: tuple[str, ...] = (), *, wide: bool = True) -> list[Path]:
    """Compile csrc/ into a folder, the wide variant too; return the libraries, each replaced as a whole."""
    command, tag = compiler()
    files = [str(path) for path in sorted(SOURCES.glob("*.c"))]
    machine = tag if tag in TARGETS else platform.machine().lower()
    variants = {"": (), "_v3": WIDE} if wide and machine.endswith(("x86_64", "amd64")) else {"": ()}
    begun = []
    for name, more in variants.items():
        library = folder / f"_core{name}{compiler().suffix}"
        partial = library.with_name(f"{library.stem}.{os.getpid()}{library.suffix}")
        names = [*FLAGS, *flags, *more, f'-DCSRC_DIGEST="{digest()}"', "-o", str(partial), *files, "-lm"]
        begun.append((library, partial, subprocess.Popen([*command, *names])))  # noqa: S603
    for library, partial, compiling in begun:
        if compiling.wait():
            raise subprocess.CalledProcessError(compiling.returncode, compiling.args)
        partial.replace(library)
    return [library for library, *_ in begun]


if __name__ == "__main__":
    compile_all()
