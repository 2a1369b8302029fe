"""Folders of results: claimed for one question, locked while they are written, nothing of others touched."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from spirillum.envelope import as_json
from spirillum.errors import InputError
from spirillum.files.limits import checked_path
from spirillum.files.locks import LEFTOVER, Busy, locked
from spirillum.files.reading import read_json
from spirillum.files.writing import output_folder, write_text


@contextmanager
def results_folder(path: str | Path, *, claim: Mapping[str, Any] | None = None) -> Iterator[Path]:
    """A folder for results, made if it is not there and locked while the block runs."""
    # It and its `figures` have to be open to writing. A folder that was made here and stays empty is removed again.
    # Leftovers of killed runs are removed.
    folder = checked_path(path, "a folder for the results (-o DIR)")
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file, no folder for results; allowed: a folder for the results (-o DIR)")
    missing = [place for place in (folder, *folder.parents) if not place.exists()]
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
            raise InputError(f"{folder / mark} is damaged; allowed: a new folder (-o DIR)") from error
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
