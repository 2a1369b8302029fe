"""Errors of a track that no repetition shows: by the pixel, the stripes, the lamp. Each states what it was seen on."""

from __future__ import annotations

import math

PIXEL_ERROR = 0.03
"""Least expected amplitude of periodic errors of the position, by an angle or by the pixel grid, pixels."""
AMPLITUDE_ERROR = 0.12
"""Relative standard error of a lateral amplitude: static edges of the glass beside the body bias it towards zero.

On rendered films from the side, with the body within a few pixels of the tube's edge, the bias was 12 to 20 %."""
STRIPE_ERROR = math.radians(0.2)
"""Least expected amplitude of errors of the body's angle that repeat with every stripe, rad."""
PHASE_ERROR = math.radians(1.0)
"""Least expected amplitude of errors of the tail's phase that repeat once or twice a turn, rad."""
DRIFT_PIXELS = 0.01
"""Drift of the position error from end to end, by light and perspective, pixels."""
DRIFT_BARE = 0.1
"""Drift of the position error of a body without stripes, pixels; up to 0.12 on rendered films."""
DRIFT_ANGLE = math.radians(0.1)
"""Least drift of the error of an angle, rad; the standard error of a frame if larger, as highlights move slowly."""
POSITION_ERROR = 0.25
"""Systematic standard error of an absolute position, pixels: of outline, light and lens; it cancels in a velocity."""
HEADING_ERROR = math.radians(0.2)
"""Systematic standard error of the heading of a body that is `LONG` pixels long, rad."""
LONG = 100.0
"""Length of a body whose heading has that error, pixels."""
