"""Runs with a calibration: model and motion that go with it, and intervals over the draws of a posterior.

Every draw is a robot of its own, with its own roughness and dry friction. Its steady motion is looked for from where
that of the posterior's median lies, by Newton's method over a turn of the tail.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.free_motion import STABLE, FreeMotion, means_over, prepare_release
from spirillum.dynamics.return_map import ReturnMap, fixed_place
from spirillum.errors import InputError
from spirillum.fitted.fit import Fit
from spirillum.fitted.posterior_file import PosteriorFile
from spirillum.fluid.registry import find_swimmer_model
from spirillum.notes import Note, note_attributes, notes_in
from spirillum.progress import Progress, tell
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot, without_reynolds_bound
from spirillum.scalars import is_whole
from spirillum.swimming.intervals import PosteriorFor, intervals_over, sampled_batch, sampled_discrepancy
from spirillum.swimming.motions import LEVEL, Intervals, Swimming
from spirillum.swimming.preparation import ModelChoice, choose_model
from spirillum.swimming.steady import one_after_another

if TYPE_CHECKING:
    import xarray as xr


_DRAWS = 100  # Draws of a posterior that are run.
_SURE = 80  # Number of draws from which on the limits of a 95 % interval are interpolated.
_FEWEST, _MOST = 20, 1000
_FACTORS = {
    "forward_velocity": ("advance", "motor_rate"),
    "tail_rotation_rate": ("motor_rate",),
    "body_rotation_rate": ("turning", "motor_rate"),
}
"""Quantities whose averages have intervals, and the observables whose discrepancy goes onto each."""
_OVER = ("", "_on", "_steady")


def chosen_run(
    model: str, motion: str | None, robot: Robot, placement: Placement, fit: Fit
) -> tuple[ModelChoice, str, list[Note]]:
    """Model and motion of a run, the requested ones or those of robot and fit, with a sentence on each exception."""
    choice = choose_model(model, robot, placement=placement, fit=fit)
    notes: list[Note] = []
    if not choice.fitted:
        if fit.models and choice.model not in fit.models:
            notes.append(Note.named("fit-of-another-model", fit=fit.name, fitted=fit.models[0], model=choice.model))
        return choice, "free" if motion is None else motion, notes
    notes.append(Note.named("model-of-run", model=choice.model, reason=choice.reason))
    chosen = find_swimmer_model(choice.model)
    if motion is None and chosen.placed and fit.friction_coefficient:
        notes.append(Note.named("free-by-friction"))
        motion = "free"
    if motion is None and (chosen.axial_only or chosen.placed) and not fit.of_trials:
        why = "has the entries along and about the motor axis only" if chosen.axial_only else "is fitted to one pose"
        notes.append(Note.named("axial-run", model=choice.model, why=why))
        return choice, "held", notes
    if motion != "held" and chosen.placed and fit.posterior is None and not fit.of_trials:
        notes.append(Note.named("calibration-of-held"))
    return choice, "free" if motion is None else motion, notes


def sample_count(draws: int | None, posterior: PosteriorFile | None) -> int:
    """Number of posterior samples that are run: the requested one, 0 for the median alone; None: 100."""
    given: Any = _DRAWS if draws is None else draws
    if not is_whole(given) or not (int(given) == 0 or _FEWEST <= int(given) <= _MOST):
        raise InputError(f"draws = {str(draws)[:40]}; allowed: a whole number from {_FEWEST} to {_MOST}, or 0")
    if draws is not None and posterior is None:
        raise InputError(f"draws = {draws} without a posterior, whose draws they are; allowed: with one")
    return int(given)


def with_intervals(
    dataset: xr.Dataset,
    posterior: PosteriorFile,
    robot: Robot,
    run: Callable[[Robot, int], xr.Dataset],
    draws: int,
    progress: Progress | None,
) -> xr.Dataset:
    """A run with 95 % intervals of its mean speed and rates, as scalars `..._low` and `..._high`."""
    rng = np.random.default_rng(1)
    found: dict[str, list[float]] = {f"mean_{name}{over}": [] for name in _FACTORS for over in _OVER}
    drawn, kept = posterior.sampled_robots(robot, draws, rng), posterior.places(draws)
    for number, one in enumerate(drawn):
        tell(progress, "draws of the posterior", number, len(drawn))
        answer = run(one, kept[number])
        for name, values in found.items():
            values.append(float(answer[name]))
    off = discrepancy_factors(posterior.at(kept), robot, {"advance": np.zeros(len(drawn))}, rng)
    scalars: dict[str, Any] = {}
    for quantity, factor in off.items():
        for name in (f"mean_{quantity}{over}" for over in _OVER):
            scalars |= _limits(name, np.array(found[name]) * factor, dataset)
    notes = notes_in(dataset.attrs)
    if len(drawn) < _SURE:
        notes = (*notes, Note.named("few-draws", draws=len(drawn), enough=_SURE))
    return dataset.assign(scalars).assign_attrs(draws=len(drawn), level=LEVEL, **note_attributes(notes))


def discrepancy_factors(
    posterior: PosteriorFile,
    robot: Robot,
    predicted: Mapping[str, Samples],
    rng: np.random.Generator,
    *,
    whose: PosteriorFor = "new",
) -> dict[str, Samples]:
    """Factors of a model's discrepancy on the mean speed and rates of a run of each draw, (draws,) each."""
    tail = posterior.measured(robot) if whose == "measured" else None
    off = sampled_discrepancy(posterior, predicted, rng, tail)
    one = np.ones_like(off["advance"])
    if robot.drive is not None and robot.drive.joint == "fixed":
        off["turning"] = one
    if robot.drive is None or robot.drive.kind != "dc-motor":
        off["motor_rate"] = one
    return {name: np.prod([off[factor] for factor in factors], axis=0) for name, factors in _FACTORS.items()}


def _limits(name: str, values: Sequence[float] | np.ndarray, dataset: xr.Dataset) -> dict[str, Any]:
    """Limits of an average; none where too many draws have none."""
    known = np.asarray(values)[np.isfinite(values)]
    middle = float(dataset[name])
    if known.size < LEVEL * len(values) or not np.isfinite(middle):
        return {}
    ends = np.quantile(known, [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL])
    kept = {"units": dataset[name].attrs["units"], "source": "posterior of a calibration, discrepancy included"}
    words = str(dataset[name].attrs["long_name"])
    return {
        f"{name}_{which}": ((), float(end), {**kept, "long_name": f"{words}, {side} limit of the 95 % interval"})
        for which, side, end in zip(("low", "high"), ("lower", "upper"), ends, strict=True)
    }


DRAWS = 40  #: Draws of a posterior that are followed: some second each.
_LEAST_SHARE = 0.95  # Share of the draws that have to reach a steady motion.


def intervals_of_free_motion(
    found: FreeMotion, posterior: PosteriorFile, *, posterior_for: PosteriorFor, progress: Progress | None = None
) -> Intervals:
    """95 % intervals of a steady free motion, the model's discrepancy included."""
    lying, robot, reading = found.run.lying, found.prediction.robot, found.prediction.friction
    if lying.state != "steady":
        raise InputError(
            f"posterior with motion 'free': its median reaches no steady motion ({lying.statement}); allowed: motion "
            "'held', or `simulate` with the posterior"
        )
    unbound = without_reynolds_bound(robot)  # the median was refused, or allowed, for all
    rng, indices = np.random.default_rng(1), posterior.places(DRAWS)
    swum: list[Swimming] = []
    steady = []
    for number, (index, one) in enumerate(zip(indices, posterior.sampled_robots(unbound, DRAWS, rng), strict=True)):
        tell(progress, "draws of the posterior", number, len(indices))
        release = found.release.with_contact(posterior.contact(index))
        held, links = prepare_release(one, found.robot.table, release, found.prediction.tail_rate, reading)
        fixed = fixed_place(ReturnMap(links, float(np.sign(held.tail_rotation_rate))), found.run.start, heavy=True)
        if fixed is None or abs(fixed.multiplier) > STABLE:
            continue
        swum.append(means_over(held, links, fixed.state, fixed.turn.time, 1))
        steady.append(index)
    lost = len(indices) - len(steady)
    if lost > (1.0 - _LEAST_SHARE) * len(indices):
        raise InputError(
            f"posterior with motion 'free': {lost} of {len(indices)} draws reach no steady motion near that "
            "of the median; allowed: motion 'held', or `simulate` with the posterior"
        )
    kept = posterior.at(steady)
    batch = sampled_batch(robot, kept.model, kept.of(robot, rng), kept.count)
    own_drive = found.prediction.tail_rate is None
    whole = one_after_another(swum)
    return intervals_over(
        whole, batch, kept, robot, rng, own_drive=own_drive, friction=reading, posterior_for=posterior_for
    )
