"""List the tests of a module: those whose files import it, and those that reach it through one other module.

python tools/find_tests.py spirillum.swimming.balance     # or src/spirillum/swimming/balance.py
python tools/find_tests.py                              # all modules, with the number of their test files
"""

from __future__ import annotations

import ast
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent
SOURCE = ROOT / "src"


def module_name(path: Path) -> str:
    """Return the dotted name of a module's file."""
    parts = path.resolve().relative_to(SOURCE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports_of(path: Path, modules: set[str]) -> Iterator[str]:
    """The package's modules that a file imports, inside functions too, or names in texts, as patches do."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield from {node.module, *(f"{node.module}.{item.name}" for item in node.names)} & modules
        elif isinstance(node, ast.Import):
            yield from {item.name for item in node.names} & modules
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.startswith("spirillum."):
            parts = node.value.split(".")
            yield from {".".join(parts[:n]) for n in range(2, len(parts) + 1)} & modules


def main() -> None:
    """Print the index, or the tests of one module."""
    files = {module_name(path): path for path in SOURCE.rglob("*.py")}
    modules = set(files)
    tests: dict[str, set[str]] = defaultdict(set)
    for path in (ROOT / "tests").rglob("*.py"):
        for module in imports_of(path, modules):
            tests[module].add(str(path.relative_to(ROOT)))
    if len(sys.argv) == 1:
        for module in sorted(modules):
            print(f"{len(tests[module]):4d}  {module}")
        return
    given = sys.argv[1]
    module = module_name(Path(given)) if given.endswith(".py") else given
    if module not in modules:
        sys.exit(f"unknown module {given!r}")
    users = [name for name, path in files.items() if name != module and module in set(imports_of(path, modules))]
    print(*sorted(tests[module]), sep="\n")
    for user in sorted(users):
        for test in sorted(tests[user] - tests[module]):
            print(f"{test}  (through {user})")


if __name__ == "__main__":
    main()
