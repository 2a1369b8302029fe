"""Who is writing: folders locked while a process writes in them, and what dead processes have left behind.

A lock is the operating system's (`flock` on the folder itself): it ends with the process, however that ends, and leaves
no file. Where there is none (Windows, some network disks), two runs are not kept apart and leftovers stay.
"""

from __future__ import annotations

import errno
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path

LEFTOVER = ".spirillum-part-"  #: Prefix of the hidden folders in which files are made before they are renamed.
_TRIES = 20
_held: set[int] = set()
_swept: set[Path] = set()


class Busy(Exception):  # noqa: N818 - no error of the program
    """Another run is writing there."""


if sys.platform == "win32":

    def _lock(_folder: Path) -> int | None:
        return None

else:
    import fcntl

    def _lock(folder: Path) -> int | None:
        """An open folder that is locked for this process; None where folders cannot be locked."""
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(handle)
            if error.errno in (errno.EWOULDBLOCK, errno.EAGAIN, errno.EACCES):
                raise Busy from error
            return None
        except BaseException:
            os.close(handle)
            raise
        _held.add(handle)
        return handle

    def _forget() -> None:
        """In a copy of this process: its locks are the parent's, and end with it."""
        for handle in _held:
            with suppress(OSError):
                os.close(handle)
        _held.clear()

    os.register_at_fork(after_in_child=_forget)


def _release(handle: int | None) -> None:
    if handle is not None and handle in _held:
        _held.discard(handle)
        os.close(handle)


def _is_at(handle: int | None, folder: Path) -> bool:
    """Whether a folder that was opened is still the one of that name."""
    if handle is None:
        return True
    try:
        return os.path.samestat(os.fstat(handle), folder.stat(follow_symlinks=False))
    except OSError:
        return False


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep a folder for this process in the block, without leftovers; raise `Busy` if another run writes there."""
    for _ in range(_TRIES):  # another run may remove it between the two, when it has failed and left it empty
        folder.mkdir(parents=True, exist_ok=True)
        try:
            handle = _lock(folder.resolve())
        except FileNotFoundError:
            continue
        if _is_at(handle, folder.resolve()):
            break
        _release(handle)
    else:
        raise Busy
    try:
        sweep(folder, again=True)
        yield
    finally:
        _release(handle)


@contextmanager
def private_folder(parent: Path) -> Iterator[Path]:
    """A new hidden folder that only this user can enter, removed when the block ends."""
    # Nobody else can plant a link in it, its lock says that its process lives, and it lies on the disk of `parent`, so
    # that what was made in it takes its place at once.
    sweep(parent)
    for _ in range(_TRIES):  # another run may take it for a leftover before it is locked
        folder = Path(tempfile.mkdtemp(prefix=LEFTOVER, dir=parent))
        handle: int | None = None
        with suppress(Busy, FileNotFoundError):
            handle = _lock(folder)
            if _is_at(handle, folder):
                break
        _release(handle)
    else:
        raise FileNotFoundError(errno.ENOENT, "folders in it vanish", str(parent))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        _release(handle)


def scratch_folder() -> AbstractContextManager[Path]:
    """A folder as `private_folder` gives it, where the system keeps temporary files."""
    return private_folder(Path(tempfile.gettempdir()))


def sweep(parent: Path, *, again: bool = False) -> None:
    """Remove what killed runs of this user have left in a folder, once for each folder and process."""
    if sys.platform == "win32" or (parent in _swept and not again):
        return
    _swept.add(parent)
    with suppress(OSError), os.scandir(parent) as entries:
        found = [entry for entry in entries if entry.name.startswith(LEFTOVER)]
        for entry in found:
            with suppress(OSError, Busy):
                if entry.is_dir(follow_symlinks=False) and entry.stat(follow_symlinks=False).st_uid == os.getuid():
                    handle = _lock(Path(entry.path))
                    if handle is not None:  # nobody holds it: its process is gone
                        shutil.rmtree(entry.path, ignore_errors=True)
                        _release(handle)
