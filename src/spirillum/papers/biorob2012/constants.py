"""Numbers that the paper states and that its claims and figures are held against, each with its source in the paper.

Robot, motor and fluid (Tables I and II) and the calibration factors (Table III) are in the presets `biorob2012-wide`
and `biorob2012-narrow`.
"""

from __future__ import annotations

from typing import NamedTuple


class LargestReynolds(NamedTuple):
    """The largest Reynolds number of a channel, and the tail that has it."""

    value: float
    """Re_max; the paper does not state its length scale."""
    wavelength_mm: float
    amplitude_mm: float
    figure: str
    """The figure whose caption states it."""


class VelocityDrop(NamedTuple):
    """An extreme of the velocity decrease from the wide to the narrow channel, and the tail that has it."""

    value_mm_s: float
    wavelength_mm: float
    amplitude_mm: float


LARGEST_REYNOLDS = {
    "wide": LargestReynolds(0.0058, 25.0, 2.5, "Fig. 5"),
    "narrow": LargestReynolds(0.0038, 20.0, 1.5, "Fig. 6"),
}
"""By channel; captions of Figs 5 and 6."""

VELOCITY_DROPS = {"lowest": VelocityDrop(0.0653, 10.0, 3.5), "largest": VelocityDrop(0.648, 25.0, 2.5)}
"""Stated in the text on Figs 5 and 6."""

GLOBAL_DROP = 0.389
"""Relative loss of the mean velocity of all tails from the wide to the narrow channel; text on Figs 5 and 6."""

LOW_REYNOLDS = 0.1
"""Upper bound of low Reynolds number conditions; text."""

BODY_ROTATION_ERROR = 0.5
"""Largest relative error of the predicted body rotation rates; text on Figs 5 and 6."""

BODY_DRAG_FACTORS = {"wide": 1.95, "narrow": 3.6}
"""Factors on the isolated body's drag along the axis; Table III."""

ROBOT_LENGTH = 0.1
"""Lower bound of the prototype's length, m; text."""

NARROWER = 0.25
"""Relative reduction of the channel's radius from wide to narrow; text and Table I."""

FRAME_RATE = 30.0
"""Frame rate of the camera, Hz; text on the experiments."""
