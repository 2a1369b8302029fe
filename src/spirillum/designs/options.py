"""How a design is judged: one table for Python and the command line."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from spirillum.errors import InputError
from spirillum.robot.arguments import Options

__all__ = ["Judged"]


class Judged(Options):
    """How designs are judged under what is not known."""

    argument: ClassVar[str] = "judged"

    statistic: Literal["mean", "quantile"] = "mean"
    """Of the objective over the draws: its mean, or the quantile of its worse end."""
    level: Annotated[float, Field(gt=0.0, lt=0.5)] = 0.1
    """Of the quantile: the share of the draws that are worse."""
    confidence: Annotated[float, Field(gt=0.0, le=1.0)] = 0.95
    """Share of the draws in which a condition has to hold."""
    draws: Annotated[int, Field(strict=True, ge=8, le=16384)] = 256
    """Draws under which the search swims every design; what is stated rests on four times as many, drawn anew."""
    seed: Annotated[int, Field(strict=True, ge=0, lt=2**31)] = 1
    """Of draws and search."""

    def check_read(self) -> None:
        """Refuse what was given where everything is known: there are no draws to judge by; a seed serves the search.

        Raises:
            InputError: naming all of it.
        """
        given = [name for name in type(self).model_fields if name in self.model_fields_set and name != "seed"]
        if given:
            raise InputError(
                f"{', '.join(given)} where nothing is unknown; allowed: with a field that is not known (unknown) or a "
                "posterior"
            )
