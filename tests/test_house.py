"""The package's names are unique, and the map in CONTRIBUTING.md leads to files that exist."""

import ast
import re
from collections import Counter
from pathlib import Path

import pytest

from spirillum.data_tables import rows_of

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "src" / "spirillum"
MODULES = sorted(PACKAGE.rglob("*.py"))
MAP = (ROOT / "CONTRIBUTING.md").read_text("utf-8").split("## Map\n")[1].split("## Habits")[0]


@pytest.fixture(scope="module")
def bodies() -> list[list[ast.stmt]]:
    """What stands in each module."""
    return [ast.parse(path.read_text("utf-8")).body for path in MODULES]


def _definitions(body: list[ast.stmt]) -> list[str]:
    return [node.name for node in body if isinstance(node, (ast.ClassDef, ast.FunctionDef)) and not node.decorator_list]


def test_public_class_names_are_unique(bodies: list[list[ast.stmt]]) -> None:
    names = Counter(node.name for body in bodies for node in body if isinstance(node, ast.ClassDef))
    assert [name for name, count in names.items() if count > 1 and not name.startswith("_")] == []


def test_no_module_defines_a_name_twice(bodies: list[list[ast.stmt]]) -> None:
    counts = [max(Counter(_definitions(body)).values(), default=1) for body in bodies]
    assert [path.name for path, count in zip(MODULES, counts, strict=True) if count > 1] == []


@pytest.mark.parametrize("name", ["answer", "options", "warnings", "loading"])
def test_general_module_names_occur_once_at_most(name: str) -> None:
    assert len(list(PACKAGE.rglob(f"{name}.py"))) <= 1


def test_every_requirement_of_the_table_is_used() -> None:
    source = "\n".join(path.read_text("utf-8") for path in MODULES)
    used = re.findall(r"Limit\.named\(\s*\"([\w-]+)\"", source)
    assert sorted(used) == sorted(row["name"] for row in rows_of("limits.csv"))


def test_every_path_of_the_map_exists() -> None:
    paths = set(re.findall(r"`([\w/-]+(?:\.py|\.c|\.md|/))`", MAP))
    roots = (ROOT, ROOT / "src", PACKAGE, PACKAGE / "fluid", PACKAGE / "view", PACKAGE / "vision")
    rooms = [path for path in PACKAGE.iterdir() if path.is_dir()]
    new = {"src/spirillum/fluid/closed/mymodel.py"}
    assert [path for path in sorted(paths - new) if not any((root / path).exists() for root in (*roots, *rooms))] == []
    assert len(paths) > 40
