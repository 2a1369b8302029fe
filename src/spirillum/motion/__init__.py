"""Resistance and drive to motion: one force balance and one motor for every model."""

from spirillum.motion.quantities import Swimming
from spirillum.motion.swimming import swim

__all__ = ["Swimming", "swim"]
