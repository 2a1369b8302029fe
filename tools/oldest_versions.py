"""Print the oldest stated version of each dependency as constraints for pip: `pip install -c FILE -e ".[test]"`."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any


def oldest(project: dict[str, Any]) -> list[str]:
    """Return `name==version` for each `name>=version` of the dependencies and the extra `test`, extras left out."""
    extras = project["optional-dependencies"]
    stated = [*project["dependencies"], *extras["posterior"], *extras["test"]]
    found = (re.fullmatch(r"([\w.-]+)(?:\[[\w,]+\])?>=([\w.]+)", requirement) for requirement in stated)
    return [f"{match[1]}=={match[2]}" for match in found if match]


if __name__ == "__main__":
    path = Path(__file__).parents[1] / "pyproject.toml"
    print("\n".join(oldest(tomllib.loads(path.read_text("utf-8"))["project"])))
