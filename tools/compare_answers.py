"""Compare the JSON answers of all commands of the documentation between two versions of the program.

    python tools/compare_answers.py record before.json     # with one version installed
    python tools/compare_answers.py record after.json      # with the other
    python tools/compare_answers.py compare before.json after.json

Every `spirillum` command of README.md and docs/*.md that knows `--json` is run with it, page by page in a temporary
folder. Numbers have to agree to 1e-12 relative to the largest number of their list; all else has to be equal.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import re
import shlex
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "docs"))
TOLERANCE = 1e-12


def commands(page: Path) -> Iterator[tuple[str, str]]:
    """The console commands of a page, and the files that it writes for them."""
    from run_blocks import _FENCE, _FILE, steps

    for _, kind, block in _FENCE.findall(page.read_text(encoding="utf-8")):
        if kind == "console":
            for step in steps(block):
                if step.command.startswith("spirillum "):
                    yield "command", step.command
        elif kind in ("toml", "text") and (named := _FILE.match(block)):
            yield named[1], block


def answer(command: str) -> dict[str, Any]:
    """Exit code and JSON of a command; its text where it knows no JSON."""
    from run_blocks import run_command

    asked = command if "--json" in shlex.split(command) else f"{command} --json"
    code, lines = run_command(asked)
    if code == 2 and any("No such option" in line and "--json" in line for line in lines):
        code, lines = run_command(command)
    text = "\n".join(lines)
    with contextlib.suppress(json.JSONDecodeError):
        return (
            {"code": code, "answer": json.loads(text[: text.rindex("}") + 1])}
            if "}" in text
            else {"code": code, "text": text}
        )
    return {"code": code, "text": text}


def record(target: Path, only: list[str]) -> None:
    """Run every command and write what it answered."""
    from run_blocks import pages

    os.environ |= {"COLUMNS": "100", "MPLBACKEND": "Agg"}
    found: dict[str, Any] = {}
    for page in pages():
        if only and page.stem not in only:
            continue
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            for number, (what, text) in enumerate(commands(page)):
                if what != "command":
                    Path(what).write_text(text, encoding="utf-8")
                    continue
                found[f"{page.stem} {number}: {text}"] = answer(text)
                sys.stderr.write(f"{page.stem}: {text}\n")
    target.write_text(json.dumps(found, indent=1), encoding="utf-8")


def differences(one: Any, other: Any, path: str, scale: float = 0.0) -> Iterator[str]:
    """Places at which two answers differ."""
    if isinstance(one, dict) and isinstance(other, dict):
        for name in sorted({*one, *other}):
            if name in one and name in other:
                yield from differences(one[name], other[name], f"{path}.{name}")
            else:
                yield f"{path}.{name}: only {'before' if name in one else 'after'}"
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        numbers = [abs(value) for value in _numbers(one)]
        for place, (a, b) in enumerate(zip(one, other, strict=True)):
            yield from differences(a, b, f"{path}[{place}]", max([scale, *numbers]))
    elif isinstance(one, float) and isinstance(other, float):
        if not math.isclose(one, other, rel_tol=TOLERANCE, abs_tol=TOLERANCE * scale):
            yield f"{path}: {one!r} before, {other!r} after"
    elif one != other:
        yield f"{path}: {str(one)[:300]!r} before, {str(other)[:300]!r} after"


def _numbers(items: list[Any]) -> Iterator[float]:
    for item in items:
        if isinstance(item, list):
            yield from _numbers(item)
        elif isinstance(item, float):
            yield item


def compare(before: Path, after: Path) -> int:
    """Print what differs; 1 if anything does."""
    one, other = (json.loads(path.read_text(encoding="utf-8")) for path in (before, after))
    wrong = 0
    for name in sorted({*one, *other}, key=lambda text: re.sub(r"\d+", lambda found: found[0].zfill(4), text)):
        if name not in one or name not in other:
            sys.stdout.write(f"{name}: only {'before' if name in one else 'after'}\n")
            continue
        for line in differences(one[name], other[name], ""):
            wrong += 1
            sys.stdout.write(f"{name}\n    {line}\n")
    sys.stdout.write(f"{len(one)} commands before, {len(other)} after, {wrong} differences\n")
    return int(wrong > 0)


if __name__ == "__main__":
    if sys.argv[1:2] == ["record"]:
        record(Path(sys.argv[2]).resolve(), sys.argv[3:])
    elif sys.argv[1:2] == ["compare"]:
        sys.exit(compare(Path(sys.argv[2]), Path(sys.argv[3])))
    else:
        sys.stdout.write(str(__doc__))
