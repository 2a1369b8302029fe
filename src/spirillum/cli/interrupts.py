"""Interrupted commands: the sentence about their finished work."""

from __future__ import annotations

from typing import Any

import typer
from typer.core import TyperCommand

_RESUMED = "are kept in {}; the same command resumes"
_KEPT = {
    "calibrate": "nothing of this fit is kept; earlier results in {} stay",
    "design": "nothing of this search is kept",
    "prepare": "finished tables and nodes are kept; the same command resumes",
    "study": f"finished robots {_RESUMED}",
    "virtual-experiment": f"finished videos {_RESUMED}",
}
"""Commands of minutes, with the end of their sentence; braces stand for the folder of results."""


class InterruptibleCommand(TyperCommand):
    """A command whose sentence on an interrupt says what is kept, where what was interrupted does not."""

    def invoke(self, ctx: Any) -> Any:
        """Run the command."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as error:
            folder = ctx.params.get("store") or ctx.params.get("output")
            raise typer.Abort(str(error) or _KEPT.get(str(ctx.info_name), "").format(folder)) from error
