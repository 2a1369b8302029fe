"""Where a free robot starts without walls: its links, and at rest in its seat."""

from __future__ import annotations

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.free_robot import TwoLinks, two_links
from spirillum.dynamics.start import start_state
from spirillum.errors import InputError
from spirillum.kernels import rigid_links
from spirillum.kernels import two_links as kernel
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.swimming.prediction import Prediction
from spirillum.units import show


def links_without_walls(steady: Prediction, roughness: float | None, *, weight: bool) -> TwoLinks:
    """What a robot's rates follow from in unbounded fluid, with films between it and a channel's wall.

    Args:
        steady: the robot with friction and drive, by a model with all entries of the resistance matrix.
        roughness: height of the wall's asperities, m; None: 1e-4 of the body's radius.
        weight: let weight and buoyancy act, if the masses are known.
    """
    effective = steady.effective_friction
    return two_links(
        steady.robot,
        steady.batch,
        steady.model,
        friction=steady.friction,
        effective=0.0 if np.isnan(effective) else effective,
        calibrated=steady.calibrated,
        weight=weight,
        roughness=roughness,
    )


def resting_state(robot: Robot, links: TwoLinks, placement: Placement) -> Samples:
    """The state of a robot at rest in its seat, (19,); a heavy one whose gap is open lies low."""
    start = start_state(robot, placement, lying=float(links.weight[: rigid_links.MOMENT_BODY].sum()) > 0)
    if not links.spots.size:
        return start
    film, rough = kernel.thinnest_film(start, links.wall, links.spots), float(links.wall[kernel.ROUGHNESS])
    if film > 0:
        return start
    gap = film + rough
    if gap > 0:
        raise InputError(
            f"roughness = {show(rough, 'um')} with a gap of {show(gap, 'um')} at the start; allowed: a roughness below "
            "the gap, or a larger placement.gap"
        )
    if placement.pitch:
        raise InputError(
            f"placement.pitch = {show(placement.pitch, 'deg')}: body or tail would cut into the wall; allowed: a "
            "smaller pitch, or a larger placement.gap"
        )
    raise InputError(
        f"the robot would start at the wall of channel.diameter = {show(2 * links.wall[kernel.RADIUS], 'mm')}; "
        "allowed: a larger placement.gap or a smaller placement.eccentricity"
    )
