"""Where a robot comes to lie that is free to move in its tube, as data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from spirillum.answer import quantity

__all__ = ["Lying", "State"]

State = Literal["steady", "orbits", "goes around", "changing"]
"""A place that every turn of the tail brings back; that but for the azimuth, without weight; around the tube, against
its weight; or none of these within the turns that were followed."""


@dataclass(frozen=True)
class Lying:
    """The place of a free robot in its tube over its last turn of the tail (around the tube: over the last circuit).

    SI; azimuths about +x from the lowest place, pitch away from the wall, yaw to +y at the lowest place.
    """

    state: State
    """`steady`, `orbits`, `goes around` or `changing`."""
    azimuth: float
    """Azimuth of the body's centre, mean, rad; NaN where it goes around."""
    gap: float
    """Smallest distance of body and wall, mean, m."""
    gap_range: tuple[float, float]
    """Its least and largest value."""
    pitch: float
    """Mean pitch against the wall, rad."""
    yaw: float
    """Mean yaw against the wall, rad."""
    orbit_rate: float
    """Rate of the azimuth, mean, rad/s."""
    contact_force: float
    """Load on asperities, mean, N."""
    time: float
    """For how long the motion was followed from where it was laid down, s."""
    approach_time: float
    """Time in which a small distance from the steady motion falls by e, s; NaN where there is none."""

    def to_dict(self) -> dict[str, Any]:
        """The object `lying` of an answer."""
        low, high = self.gap_range
        return {
            "state": self.state,
            "azimuth": quantity(self.azimuth, "rad"),
            "gap": quantity(self.gap, "m", low=low, high=high, kind="range", over="a turn of the tail"),
            "wall_pitch": quantity(self.pitch, "rad"),
            "wall_yaw": quantity(self.yaw, "rad"),
            "orbit_rate": quantity(self.orbit_rate, "rad/s"),
            "contact_force": quantity(self.contact_force, "N"),
            "followed_time": quantity(self.time, "s"),
            "approach_time": quantity(self.approach_time, "s"),
        }
