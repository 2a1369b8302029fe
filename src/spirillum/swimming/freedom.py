"""What is free to move: lateral motion and tilt constrained, or released.

Held, the whole robot has one velocity along x. Released, no force and no lateral torque acts on it, and the motion is
a screw: seen from the tail, the velocity U of the origin and the rotation w = (omega, Omega_y, Omega_z) of the tail are
constant, so that the robot advances along the fixed direction of w at U.w/|w| while its axis circles around it.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, cast, get_args

import numpy as np

from spirillum.arrays import PerRobot, Samples
from spirillum.errors import InputError
from spirillum.fluid.model import SwimmerModel

Motion = Literal["held", "free"]
"""Lateral motion and tilt held, or released."""

LINKS = np.zeros((12, 7))
"""Twists of body and rotor from the seven rates (U, Omega_b, omega_m), all about the origin in body axes."""
LINKS[:6, :6] = LINKS[6:, :6] = np.eye(6)
LINKS[9, 6] = 1.0


class Screw(NamedTuple):
    """The free motion, as long as both parts turn steadily; SI."""

    speed: PerRobot
    """Speed along the axis of the screw, positive where the nose leads, m/s."""
    tilt: PerRobot
    """Angle between the motor axis and the axis of the screw, rad."""
    radius: PerRobot
    """Radius of the helix on which the origin moves, m."""

    @classmethod
    def of(cls, shared: Samples, body_rate: PerRobot, tail_rate: PerRobot) -> Screw:
        """The screw of robots with such rates.

        Args:
            shared: U (3), Omega_y and Omega_z per rate of body and rotor, (n, 5, 2), from `balance.released`.
            body_rate: Omega, rad/s.
            tail_rate: omega, rad/s.
        """
        moving = shared[..., 0] * body_rate[..., None] + shared[..., 1] * tail_rate[..., None]
        velocity = moving[..., :3]
        spin = np.concatenate([np.broadcast_to(tail_rate, moving.shape[:-1])[..., None], moving[..., 3:]], axis=-1)
        size = np.linalg.norm(spin, axis=-1)
        turning = np.where(size > 0, size, np.inf)
        forward = np.where(tail_rate < 0, -1.0, 1.0)
        along = forward * np.sum(velocity * spin, axis=-1) / turning
        return cls(
            speed=np.where(size > 0, along, velocity[..., 0]),
            tilt=np.arctan2(np.linalg.norm(spin[..., 1:], axis=-1), np.abs(tail_rate)),
            radius=np.linalg.norm(np.cross(spin, velocity), axis=-1) / turning**2,
        )


def motion_of(name: str) -> Motion:
    """The motion of that name."""
    if name not in get_args(Motion):
        raise InputError(f"motion = {name!r}; allowed: {', '.join(get_args(Motion))}")
    return cast("Motion", name)


def check_full(model: SwimmerModel) -> None:
    """Refuse a model that does not know all that a free motion needs."""
    if model.axial_only:
        why = "knows the entries along and about the motor axis only"
    elif model.placed:
        why = "answers at one place in the channel, which a free robot leaves"
    else:
        return
    raise InputError(f"motion = 'free' with model '{model.name}', which {why}; allowed: motion 'held', or rft, slender")
