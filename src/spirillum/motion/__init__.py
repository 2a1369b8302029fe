"""Resistance and drive to motion: one force balance and one motor for every model."""

from spirillum.motion.swimming import Swimming, swim

__all__ = ["Swimming", "swim"]
