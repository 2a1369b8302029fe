"""Build hook of hatchling: the compiled loops of csrc/ become part of wheels and of editable installs."""

from __future__ import annotations

import os
import runpy
import shutil
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CoreBuildHook(BuildHookInterface[Any]):
    """Compiles before the files of a wheel are collected."""

    PLUGIN_NAME = "custom"

    def dependencies(self) -> list[str]:
        """Ask for the compiler that comes as a wheel only where the system has none."""
        return [] if os.environ.get("SPIRILLUM_CC") or shutil.which("cc") else ["ziglang>=0.13"]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile, and name the wheel after this platform: it holds for any Python."""
        del version
        build = runpy.run_path(str(Path(self.root) / "csrc" / "build.py"))
        libraries = build["compile_all"]()
        self.app.display_info(f"compiled csrc/ with {' '.join(build['compiler']())}")
        build_data["artifacts"] += [path.relative_to(self.root).as_posix() for path in libraries]
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{sysconfig.get_platform().replace('-', '_').replace('.', '_')}"
