"""Objectives and constraints of a design: one table for Python and the command line."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from spirillum.errors import InputError
from spirillum.robot.arguments import Options


class Judged(Options):
    """Statistics of designs under uncertainty."""

    argument: ClassVar[str] = "judged"

    statistic: Literal["mean", "quantile"] = "mean"
    """Of the objective over the draws: its mean, or the quantile of its worse end."""
    level: Annotated[float, Field(gt=0.0, lt=0.5)] = 0.1
    """Of the quantile: the share of the draws that are worse."""
    confidence: Annotated[float, Field(gt=0.0, le=1.0)] = 0.95
    """Share of the draws that must satisfy a condition."""
    draws: Annotated[int, Field(strict=True, ge=8, le=16384)] = 256
    """Draws used by the search; the stated statistics use four times as many new ones."""
    seed: Annotated[int, Field(strict=True, ge=0, lt=2**31)] = 1
    """Seed of draws and search."""
    confirm: Annotated[bool, Field(strict=True)] = False
    """Make the tables that trials of the best three designs lack: 4 to 12 minutes of one core each."""

    def check_read(self, *, known: bool, conditions: bool) -> None:
        """Refuse what was given and nothing reads; a seed serves the search in any case.

        Args:
            known: everything is known, so that there are no draws to judge by.
            conditions: designs have to keep some.

        Raises:
            InputError: naming it.
        """
        given = [
            name
            for name in type(self).model_fields
            if name in self.model_fields_set and name not in ("seed", "confirm")
        ]
        if given and known:
            raise InputError(
                f"{', '.join(given)} where nothing is unknown; allowed: with a field that is not known (unknown) or a "
                "posterior"
            )
        if "level" in given and self.statistic != "quantile":
            raise InputError(
                f"level = {self.level:g} with statistic '{self.statistic}', which has none; allowed: with quantile"
            )
        if "confidence" in given and not conditions:
            raise InputError(
                f"confidence = {self.confidence:g} without a condition (subject_to) that would have to hold; allowed: "
                "with one"
            )
