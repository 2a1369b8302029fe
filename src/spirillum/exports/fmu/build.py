"""An FMU as bytes: its description, its C source, and that source compiled for this machine."""

from __future__ import annotations

import io
import platform
import shutil
import subprocess
import sys
import zipfile
from importlib.resources import files

from spirillum.dynamics.held_model import HeldModel
from spirillum.errors import InputError
from spirillum.exports.fmu.description import (
    SOURCE,
    build_text,
    description_text,
    header_text,
    identifier_of,
    token_of,
)
from spirillum.files import MARK, scratch_folder

__all__ = ["compiler", "fmu_bytes"]

_COMPILERS = ("cc", "gcc", "clang")
_OPTIONS = ("-std=c99", "-O2", "-shared", "-fPIC", "-fvisibility=hidden")
_LONGEST = 120.0
"""Time after which a compiler is given up, s."""
_LIBRARIES = {"linux": ("linux", ".so"), "darwin": ("darwin", ".dylib"), "win32": ("windows", ".dll")}
_PROCESSORS = {"x86_64": "x86_64", "amd64": "x86_64", "arm64": "aarch64", "aarch64": "aarch64"}
_NEVER = (1980, 1, 1, 0, 0, 0)
"""Date of the files in the archive, so that the same robot gives the same bytes."""


def compiler() -> str:
    """The C compiler of the system.

    Raises:
        InputError: if there is none.
    """
    for name in _COMPILERS:
        found = shutil.which(name)
        if found is not None:
            return found
    raise InputError(
        f"no C compiler is installed, which an .fmu is built with; allowed: {', '.join(_COMPILERS)} on the path"
    )


def fmu_bytes(held: HeldModel) -> bytes:
    """The FMU of a robot: a zip archive with description, source and library.

    Args:
        held: the equations of the robot.

    Raises:
        InputError: if there is no C compiler, or it fails.
    """
    source = files(__package__).joinpath(SOURCE).read_bytes()
    token, name = token_of(held, source), identifier_of(held)
    header = header_text(held, token).encode()
    system, ending = _LIBRARIES.get(sys.platform, ("linux", ".so"))
    machine = platform.machine().lower()
    contents = {
        "modelDescription.xml": description_text(held, token).encode(),
        "sources/buildDescription.xml": build_text(name).encode(),
        f"sources/{SOURCE}": source,
        "sources/robot.h": header,
        f"binaries/{_PROCESSORS.get(machine, machine)}-{system}/{name}{ending}": _compiled(source, header),
    }
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as target:
        target.comment = MARK.encode()
        for path, data in contents.items():
            entry = zipfile.ZipInfo(path, _NEVER)
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            target.writestr(entry, data)
    return archive.getvalue()


def _compiled(source: bytes, header: bytes) -> bytes:
    with scratch_folder() as here:
        (here / SOURCE).write_bytes(source)
        (here / "robot.h").write_bytes(header)
        command = [compiler(), *_OPTIONS, "-o", "robot.library", SOURCE, "-lm"]
        try:
            done = subprocess.run(  # noqa: S603 - a compiler of the system and a source of our own
                command, cwd=here, capture_output=True, text=True, timeout=_LONGEST, check=False
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise InputError(
                f"{command[0]} does not build the .fmu ({error}); allowed: a C compiler for C99"
            ) from error
        if done.returncode != 0:
            said = next((line for line in done.stderr.splitlines() if "error" in line), done.stderr)[:200]
            raise InputError(f"{command[0]} does not build the .fmu ({said}); allowed: a C compiler for C99")
        return (here / "robot.library").read_bytes()
