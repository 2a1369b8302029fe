"""A statement of a paper and its verdict."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Literal

Verdict = Literal["agrees", "disagrees", "undecidable"]

PredictedVerdict = Literal["predicted-agrees", "predicted-disagrees", "depends"]
"""Verdict of a third kind: from the predicted motion of released robots, with nothing fitted or observed."""


@dataclass(frozen=True)
class Claim:
    """A statement of the paper and what became of it."""

    claim: str
    paper: str
    computed: str
    verdict: Verdict | PredictedVerdict
    reason: str

    def to_dict(self) -> dict[str, str]:
        """The entry of `claims.json`."""
        return asdict(self)
