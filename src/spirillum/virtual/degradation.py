"""What spoils a video: noise, a lamp that drifts, compression, lost frames, tilt, glare, bubbles, a hand's shadow."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np

from spirillum.errors import InputError, did_you_mean

__all__ = ["PRESETS", "Degradation", "degradation_of"]


@dataclass(frozen=True)
class Degradation:
    """How much of each disturbance a video has; the defaults are a clean one's."""

    noise: float = 0.0
    """Standard deviation of the noise, in steps of 255; independent in every pixel and colour."""
    lamp_drift: float = 0.0
    """Share by which the lamp's brightness changes; its colour by a quarter of that."""
    crf: int = 18
    """Constant rate factor of the compression (H.264), 0 (no loss) to 51."""
    dropped: float = 0.0
    """Share of frames that are lost; the time stamps of the others stay true."""
    tilt: float = 0.0
    """Angle between optical axis and vertical, in a random direction, rad."""
    glare: float = 0.0
    """Share of the body's picture under a spot of glare."""
    glare_moves: bool = True
    """Whether the glare goes along with the body, or stands still in the lab."""
    bubbles: int = 0
    """Number of bubbles that drift under the top of the tube."""
    hand: bool = False
    """Whether the shadow of a hand passes over the picture."""

    def __post_init__(self) -> None:
        _check("noise", self.noise, 0.0, 64.0)
        _check("lamp_drift", self.lamp_drift, 0.0, 0.9)
        _check("crf", self.crf, 0, 51)
        _check("dropped", self.dropped, 0.0, 0.9)
        _check("tilt", self.tilt, 0.0, 0.2, " rad")
        _check("glare", self.glare, 0.0, 1.0)
        _check("bubbles", self.bubbles, 0, 200)

    def to_dict(self) -> dict[str, Any]:
        """The fields, for the truth beside a video."""
        return asdict(self)


def _check(name: str, value: float, low: float, high: float, unit: str = "") -> None:
    """One number in its range.

    Raises:
        InputError: if it is not.
    """
    whole = isinstance(low, int)
    good = isinstance(value, int) if whole else isinstance(value, float | int)
    if isinstance(value, bool) or not good or not low <= value <= high:
        kind = "a whole number from " if whole else ""
        raise InputError(f"{name} = {value!r}; allowed: {kind}{low:g} to {high:g}{unit}")


PRESETS: dict[str, Degradation] = {
    "clean": Degradation(),
    "degraded": Degradation(noise=8.0, lamp_drift=0.2, crf=33, dropped=0.05, tilt=float(np.radians(2.0)), glare=0.2),
}
"""Named degradations; `degraded` is what measuring is tested with."""


def degradation_of(value: str | Degradation, **instead: Any) -> Degradation:
    """A degradation by name, with single fields replaced.

    Args:
        value: `clean`, `degraded`, or a `Degradation`.
        instead: fields to replace; None leaves a field as it is.

    Raises:
        InputError: for an unknown name, or a value out of range.
    """
    if isinstance(value, str):
        if value not in PRESETS:
            hint = did_you_mean(value, PRESETS)
            raise InputError(f"degradation = {value[:40]!r}{hint}; allowed: {', '.join(PRESETS)}")
        value = PRESETS[value]
    known = {item.name for item in fields(Degradation)}
    wrong = next((name for name in instead if name not in known), None)
    if wrong is not None:
        raise InputError(f"degradation {wrong!r}{did_you_mean(wrong, known)}; allowed: {', '.join(sorted(known))}")
    return Degradation(**(asdict(value) | {name: new for name, new in instead.items() if new is not None}))
