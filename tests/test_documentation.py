"""The commands of the documentation run and print what it shows, and its options exist."""

import importlib
import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import spirillum
from spirillum.cli.app import command_line
from spirillum.measurement.observations import COLUMNS

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
INSTALL = (
    "python3 -m venv .venv && . .venv/bin/activate && pip install . "
    "&& spirillum predict biorob2012-wide && spirillum study",
    'python3 -m venv .venv && . .venv/bin/activate && pip install -e ".[test]" && pytest',
)


def _loaded(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module


BLOCKS = _loaded(DOCS / "run_blocks.py")
LISTINGS = _loaded(DOCS / "write_listings.py")
RUNNABLE = [page for page in BLOCKS.pages() if re.search(r"^```(console|pycon|python)$", page.read_text("utf-8"), re.M)]
WITH_SLOW = [page for page in RUNNABLE if "<!-- slow -->" in page.read_text("utf-8")]
LISTED = [page for page in sorted(DOCS.glob("*.md")) if LISTINGS.MARKED.search(page.read_text("utf-8"))]
WRITTEN = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.glob("*.md"))]


def _commands(command: Any, path: str = "spirillum") -> dict[str, Any]:
    """Every command by its words."""
    found = {path: command}
    for name, below in getattr(command, "commands", {}).items():
        found |= _commands(below, f"{path} {name}")
    return found


COMMANDS = _commands(command_line())


def _options(path: str) -> set[str]:
    return {name for parameter in COMMANDS[path].params for name in (*parameter.opts, *parameter.secondary_opts)} | {
        "--help",
        "-h",
    }


def _compare(page: Path, *, slow: bool) -> None:
    problems, _ = BLOCKS.run_page(page, slow=slow)
    said = f"\n\nIf the new output is meant: python docs/run_blocks.py --write {page.name}"
    assert not problems, "\n\n".join(problems) + said


@pytest.mark.parametrize("page", RUNNABLE, ids=lambda path: path.stem)
def test_page_shows_what_its_commands_and_python_print(page: Path) -> None:
    _compare(page, slow=False)


def test_a_stale_output_of_python_is_a_problem_and_is_renewed(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "```pycon\n>>> for number in (1, 2):\n...     print(number * 1.5)\n1.5\n3.1\n\n>>> 'a'\n...\n'a'\n```\n"
        "```pycon\n>>> print('kept 17 ms')\nkept ... ms\n>>> print('a\\n\\nb')\na\n```\n",
        encoding="utf-8",
    )
    problems, renewed = BLOCKS.run_page(page)
    assert len(problems) == 2
    assert "Got:\n    1.5\n    3.0\n" in problems[0]
    page.write_text(renewed, encoding="utf-8")
    assert "1.5\n3.0\n" in renewed
    assert "kept ... ms" in renewed
    assert "a\n<BLANKLINE>\nb\n" in renewed
    assert BLOCKS.run_page(page) == ([], renewed)


def test_python_without_prompts_compiles_and_runs_where_it_is_asked_to(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    for text, words in (
        ("```python\nundefined.name\n```\n", None),
        ("```python\nx = = 1\n```\n", "SyntaxError"),
        ("<!-- run -->\n```python\nundefined.name\n```\n", "NameError"),
        ("<!-- run -->\n```python\nx = 2\n```\n```pycon\n>>> x\n2\n```\n", None),
    ):
        page.write_text(text, encoding="utf-8")
        problems, renewed = BLOCKS.run_page(page)
        assert renewed == text
        assert [words in problem for problem in problems] == [True] * (words is not None)


@pytest.mark.slow
@pytest.mark.parametrize("page", WITH_SLOW, ids=lambda path: path.stem)
def test_page_with_its_slow_blocks_shows_what_they_print(page: Path) -> None:
    _compare(page, slow=True)


def test_readme_opens_with_a_picture_and_the_two_commands() -> None:
    text = (ROOT / "README.md").read_text("utf-8")
    places = [text.index("!["), *(text.index(f"```sh\n{command}\n```") for command in INSTALL), text.index("## ")]
    assert places == sorted(places)


def test_first_steps_have_the_same_two_commands() -> None:
    text = (DOCS / "install.md").read_text("utf-8")
    assert all(f"```sh\n{command}\n```" in text for command in INSTALL)


@pytest.mark.parametrize("page", WRITTEN, ids=lambda path: path.stem)
def test_every_mentioned_option_of_a_command_exists(page: Path) -> None:
    text = page.read_text("utf-8")
    every = {option for path in COMMANDS for option in _options(path)}
    for span in re.findall(r"^\$ (spirillum .*)$|`(spirillum [^`\n]*)`", text, re.M):
        words = "".join(span).split()
        path = max((p for p in COMMANDS if words[: len(p.split())] == p.split()), key=len)
        mentioned = {word.split("=")[0] for word in words if re.match(r"--?[a-z]", word)}
        assert mentioned <= _options(path), (path, mentioned - _options(path))
    for option in re.findall(r"`(--[a-z][a-z-]*)", text):
        assert option in every, option


def test_commands_page_has_every_command() -> None:
    text = (DOCS / "commands.md").read_text("utf-8")
    listed = {f"spirillum {name}" for name in re.findall(r"^<!-- written: command-options (.*) -->$", text, re.M)}
    leaves = {path for path, command in COMMANDS.items() if not hasattr(command, "commands")}
    same = {"spirillum robot check"}
    assert listed | same == leaves
    assert _options("spirillum robot check") == _options("spirillum robot show")


def _listings(page: Path, *, dear: bool) -> None:
    for mark in LISTINGS.MARKED.finditer(page.read_text("utf-8")):
        if (mark[1] in LISTINGS.DEAR) == dear:
            now = LISTINGS.written(mark[1], mark[2])
            assert mark[4] == now, (
                f"{page.name}: {mark[1]}{mark[2]} is old: python docs/write_listings.py docs/{page.name}"
            )


@pytest.mark.parametrize("page", LISTED, ids=lambda path: path.stem)
def test_listings_are_what_the_code_says(page: Path) -> None:
    _listings(page, dear=False)


@pytest.mark.slow
@pytest.mark.parametrize("page", LISTED, ids=lambda path: path.stem)
def test_listings_of_datasets_are_what_the_code_says(page: Path) -> None:
    _listings(page, dear=True)


def test_every_table_of_the_robot_file_is_listed() -> None:
    from spirillum.robot.robot import Robot

    text = (DOCS / "robot-file.md").read_text("utf-8")
    tables = set(re.findall(r"<!-- written: robot-fields (\w+) -->", text))
    plain = {name for name in Robot.model_fields if f"- `{name}` (" in text}
    assert tables - {"root"} | plain == set(Robot.model_fields)


def test_pages_read_without_being_built() -> None:
    """No directive, role or empty link outside the page of contents and the reference of the modules."""
    for page in WRITTEN:
        if page.name not in ("contents.md", "api.md"):
            text = re.sub(r"^```(?!\{).*?^```$", "", page.read_text("utf-8"), flags=re.M | re.S)
            assert re.findall(r"^(?:```|:::)\{.*|\{\w+(?::\w+)?\}`|\[\]\(", text, re.M) == [], page.name


def test_commands_page_has_every_column_of_observations() -> None:
    text = (DOCS / "commands.md").read_text("utf-8")
    assert [name for name in COLUMNS if f"`{name}`" not in text] == []


def test_reference_lists_every_public_name() -> None:
    text = (DOCS / "api.md").read_text("utf-8")
    assert set(re.findall(r"`sp\.(\w+)`", text)) == set(spirillum.__all__)


def test_reference_covers_every_room_and_shared_module() -> None:
    text = "\n".join(page.read_text("utf-8") for page in (DOCS / "api").glob("*.md"))
    documented = set(re.findall(r"^```\{room\} (\S+)$", text, re.M))
    package = ROOT / "src" / "spirillum"
    rooms = {path.parent.name for path in package.glob("*/__init__.py")} - {"cli"}
    assert documented == rooms | {path.stem for path in package.glob("*.py")} - {"__init__", "__main__"}


@pytest.mark.parametrize("page", WRITTEN, ids=lambda path: path.stem)
def test_references_into_the_code_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"`(spirillum(?:\.\w+){2,})`", page.read_text("utf-8")):
        parts = target.split(".")
        found: Any = importlib.import_module(parts[0])
        for place, name in enumerate(parts[1:], 2):
            if not hasattr(found, name):
                importlib.import_module(".".join(parts[:place]))
            found = getattr(found, name)


def test_every_dependency_has_its_reason() -> None:
    import tomllib

    settings = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    project, groups = settings["project"], settings["dependency-groups"]
    wanted = [
        *project["dependencies"],
        *(name for extra in (project["optional-dependencies"] | groups).values() for name in extra),
    ]
    reasons = (DOCS / "dependencies.md").read_text("utf-8")
    names = {match[0] for text in wanted if (match := re.match(r"[\w-]+", text))}
    assert {name for name in names if f"| {name} |" not in reasons} == set()


@pytest.mark.parametrize("page", WRITTEN, ids=lambda path: path.stem)
def test_links_to_files_and_pictures_lead_somewhere(page: Path) -> None:
    targets = re.findall(r"\]\(([^)#]+)\)", page.read_text("utf-8"))
    files = [target for target in targets if not target.startswith("http")]
    assert [target for target in files if not (page.parent / target).exists()] == []
