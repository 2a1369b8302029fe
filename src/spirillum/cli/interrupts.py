"""Interrupted commands: the sentence about their finished work."""

from __future__ import annotations

import re
from itertools import pairwise
from typing import Any

import typer
from typer.core import TyperCommand

from spirillum.errors import InputError

_KEPT = {
    "calibrate": "an unfinished fit is not kept; earlier results stay until all new ones are there",
    "design": "nothing of this search is kept",
    "prepare": "finished tables and poses are kept; the same command resumes",
    "study": "robots that were finished are kept; the same command resumes",
    "virtual-experiment": "videos that were finished are kept; the same command resumes",
}
"""Commands of minutes, with the end of their sentence."""
_PATHS = ("FILE", "DIR", "FOLDER.zarr")
_NUMBER = re.compile(r"[\d.+-]+")  # also in digits of other scripts


class InterruptibleCommand(TyperCommand):
    """A command whose sentence on an interrupt says what is kept, where what was interrupted does not."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Return the arguments that no parameter takes; refuse options given twice, empty names and foreign digits."""
        takes = {name: one for one in self.params if not getattr(one, "is_flag", True) for name in one.opts}
        split = [part for text in args for part in (text.split("=", 1) if text.startswith("--") else [text])]
        given = [takes[name] for name in split if name in takes]
        for one in given:
            if given.count(one) > 1 and not one.multiple:
                raise InputError(f"{' or '.join(one.opts)} is given twice; allowed: one {one.metavar or 'value'}")
        for name, value in pairwise(split):
            if name in takes and not value.strip() and (kind := takes[name].metavar) in _PATHS:
                raise InputError(f"{name} {value!r} is empty; allowed: {name} {kind}")
            if name in takes and _NUMBER.fullmatch(value) and not value.isascii():
                raise InputError(f"{name} {value[:40]!r} is not a number; allowed: the digits 0 to 9")
        return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """Run the command."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt as error:
            raise typer.Abort(str(error) or _KEPT.get(str(ctx.info_name), "")) from error
