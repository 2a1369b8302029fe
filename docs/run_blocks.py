"""Run the commands and the interactive Python of README.md and docs/*.md, and compare with what stands there.

    python docs/run_blocks.py [--write] [--slow] [PAGE...]

In a ```console block every line that starts with `$ ` is run: `spirillum ...`, or `echo $?` for the last exit code.
Commands have to succeed unless `echo $?` follows. A line `...` stands for any lines. A block that shows no output at
all is filled by --write, which also renews outputs without `...`. In a ```pycon block each `>>>` is run as a doctest,
and renewed likewise. A ```python block has to compile, and below a line `<!-- run -->` to run.
A ```toml or ```text block whose first line is `# NAME.toml` or `# NAME.csv` is a file that the commands of the page
find. All blocks of a page share one temporary folder. A block below a line `<!-- slow -->` runs only with --slow or
--write; no later block of its page may depend on it.
"""

from __future__ import annotations

import contextlib
import doctest
import io
import os
import re
import shlex
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parent.parent
WIDTH = "80"
_FENCE = re.compile(r"^(<!-- (?:slow|run) -->\n)?```(console|pycon|python|toml|text)\n(.*?)^```$", re.M | re.S)
_FILE = re.compile(r"# ([\w-]+\.(?:toml|csv))\b")
_PROGRESS = re.compile(r".*, [\d.]+ .* elapsed(?:, about .* left)?")
"""A line of progress, which a slow machine prints and a fast one does not."""


class Step(NamedTuple):
    """A command and the lines that stand below it."""

    command: str
    shown: list[str]


def pages() -> list[Path]:
    """Every page with blocks to run."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def steps(block: str) -> Iterator[Step]:
    """Commands of a console block with their outputs."""
    found: list[Step] = []
    for line in block.splitlines():
        if line.startswith("$ "):
            found.append(Step(line[2:], []))
        elif found:
            found[-1].shown.append(line)
        else:
            raise ValueError(f"a console block starts with {line!r}; allowed: '$ ' and a command")
    yield from found


def run_command(command: str) -> tuple[int, list[str]]:
    """Exit code and lines of a `spirillum` command, standard error after standard output."""
    from spirillum.cli import main

    name, *arguments = shlex.split(command)
    if name != "spirillum":
        raise ValueError(f"{command!r}; allowed: spirillum ..., echo $?")
    out, err = io.StringIO(), io.StringIO()
    code = 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main(arguments)
        except SystemExit as end:
            code = int(end.code or 0)
    lines = [line.rstrip() for line in (out.getvalue() + err.getvalue()).splitlines()]
    return code, [line for line in lines if not _PROGRESS.fullmatch(line)]


def matches(shown: list[str], lines: list[str]) -> bool:
    """Whether the shown lines are the lines, `...` standing for any."""
    pattern = "".join(r"(?:.*\n)*?" if line == "..." else re.escape(line.rstrip()) + r"\n" for line in shown)
    return re.fullmatch(pattern, "".join(f"{line}\n" for line in lines)) is not None


def run_console(block: str, problems: list[str]) -> str:
    """Run a console block; return it with its outputs renewed."""
    renewed: list[str] = []
    code = 0
    all_steps = list(steps(block))
    for place, (command, shown) in enumerate(all_steps):
        if command == "echo $?":
            lines = [str(code)]
        else:
            code, lines = run_command(command)
            asked = place + 1 < len(all_steps) and all_steps[place + 1].command == "echo $?"
            if code != 0 and not asked:
                problems.append(f"{command}: exit code {code}: {' '.join(lines)[:500]}")
        if not matches(shown, lines):
            problems.append(f"{command}: shows\n" + "\n".join(shown) + "\nand prints\n" + "\n".join(lines))
        renewed += [f"$ {command}", *(shown if "..." in shown else lines)]
    return "\n".join(renewed) + "\n"


class _Session(doctest.DocTestRunner):
    """Runs a doctest and keeps what each of its examples prints."""

    def __init__(self) -> None:
        super().__init__(optionflags=doctest.ELLIPSIS, verbose=False)
        self.got: dict[int, str] = {}
        """Output by the line of the example."""

    def report_success(self, out: Any, test: doctest.DocTest, example: doctest.Example, got: str) -> None:  # noqa: ARG002
        self.got[example.lineno] = got

    def report_failure(self, out: Any, test: doctest.DocTest, example: doctest.Example, got: str) -> None:
        self.got[example.lineno] = got
        super().report_failure(out, test, example, got)


def _without_stack(output: str) -> str:
    """Output without the stack of an exception, which names files of this machine."""
    before, mark, stack = output.partition("Traceback (most recent call last):\n")
    return f"{before}{mark}{stack.rstrip().splitlines()[-1]}\n" if mark else output


def run_session(block: str, names: dict[str, Any], page: Path, problems: list[str]) -> str:
    """Run a pycon block as a doctest in the page's names; return it with its outputs renewed."""
    parser, session, report = doctest.DocTestParser(), _Session(), io.StringIO()
    test = parser.get_doctest(block, names, page.name, str(page), 0)
    session.run(test, out=report.write, clear_globs=False)
    names.update(test.globs)
    if session.summarize(verbose=False).failed:
        problems.append(report.getvalue())
    renewed = []
    for piece in parser.parse(block):
        if isinstance(piece, str):
            renewed.append(piece)
            continue
        first, *more = piece.source.splitlines()
        output = piece.want if "..." in piece.want else session.got.get(piece.lineno, piece.want)
        lines = [line or "<BLANKLINE>" for line in _without_stack(output).splitlines()]
        renewed += [f"{line}\n" for line in (f">>> {first}", *(f"... {line}".rstrip() for line in more), *lines)]
    return "".join(renewed)


def run_code(block: str, names: dict[str, Any] | None, page: Path, problems: list[str]) -> None:
    """Compile a python block, and run it in the page's names; None: only compile it."""
    try:
        code = compile(block, page.name, "exec")
        if names is not None:
            exec(code, names)  # noqa: S102 - the documentation's own code
    except Exception as error:
        problems.append(f"a python block raises {type(error).__name__}: {error}\n{block}")


def run_page(page: Path, *, slow: bool = False) -> tuple[list[str], str]:
    """Problems of a page, and its text with outputs renewed; without its slow blocks unless they are asked for."""
    text = page.read_text(encoding="utf-8")
    problems: list[str] = []
    names: dict[str, Any] = {}

    def run(found: re.Match[str]) -> str:
        mark, kind, block = found.groups()
        if mark and "slow" in mark and not slow:
            return found[0]
        if kind == "console":
            block = run_console(block, problems)
        elif kind == "pycon":
            block = run_session(block, names, page, problems)
        elif kind == "python":
            run_code(block, names if mark else None, page, problems)
        elif named := _FILE.match(block):
            Path(named[1]).write_text(block, encoding="utf-8")
        return f"{mark or ''}```{kind}\n{block}```"

    kept = {name: os.environ.get(name) for name in ("COLUMNS", "MPLBACKEND")}
    os.environ |= {"COLUMNS": WIDTH, "MPLBACKEND": "Agg"}
    try:
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            renewed = _FENCE.sub(run, text)
    finally:
        for name, value in kept.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
    return problems, renewed


def main(arguments: list[str]) -> int:
    """Check or renew the pages; 1 if one of them was wrong."""
    write = "--write" in arguments
    chosen = [Path(name).resolve() for name in arguments if not name.startswith("--")] or pages()
    wrong = 0
    for page in chosen:
        problems, renewed = run_page(page, slow=write or "--slow" in arguments)
        wrong += bool(problems)
        for problem in problems:
            sys.stdout.write(f"{page.name}: {problem}\n")
        if write:
            page.write_text(renewed, encoding="utf-8")
    return int(wrong > 0 and not write)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
