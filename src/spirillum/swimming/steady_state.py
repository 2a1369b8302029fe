"""Steady state of a free robot in its tube, as data."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

from spirillum.envelope import quantity

State = Literal["steady", "orbits", "goes around", "changing"]
"""A fixed point of the return map; one up to the azimuth, without weight; motion around the tube, against its weight;
or none of these within the turns that were followed.
"""

END_STATES = {
    "reaches-end": "nose or tail reached an end of the channel",
    "left-table": "the robot tilted farther than its table of resistances is followed",
    "standing": "the robot stands still: dry friction holds it, or its drive is off",
    "orbit": "the robot went around the tube against its weight",
    "ceiling": "the robot swims along the upper half of the tube",
    "steady": "speed and tail rate are steady over turns of the tail",
    "changing": "the motion still changes",
}
"""Final states of a released robot, the first that applies, and what they mean."""


@dataclass(frozen=True)
class SteadyState:
    """Pose of a free robot in its tube over its last turn of the tail (around the tube: over the last circuit).

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
    """Time over which the motion was followed since release, s."""
    approach_time: float
    """Time constant with which a small distance from the steady motion decays, s; NaN where there is none."""
    ended: str = ""
    """Why the motion was not followed to a steady one, in half a sentence; empty where it was."""

    @property
    def statement(self) -> str:
        """Whether a steady motion was reached, and what the means are over, a sentence."""
        if self.state == "steady":
            return "a steady motion was reached: every turn of the tail brings back this place"
        if self.state == "changing":
            return f"no steady motion was reached: {self.ended}; all values are means over the last turn of the tail"
        circuit = abs(2.0 * math.pi / self.orbit_rate) if self.orbit_rate else math.inf
        if self.state == "orbits":
            around = f"orbits the tube's axis in {circuit:.3g} s" if math.isfinite(circuit) else "keeps any azimuth"
            return f"no steady place was reached: nothing tells one azimuth from another, and the robot {around}"
        return (
            f"no steady motion was reached: its weight does not hold the robot, which goes around the tube in "
            f"{circuit:.3g} s; all values are means over a circuit"
        )

    def to_dict(self) -> dict[str, Any]:
        """The object `lying` of an answer."""
        low, high = self.gap_range
        over = "a circuit" if self.state == "goes around" else "a turn of the tail"
        return {
            "state": self.state,
            "statement": self.statement,
            "azimuth": quantity(self.azimuth, "rad"),
            "gap": quantity(self.gap, "m", low=low, high=high, kind="range", over=over),
            "wall_pitch": quantity(self.pitch, "rad"),
            "wall_yaw": quantity(self.yaw, "rad"),
            "orbit_rate": quantity(self.orbit_rate, "rad/s"),
            "contact_force": quantity(self.contact_force, "N"),
            "followed_time": quantity(self.time, "s"),
            "approach_time": quantity(self.approach_time, "s"),
        }
