"""Disk cache of solutions of the model `tube`, keyed by the request and the source code of the solver.

The folder is the user's cache folder, or what SPIRILLUM_CACHE names (`off` for none). It is safe to delete, and
several runs may share it: files are written whole, and one that is damaged is computed anew.

Every answer is filed under its question, the source of all modules of this package that the computing one imports,
directly or not, and the versions of the numerical libraries. A changed byte in any of them makes a new key.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Callable
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import TypeVar

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError, clipped
from spirillum.files import atomic_write, read_bytes
from spirillum.fluid.tube.solids import MOTIONS
from spirillum.kernels.native import sources_digest

_PACKAGE = Path(__file__).parents[2]
_LIBRARIES = ("numpy", "scipy")
_IMPORT = re.compile(
    rb"^[ \t]*(?:from (spirillum[\w.]*) import (\([^)]*\)|[^\n]*)|import (spirillum[\w.]*))", re.MULTILINE
)

_Q = TypeVar("_Q", bound=tuple[object, ...])


def cache_folder() -> Path | None:
    """Folder of the cache; None if caching is off."""
    return _folder(os.environ.get("SPIRILLUM_CACHE", ""))


def check_cache_folder() -> None:
    """Refuse a folder in SPIRILLUM_CACHE that is not writable."""
    named = os.environ.get("SPIRILLUM_CACHE", "")
    folder = cache_folder()
    if not named or named.lower() == "off" or (folder is not None and os.access(folder, os.W_OK | os.X_OK)):
        return
    raise InputError(
        f"SPIRILLUM_CACHE = {clipped(named, 200)} cannot be written to; allowed: a folder you may write to, or off"
    )


@lru_cache(maxsize=8)
def _folder(named: str) -> Path | None:
    from platformdirs import user_cache_path

    if named.lower() == "off":
        return None
    folder = Path(named) if named else user_cache_path("spirillum", appauthor=False)
    if not named and not folder.is_absolute():  # no home is known: `~` would be a folder where one works
        return None
    try:
        (folder / "tube").mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError):
        return None
    return folder / "tube"


def cached_or_computed(question: _Q, compute: Callable[[_Q], Samples]) -> Samples:
    """Return the solution of a request, (13, 13), from the cache, or compute and cache it."""
    path = _path(question, compute)
    if path is None:
        return compute(question)
    found = _cached(path)
    if found is None:
        found = compute(question)
        content = np.ascontiguousarray(found, dtype="<f8").tobytes()
        try:
            with atomic_write(path, replace="any", sync=False) as temporary:
                temporary.write_bytes(sealed(content))
        except (InputError, OSError):  # a full or read-only disk costs time only
            pass
    return found


def is_cached(question: _Q, compute: Callable[[_Q], Samples]) -> bool:
    """Whether the solution of a request is cached, so that `cached_or_computed` computes nothing."""
    path = _path(question, compute)
    return path is not None and _cached(path) is not None


def _path(question: _Q, compute: Callable[[_Q], Samples]) -> Path | None:
    """Cache file of a request; None if caching is off."""
    folder = cache_folder()
    code = None if folder is None else digest_of(compute.__module__)
    if folder is None or code is None:
        return None
    key = hashlib.sha256(f"{code} {question!r}".encode()).hexdigest()
    return folder / f"{key[:40]}.f64"


def _cached(path: Path) -> Samples | None:
    """Cached solution; None if there is none or its checksum is wrong."""
    try:
        stored = read_bytes(path, "a kept answer", 1 << 16)
    except InputError:
        return None
    content = unsealed(stored)
    if content is None or len(content) != 8 * MOTIONS**2:
        return None
    return np.frombuffer(content, dtype="<f8").astype(np.float64).reshape(MOTIONS, MOTIONS)


def sealed(content: bytes) -> bytes:
    """Content behind its digest, by which damage is noticed."""
    return hashlib.sha256(content).digest() + content


def unsealed(stored: bytes) -> bytes | None:
    """The content of what was sealed; None if it is damaged."""
    digest, content = stored[:32], stored[32:]
    return content if hashlib.sha256(content).digest() == digest else None


@lru_cache(maxsize=8)
def digest_of(module: str) -> str | None:
    """Digest of the source of a module, its imports and csrc/, once per process; None if it is not available."""
    sources = imported_sources(module)
    if module not in sources:
        return None
    used = (*(version(name) for name in _LIBRARIES), sources_digest())
    found = hashlib.sha256(" ".join(used).encode())
    for name in sorted(sources):
        found.update(f" {name} {len(sources[name])} ".encode() + sources[name])
    return found.hexdigest()


def imported_sources(module: str) -> dict[str, bytes]:
    """Return the source of a module and of all modules of this package that it imports, directly or not."""
    found: dict[str, bytes] = {}
    ahead = [module]
    while ahead:
        name = ahead.pop()
        if name in found:
            continue
        place = _PACKAGE.joinpath(*name.split(".")[1:])
        package = place.is_dir()
        try:
            found[name] = (place / "__init__.py" if package else place.with_suffix(".py")).read_bytes()
        except OSError:  # a name that is imported from a package, not a module
            continue
        for source, names, whole in _IMPORT.findall(found[name]):
            target = (source or whole).decode()
            ahead.append(target)
            if source and _PACKAGE.joinpath(*target.split(".")[1:]).is_dir():
                ahead += [f"{target}.{each.decode()}" for each in re.findall(rb"\w+", names)]
    return found
