"""Compiles the loops of csrc/ into the package: by the system's C compiler, else by the one that comes as a wheel.

python hatch_build.py    # compiles them in place, after a change of csrc/ in a clone that is on PYTHONPATH
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
from typing import Any

FLAGS = (
    *("-std=c11", "-O3", "-shared", "-fPIC", "-fvisibility=hidden"),
    # The same numbers on every processor: no fused products, no sums in another order; `errno` and traps are not read.
    *("-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"),
)
STRICT = ("-Wall", "-Wextra", "-Wshadow", "-Wconversion", "-Wno-sign-conversion", "-Werror")
"""Of the project's own tests; a compiler of tomorrow may warn of more."""
VARIANTS = {"": (), "_v3": ("-march=x86-64-v3",)}
"""Builds by the end of their names: for every processor, and for those with 256-bit vectors (x86-64 since 2013)."""
_ROOT = Path(__file__).parent
_TARGET = Path("src/spirillum/kernels")
_SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")


def compiler() -> list[str]:
    """Return the command that compiles C: `SPIRILLUM_CC`, the system's `cc`, or that of the `ziglang` wheel."""
    if stated := os.environ.get("SPIRILLUM_CC"):
        return stated.split()
    return [found] if (found := shutil.which("cc")) else [sys.executable, "-m", "ziglang", "cc"]


def digest(sources: Path) -> str:
    """Return the digest of all C sources, which the library states as `csrc_digest`."""
    found = hashlib.sha256()
    for path in sorted(sources.glob("*.[ch]")):
        found.update(path.read_bytes())
    return found.hexdigest()


def compile_all(root: Path, flags: tuple[str, ...] = ()) -> list[Path]:
    """Compile csrc/ for this machine; return the libraries, each of which replaces the former one at once."""
    command = [*compiler(), *FLAGS, *flags, f'-DCSRC_DIGEST="{digest(root / "csrc")}"']
    sources = [str(path) for path in sorted((root / "csrc").glob("*.c"))]
    variants = VARIANTS if platform.machine().lower() in {"x86_64", "amd64"} else {"": ()}
    libraries = []
    for name, more in variants.items():
        library = root / _TARGET / f"_core{name}{_SUFFIX}"
        partial = library.with_name(f"{library.stem}.{os.getpid()}{_SUFFIX}")
        subprocess.run([*command, *more, "-o", str(partial), *sources, "-lm"], check=True)  # noqa: S603
        partial.replace(library)
        libraries.append(library)
    print(f"compiled {len(sources)} files of csrc/ with {' '.join(compiler())}")  # noqa: T201
    return libraries


if __name__ == "__main__":
    compile_all(_ROOT)
else:
    from hatchling.builders.hooks.plugin.interface import BuildHookInterface

    class CoreBuildHook(BuildHookInterface[Any]):
        """Build hook of hatchling for wheels and editable installs."""

        PLUGIN_NAME = "custom"

        def dependencies(self) -> list[str]:
            """Ask for the compiler's wheel only where the system has none."""
            return [] if os.environ.get("SPIRILLUM_CC") or shutil.which("cc") else ["ziglang>=0.13"]

        def initialize(self, version: str, build_data: dict[str, Any]) -> None:
            """Compile, and take the libraries into the wheel, which then holds for this platform and any Python."""
            del version
            if self.target_name != "wheel":
                return
            root = Path(self.root)
            build_data["artifacts"] += [str(path.relative_to(root)) for path in compile_all(root)]
            build_data["pure_python"] = False
            build_data["tag"] = f"py3-none-{sysconfig.get_platform().replace('-', '_').replace('.', '_')}"
