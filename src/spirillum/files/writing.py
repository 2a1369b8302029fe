"""Atomic writing: made in a hidden folder, synced, renamed; files of other programs are never replaced.

A file is made in a hidden folder beside its place that only this user can enter (`locks.private_folder`), written to
the disk, and renamed: a kill or a full disk leaves the old file or the new one, whole. What the program writes says so
(`written_by_us`); any other file that is there is refused, and so are inputs of the running command (`guard_inputs`).
"""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import Any, Literal, TypeAlias

from spirillum.envelope import as_json
from spirillum.errors import InputError
from spirillum.files.limits import checked_path
from spirillum.files.locks import LEFTOVER, Busy, locked, private_folder
from spirillum.files.reading import DAMAGED, read_json

PICTURES = {".png": "a picture", ".pdf": "a picture", ".svg": "a picture"}
"""Endings of the pictures that can be written, for `output_target`."""
MARK = "written by spirillum"
"""Ownership mark of every file that may be replaced: at its end (`_AT_THE_END`), or in its title, comment or head."""
Replace: TypeAlias = Literal["own", "any", "none"]  #: What may be replaced: own files, any regular file, nothing.

_XML = f"<!-- {MARK} -->\n".encode()
_FREE_BOX = (8 + len(MARK)).to_bytes(4, "big") + b"free" + MARK.encode()
_AT_THE_END = {
    ".nc": f"\n{MARK}\n".encode(),  # behind the end that the file's head states
    ".pdf": f"% {MARK}\n".encode(),
    ".mp4": _FREE_BOX,
    **dict.fromkeys((".svg", ".html", ".urdf", ".mjcf", ".xml", ".vti", ".vtp"), _XML),
}
_OWN = re.compile(rb"(?i)written by `?spirillum|\"schema\": ?\"spirillum\.[a-z-]+/\d")
_HEAD, _TAIL = 1 << 16, 1 << 12
_ANYTHING = "a file name"
_NO_SPACE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_inputs: ContextVar[tuple[Path, ...]] = ContextVar("inputs", default=())
_open_folders: list[Path] = []  # folders of results that are being written, by any thread


def written_by_us(path: Path, begins: bytes = b"") -> bool:
    """Whether a file is one of this program's, or empty."""
    with path.open("rb") as stream:
        head = stream.read(_HEAD)
        stream.seek(max(stream.seek(0, os.SEEK_END) - _TAIL, 0))
        tail = stream.read(_TAIL)
    return not head or bool(begins and head.startswith(begins)) or any(map(_OWN.search, (head, tail)))


@contextmanager
def guard_inputs(*inputs: str | Path | None) -> Iterator[None]:
    """While the block runs, these files and folders are not written over; None is passed over."""
    found: list[Path] = []
    for path in inputs:
        with suppress(OSError, RuntimeError, ValueError):
            found += [Path(path).resolve()] if path else []
    token = _inputs.set((*_inputs.get(), *found))
    try:
        yield
    finally:
        _inputs.reset(token)


def check_replaceable(path: Path, replace: Replace = "own", begins: bytes = b"") -> Path:
    """The target of a path, links followed, which a new file may replace; see `atomic_write`."""
    checked_path(path, _ANYTHING)
    try:
        real = path.resolve()
        there, wrong = real.exists(), real.exists() and not real.is_file()
    except (OSError, RuntimeError, ValueError) as error:
        raise InputError(f"{str(path)[:200]!r} cannot be written; allowed: {_ANYTHING}") from error
    for folder in _open_folders:
        if path.is_relative_to(folder) and real != folder.resolve() / path.relative_to(folder):
            raise InputError(f"{path} is a link; allowed: a file of its own in {folder}")
    if wrong:
        raise InputError(f"{path} is not a regular file; allowed: a new file, or one to replace")
    if not there:
        return real
    if replace == "none":
        raise InputError(f"{path} exists; allowed: a new file, or --force to overwrite one")
    if any(_same(real, source) for source in _inputs.get()):
        raise InputError(f"{path} is read by this command and would be written over; allowed: another name or folder")
    try:
        if replace == "own" and not written_by_us(real, begins):
            raise InputError(
                f"{path} is there and of unknown origin: it {DAMAGED}; allowed: another name or folder, or to move it "
                "away"
            )
    except OSError as error:
        raise InputError(f"{path} is there and cannot be read ({error.strerror}); allowed: another name") from error
    return real


def _same(path: Path, source: Path) -> bool:
    if path == source or source in path.parents:
        return True
    try:
        return path.samefile(source)
    except OSError:
        return False


@contextmanager
def atomic_write(path: Path, *, replace: Replace = "own", begins: bytes = b"", sync: bool = True) -> Iterator[Path]:
    """Give a temporary path; when the block ends without an error, it replaces `path`.

    Args:
        path: the file; its folder has to be there.
        replace: what it may replace.
        begins: what a file of this kind begins with, see `written_by_us`.
        sync: wait until the disk has it; not needed for what is computed again where it is damaged.
    """
    with atomic_write_all({path: begins}, replace=replace, sync=sync) as temporary:
        yield temporary[path]


@contextmanager
def atomic_write_all(
    paths: Collection[Path] | Mapping[Path, bytes],
    *,
    replace: Replace = "own",
    sync: bool = True,
    earlier: Collection[Path] = (),
) -> Iterator[dict[Path, Path]]:
    """Give temporary paths of files that belong together; all are made before the first is renamed.

    Other files of an `earlier` run are removed with the renames.
    """
    begins = dict(paths) if isinstance(paths, Mapping) else dict.fromkeys(paths, b"")
    places = {path: check_replaceable(path, replace, start) for path, start in begins.items()}
    with ExitStack() as stack:
        folders: dict[Path, Path] = {}
        temporary: dict[Path, Path] = {}
        for path, place in places.items():
            if place.parent not in folders:
                try:
                    folders[place.parent] = stack.enter_context(private_folder(place.parent))
                except OSError as error:
                    raise _unwritable(path, error) from error
            temporary[path] = folders[place.parent] / place.name
        with _named(temporary):
            yield temporary
            made = {path: (part, places[path]) for path, part in temporary.items() if part.exists()}
            for part, _ in made.values():
                _finish(part, sync=sync)
        for path in made:
            check_replaceable(path, replace, begins[path])  # it may have come meanwhile
        try:
            _exchange(made, earlier)
        except KeyboardInterrupt:  # which does not part the files
            _exchange(made, earlier)
            raise
        if sync:
            for folder in folders:
                synced(folder)


def _exchange(made: Mapping[Path, tuple[Path, Path]], earlier: Collection[Path]) -> None:
    """Rename files that were made, as far as they are not yet, and remove the other ones of an earlier run."""
    for path, (part, place) in made.items():
        try:
            if part.exists():
                part.replace(place)
        except OSError as error:
            raise _unwritable(path, error) from error
    for path in earlier:
        if path not in made:
            path.unlink(missing_ok=True)


@contextmanager
def _named(temporary: Mapping[Path, Path]) -> Iterator[None]:
    """Report a full disk for the file that is being made, since a user does not know the hidden ones."""
    try:
        yield
    except OSError as error:
        hidden = error.filename is None or LEFTOVER in str(error.filename)
        if error.errno not in _NO_SPACE or not hidden:
            raise
        known = [path for path, part in temporary.items() if str(part) == str(error.filename)]
        begun = [path for path, part in temporary.items() if part.exists()]
        raise OSError(error.errno, error.strerror, str((known or begun or list(temporary))[-1])) from error


def holds_only_own_files(folder: Path) -> bool:
    """Whether all that a folder holds are files of this program, or nothing."""
    return all(
        path.is_file() and not path.is_symlink() and path.stat().st_size > 0 and written_by_us(path)
        for path in folder.iterdir()
    )


@contextmanager
def atomic_folder(path: Path) -> Iterator[Path]:
    """Give a temporary folder; when the block ends without an error it replaces `path`, with all its content."""
    checked_path(path, "a new folder")
    try:
        parent = path.parent.resolve()
        with private_folder(parent) as hidden:
            part = hidden / path.name
            part.mkdir()
            yield part
            for made in part.iterdir():
                _finish(made, sync=True)
            if path.is_dir() and not path.is_symlink() and holds_only_own_files(path):
                path.rename(hidden / f"{path.name}.before")
            elif path.exists() or path.is_symlink():
                raise FileExistsError(errno.EEXIST, "something of this name is there", str(path))
            part.rename(parent / path.name)
            synced(parent)
    except OSError as error:
        raise _unwritable(path, error) from error


def _unwritable(path: Path, error: OSError) -> Exception:
    """A sentence on a location that cannot be written to; a full disk stays that error, with the location named."""
    if error.errno in _NO_SPACE:
        return OSError(error.errno, error.strerror, str(path))
    return InputError(f"{path} cannot be written ({error.strerror}); allowed: a folder you may write to")


def _finish(part: Path, *, sync: bool) -> None:
    """Mark a file that was made as the program's own, and wait until the disk has it."""
    mark = _AT_THE_END.get(part.suffix.lower(), b"")
    with part.open("r+b") as stream:
        stream.seek(max(stream.seek(0, os.SEEK_END) - len(mark), 0))
        if mark and stream.read() != mark:
            stream.write(mark)
        stream.flush()
        if sync:
            os.fsync(stream.fileno())


def synced(folder: Path) -> None:
    """Sync the names in a folder to disk, where the system supports it."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def netcdf_target(path: str | Path) -> Path:
    """The path of a NetCDF file to write, checked before any work is done."""
    return output_target(path, {".nc": "a NetCDF file"}, "run.nc")


_FEW = 4  # suffixes up to which their meanings are listed in a sentence without them


def output_target(path: str | Path, kinds: Mapping[str, str], example: str, *, replace: Replace = "own") -> Path:
    """The path of a file to write, checked before any work is done."""
    path = Path(path)
    if path.suffix.lower() not in kinds:
        endings, names = " or ".join(kinds), " or ".join(dict.fromkeys(kinds.values()))
        if len(kinds) > _FEW:
            names = ", ".join(f"{ending} ({what})" for ending, what in kinds.items())
        raise InputError(f"{str(path)[:200]!r} does not end in {endings}; allowed: {names}, for example {example}")
    return writable_target(path, replace)


def writable_target(path: Path, replace: Replace = "own") -> Path:
    """The path of a file to write, checked before any work is done: replaceable, in a folder open to writing."""
    real = check_replaceable(path, replace)
    if real.exists() and not os.access(real, os.W_OK):
        raise InputError(f"{path} is there and closed to writing (permission denied); allowed: a file you may replace")
    folder = real.parent
    if not folder.is_dir():
        raise InputError(f"{path} cannot be written (no such folder); allowed: a folder you may write to")
    try:
        with private_folder(folder):  # rights alone do not tell: nobody can write in /proc
            return path
    except OSError as error:
        raise _unwritable(path, error) from error


def write_text(path: Path, text: str, *, replace: Replace = "own", begins: str = "") -> None:
    """Write a text file whole or not at all."""
    with atomic_write(path, replace=replace, begins=begins.encode()) as temporary:
        temporary.write_text(text, encoding="utf-8")


def new_file(path: Path, text: str, *, overwrite: bool = False) -> None:
    """Write a text file that a user edits and would not lose: whole, and not over one that is there."""
    write_text(path, text, replace="any" if overwrite else "none")


def output_folder(path: Path, within: Path | None = None) -> Path:
    """Create the folder for results."""
    checked_path(path, "a folder for results (-o DIR)")
    if within is not None and path.is_symlink():
        raise InputError(f"{path} is a link; allowed: a folder of its own in {within}")
    try:
        path.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"{path} cannot be a folder for results ({why}); allowed: a new folder") from error
    if not os.access(path, os.W_OK | os.X_OK):
        raise InputError(f"{path} cannot be written to (permission denied); allowed: a folder you may write to")
    return path


@contextmanager
def results_folder(path: str | Path, *, claim: Mapping[str, Any] | None = None) -> Iterator[Path]:
    """A folder for results, made if it is not there and locked while the block runs."""
    # It and its `figures` have to be open to writing. A folder that was made here and stays empty is removed again.
    # Leftovers of killed runs are removed.
    folder = checked_path(path, "a folder for the results (-o DIR)")
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file, no folder for results; allowed: a folder for the results (-o DIR)")
    missing = [place for place in (folder / "figures", folder, *folder.parents) if not place.exists()]
    _open_folders.append(folder)
    try:
        with locked(output_folder(folder)):
            if (folder / "figures").exists():
                output_folder(folder / "figures", folder)
            if claim is not None:
                claim_folder(folder, **claim)
            yield folder
    except Busy as error:
        raise InputError(
            f"{folder} is being written by another run; allowed: another folder (-o DIR), or to wait for it"
        ) from error
    finally:
        _open_folders.remove(folder)
        for made in missing:
            with suppress(OSError):
                made.rmdir()  # only where it is empty


def claim_folder(
    folder: Path, mark: str, content: Mapping[str, Any], what: str, results: Collection[str] | None = None
) -> None:
    """Mark a folder as that of one request's results: a rerun resumes there, another request is refused."""
    if (folder / mark).exists() or (folder / mark).is_symlink():
        try:
            found = read_json(folder / mark, f"the mark of a {what}")
            same, title = found["fingerprint"] == content["fingerprint"], str(found.get("title", ""))[:80]
        except (KeyError, TypeError, AttributeError, InputError) as error:
            raise InputError(
                f"{folder / mark} {DAMAGED}; allowed: to move it away, or a new folder (-o DIR)"
            ) from error
        if not same:
            named = f" ('{title}')" if title else ""
            raise InputError(
                f"{folder} holds another {what}{named}, or one with other settings; allowed: the same {what}, to "
                "resume it, or a new folder (-o DIR)"
            )
        return
    there = sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
    there = [name for name in there if not name.startswith(LEFTOVER)]
    stray = next((name for name in there if results is None or name in results), None)
    if stray is not None:
        raise InputError(f"{folder} holds {stray} of unknown origin; allowed: a new folder (-o DIR)")
    output_folder(folder)
    write_text(folder / mark, as_json(dict(content)) + "\n")
