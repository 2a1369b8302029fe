"""Kept answers of the model `tube` are filed under the code that computed them."""

import ast
import shutil
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

from spirillum.fluid.tube import cache

MODEL = "spirillum.fluid.tube.tube"


def imports_of(module: str) -> Iterator[str]:
    """Modules of the package that a module imports, by Python's own grammar, in functions and branches too."""
    spec = find_spec(module)
    assert spec is not None
    assert spec.origin is not None
    for node in ast.walk(ast.parse(Path(spec.origin).read_bytes())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.startswith("spirillum"))
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("spirillum"):
            assert node.module is not None
            yield node.module
            if find_spec(node.module).submodule_search_locations is not None:  # type: ignore[union-attr]
                yield from (name for alias in node.names if find_spec(name := f"{node.module}.{alias.name}"))


def test_all_that_the_model_imports_is_in_the_key() -> None:
    closure, ahead = set(), [MODEL]
    while ahead:
        module = ahead.pop()
        if module not in closure:
            closure.add(module)
            ahead += imports_of(module)
    assert set(cache.imported_sources(MODEL)) == closure
    needed = {
        *(f"fluid.tube.{name}" for name in ("confined", "domain", "rings", "solids", "tube", "wall")),
        *(f"fluid.wire.{name}" for name in ("interaction", "sources", "robot_geometry", "sources", "stokeslets")),
        *(f"kernels.{name}" for name in ("core", "native")),
        *(f"robot.{name}" for name in ("geometry", "outline", "tube_pose")),
        "fluid.algebra",
    }
    assert {f"spirillum.{name}" for name in needed} <= closure


def test_imports_at_any_indentation_and_over_several_lines_are_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "room").mkdir()
    (tmp_path / "room" / "__init__.py").write_text("")
    (tmp_path / "first.py").write_text("def f():\n    from spirillum.room import (\n        second,\n    )\n")
    (tmp_path / "room" / "second.py").write_text("import spirillum.third as other\n")
    (tmp_path / "third.py").write_text("from spirillum.first import f, g\n")
    monkeypatch.setattr(cache, "_PACKAGE", tmp_path)
    names = ("first", "room", "room.second", "third")
    assert set(cache.imported_sources("spirillum.first")) == {f"spirillum.{name}" for name in names}
    assert cache.imported_sources("spirillum.nowhere") == {}


def test_a_changed_byte_in_any_source_changes_the_key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    copy = tmp_path / "spirillum"
    shutil.copytree(cache._PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(cache, "_PACKAGE", copy)
    key = cache.digest_of.__wrapped__
    before = key(MODEL)
    assert before == key(MODEL)
    for module in ("fluid/tube/wall", "kernels/core", "robot/outline"):
        path = copy / f"{module}.py"
        source = path.read_bytes()
        path.write_bytes(source + b"\n")
        assert key(MODEL) != before
        path.write_bytes(source)
    assert key(MODEL) == before
    (copy / "view" / "__init__.py").write_text("# not what the numbers come from\n")
    assert key(MODEL) == before


def test_other_libraries_change_the_key(monkeypatch: pytest.MonkeyPatch) -> None:
    before = cache.digest_of.__wrapped__(MODEL)
    monkeypatch.setattr(cache, "version", lambda name: f"{name} of tomorrow")
    assert cache.digest_of.__wrapped__(MODEL) != before
