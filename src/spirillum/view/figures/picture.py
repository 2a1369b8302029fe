"""A figure that is drawn when it is asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from matplotlib.figure import Figure

from spirillum.view.figures.style import readable, styled


@dataclass(frozen=True)
class Picture:
    """A figure that is drawn when it is asked for."""

    title: str
    caption: str
    """What it shows and what it does not, sentences."""
    alternative: str
    """What it shows for those who cannot see it."""
    draw: Callable[[], Figure] = field(repr=False)

    @classmethod
    def of(cls, title: str, caption: str, alternative: str, draw: Callable[[], Figure]) -> Picture:
        """A picture whose words may hold formulas, which are spelled out."""
        return cls(readable(title), readable(caption), readable(alternative), draw)

    def figure(self) -> Figure:
        """Draw it."""
        with styled():
            return self.draw()
