"""Free motion in the tube over a posterior: where each of its draws comes to swim, and the intervals over them.

Every draw is a robot of its own, with its own roughness and dry friction. Its steady motion is looked for from where
that of the posterior's middle lies, by Newton's method over a turn of the tail.
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from spirillum.dynamics.free_motion import FreeMotion, let_go, means_over
from spirillum.dynamics.integration import Progress
from spirillum.dynamics.return_map import ReturnMap, fixed_place
from spirillum.dynamics.steady_state_search import STABLE
from spirillum.errors import InputError
from spirillum.fitted.posterior_file import PosteriorFile
from spirillum.swimming.discrepancy import PosteriorFor
from spirillum.swimming.intervals import drawn_batch, intervals_over
from spirillum.swimming.reynolds import without_reynolds_bound
from spirillum.swimming.steady_quantities import Intervals, Swimming

DRAWS = 40
"""Draws of a posterior that are followed: some second each."""
_FEWEST = 0.95
"""Share of the draws that have to come to a steady motion."""


def intervals_of_free_motion(
    found: FreeMotion,
    posterior: PosteriorFile,
    *,
    posterior_for: PosteriorFor,
    progress: Progress | None = None,
) -> Intervals:
    """95 % intervals of a steady free motion, the model's discrepancy included.

    Args:
        found: the free motion of the posterior's middle.
        posterior: its draws.
        posterior_for: whose discrepancy they hold: of a `new` tail, or of this one, which was `measured`.
        progress: told how many draws are done, and of how many.
    """
    lying, robot = found.run.lying, found.prediction.robot
    if lying.state != "steady":
        raise InputError(
            f"posterior with motion 'free': its middle comes to no steady motion ({lying.statement}); allowed: motion "
            "'held', or `simulate` with the posterior"
        )
    unbound = without_reynolds_bound(robot)  # the middle was refused, or allowed, for all
    rng, places = np.random.default_rng(1), posterior.places(DRAWS)
    swum: list[Swimming] = []
    steady = []
    for number, (place, one) in enumerate(zip(places, posterior.drawn(unbound, DRAWS, rng), strict=True)):
        if progress is not None:
            progress("draws of the posterior", number, len(places))
        held, links, _ = let_go(one, found.laid._replace(contact=posterior.contact(place)))
        fixed = fixed_place(ReturnMap(links, float(np.sign(held.tail_rotation_rate))), found.run.start, heavy=True)
        if fixed is None or abs(fixed.multiplier) > STABLE:
            continue
        swum.append(means_over(held, links, fixed.state, fixed.turn.time, 1))
        steady.append(place)
    lost = len(places) - len(steady)
    if lost > (1.0 - _FEWEST) * len(places):
        raise InputError(
            f"posterior with motion 'free': {lost} of {len(places)} draws come to no steady motion near that "
            "of the middle; allowed: motion 'held', or `simulate` with the posterior"
        )
    names = [item.name for item in fields(Swimming)]
    whole = Swimming(**{name: np.concatenate([getattr(one, name) for one in swum]) for name in names})
    kept = posterior.at(steady)
    batch = drawn_batch(robot, kept.model, kept.of(robot, rng), kept.count)
    own_drive = found.prediction.tail_rate is None
    reading = found.prediction.friction
    return intervals_over(
        whole, batch, kept, robot, rng, own_drive=own_drive, friction=reading, posterior_for=posterior_for
    )
