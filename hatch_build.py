"""Build hook of hatchling: the compiled loops of csrc/ become part of wheels and of editable installs."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CoreBuildHook(BuildHookInterface[Any]):
    """Compiles before the files of a wheel are collected."""

    PLUGIN_NAME = "custom"

    def dependencies(self) -> list[str]:
        """Ask for the compiler that comes as a wheel only where it is needed."""
        return ["ziglang>=0.13"] if self._build()["needs_zig"]() else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile, and name the wheel after its platform: it holds for any Python.

        In a clone whose libraries are those of its csrc/, an editable install uses them.
        """
        build = self._build()
        command, tag = build["compiler"]()
        if version == "editable" and build["is_current"]():
            libraries = sorted(build["PACKAGE"].glob("_core*"))
        else:
            libraries = build["compile_all"]()
            self.app.display_info(f"compiled csrc/ for {tag} by {' '.join(command)}")
        made = (*libraries, build["STUBS"])
        build_data["artifacts"] += [path.relative_to(self.root).as_posix() for path in made]
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{tag}"

    def _build(self) -> dict[str, Any]:
        return runpy.run_path(str(Path(self.root) / "csrc" / "build.py"))
