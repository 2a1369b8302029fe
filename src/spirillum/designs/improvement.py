"""Whether the best design is better than others by more than the error of its model."""

from __future__ import annotations

import math

import numpy as np

from spirillum.designs.design_result import Alternative, Design
from spirillum.display import percent
from spirillum.fluid.registry import find_swimmer_model
from spirillum.notes import Note

_ALIKE = 1e-9
"""Relative range of an objective below which it does not change."""
ALTERNATIVES = {
    "today": "today's design",
    "runner_up": "the best of the designs that differ by a tenth of a range or more",
}
"""What the designs are called that the best one is compared with."""
_SHORT = {"today": "today's design", "runner_up": "the runner-up"}


def lead_warnings(answer: Design) -> tuple[Note, ...]:
    """Sentences on fields without influence, on a better design, and on differences below the error of the objective.

    Returns:
        One sentence for each such error; none where every lead is larger.
    """
    said = _without_effect(answer)
    if len(said) == len(answer.profiles):  # every design is the best one
        return said
    leads: dict[tuple[float, str], list[str]] = {}
    best, sign = answer.objective, answer.objectives[0].sign
    for other in answer.alternatives:
        error = _error(answer, other)
        if not (other.keeps and math.isfinite(other.objective) and best):
            continue
        lead = sign * (best - other.objective) / abs(best)
        if lead < -_ALIKE and other.name == "today":
            words = (
                f"{ALTERNATIVES[other.name]}, outside these ranges, is better than the best one within them by "
                f"{percent(-lead)}; widen the ranges"
            )
            said += (Note("design-at-limit", words),)
        elif lead < error[0]:
            leads.setdefault(error, []).append(f"{_SHORT[other.name]} by {percent(lead)}")
    return said + tuple(
        Note(
            "design-tie",
            f"the best design leads {' and '.join(led)}, within the error of {percent(error)} {of}; they may be equal",
            ("objective",),
        )
        for (error, of), led in leads.items()
    )


def _without_effect(answer: Design) -> tuple[Note, ...]:
    """A sentence for each field along which the objective stays as it is."""
    found = []
    for profile in answer.profiles:
        known = profile.objective[np.isfinite(profile.objective)]
        if known.size > 1 and np.ptp(known) <= _ALIKE * np.abs(known).max():
            name = answer.objectives[0].name.replace("_", " ")
            words = f"the {name} does not depend on {profile.path}: every value of the range is as good"
            found.append(Note("design-tie", words, (profile.path,)))
    return tuple(found)


def _error(answer: Design, other: Alternative) -> tuple[float, str]:
    """The largest relative error that is stated of the objective, and of what it is; 0 where none is stated."""
    objective = answer.objectives[0]
    errors = {}
    stated = find_swimmer_model(answer.model).known_speed_error
    if stated is not None and objective.target is None and objective.quantity.name == "forward_velocity":
        errors[f"that model '{answer.model}' states of a speed"] = stated
    if answer.learned is not None:
        known = answer.learned
        errors["of the learned model at the best design"] = known.last
        if other.name != "today":  # today's is solved for
            errors["of the learned model at a design that it was not solved for"] = known.left_out
    finite = {of: error for of, error in errors.items() if math.isfinite(error)}
    of = max(finite, key=lambda name: finite[name], default="")
    return finite.get(of, 0.0), of
