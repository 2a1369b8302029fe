"""Which values of some fields of a robot are best: for its motor, its tube, and what is not known of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.arrays import Flags, Samples
from spirillum.designs.criteria import Judged, Manufacturability, Space, condition_of, quantity_of, space_of, with_unit
from spirillum.designs.design_result import Alternative, Design, Uncertainty, bound_by_of, margin_warnings, profile_of
from spirillum.designs.evaluation import Evaluation, Objective, SampledRobots, Unknowns, unknowns_of
from spirillum.designs.learned import chosen_model, is_learned, learned_best
from spirillum.designs.search import CONFIRMED, Archive, best_apart, best_design, confirmed, pareto_front
from spirillum.errors import InputError
from spirillum.fluid.registry import find_swimmer_model
from spirillum.notes import Note
from spirillum.progress import Progress
from spirillum.robot.limits import all_hold, broken, reynolds_limits, reynolds_warnings, stokes_flow_problem
from spirillum.robot.load import load
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot, with_numbers
from spirillum.robot.tube_pose import gap_of
from spirillum.swimming.balance import find_friction_model
from spirillum.swimming.cautions import calibration_warnings
from spirillum.swimming.motions import LEVEL, STEADY, Swimming
from spirillum.swimming.preparation import AUTO, WALLED
from spirillum.swimming.scenario import drive_warnings
from spirillum.units import KINDS, parse_option, show

_MORE_DRAWS = 4  # draws of what is stated over those of the search
_SETS = 16  # independent sets of these draws, from which the interval of a probability follows
_FRONT_POINTS = 13
_MOST_OF_STEP_OUT = 0.95  # share of the step-out rate above which a warning states the margin
_STATED_SEED = 7919  # added to the seed for the draws of what is stated


def design(
    robot: str | Path | Mapping[str, Any] | Robot,
    vary: Mapping[str, str | Sequence[object]],
    *,
    maximise: str | Sequence[str] = (),
    minimise: str | Sequence[str] = (),
    subject_to: str | Sequence[str] = (),
    unknown: Mapping[str, str | Sequence[object]] | None = None,
    posterior: str | Path | None = None,
    judged: Judged | Mapping[str, Any] | None = None,
    bench: Manufacturability | Mapping[str, Any] | None = None,
    model: str = AUTO,
    tail_rate: str | float | None = None,
    progress: Progress | None = None,
) -> Design:
    """Find the best values of some numeric fields of a robot.

    What can be manufactured, what fits into the tube and what the model describes is always a condition. Under unknowns
    every design is evaluated under the same draws. The best one is then stated from new draws: it owes part of its lead
    to those by which it was chosen.

    The search holds robots at their pose. By `tube` and its own drive the best three designs that differ by a tenth
    of a range are confirmed by trials, where their tubes have tables (`confirmed`).

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot.
        vary: dotted field to its range, as ``{"tail.wavelength": "5 mm:40 mm"}``, or two values; `tail.turns` are whole
            turns, which set the tail's length.
        maximise: a quantity to make large, as `forward_velocity`; or a condition, as ``"forward_velocity >= 1 mm/s"``,
            of which the probability is made large. Two objectives, from here or `minimise`, give a Pareto front.
        minimise: a quantity to make small.
        subject_to: a condition, as ``"motor_current <= 0.4 A"``, or several.
        unknown: dotted field to the range over which it is uniform.
        posterior: posterior of a calibration; its draws are the unknowns.
        judged: `statistic`, `level`, `confidence`, `draws`, `seed`; `confirm` makes the tables that trials of the best
            designs lack.
        bench: `mandrel`, `clearance`.
        model: `sbt`, `rft`, `slender` or `tube`. `tube` and `slender` are learned: a fast model with a correction from
            some designs that are solved for, the best of them in the end. `slender` is evaluated itself where more than
            three fields of the tail, or fields of the body, are varied and nothing is unknown. `auto` is that of the
            posterior, else `tube` for a robot in a channel, and `slender` without one, or `sbt` where the flow cannot
            be learned.
        tail_rate: lab rotation rate of the tail, with its unit (``"1.2 Hz"``) or a float in rad/s; None: the
            robot's own drive.
        progress: called with stage, number done, and total.

    Raises:
        InputError: for wrong input, or where no design can be built and keeps all conditions.
    """
    given, options = load(robot), Judged.of(judged)
    unknowns = unknowns_of(given, unknown, posterior, model)
    options.check_read(known=unknowns.known, conditions=len(subject_to) > 0)
    space = space_of(unknowns.robot, vary)
    twice = {item.path for item in unknowns.ranges} & {item.path for item in space.variables}
    if twice:
        raise InputError(f"{twice.pop()} is varied and unknown; allowed: one of them")
    choice = chosen_model(model, given, space, unknowns)
    chosen = find_swimmer_model(choice.model)
    rate = None if tail_rate is None else parse_option("tail_rate", tail_rate, KINDS["rate"])
    if rate == 0:
        raise InputError("tail_rate = 0 Hz: a tail at rest drives nothing; allowed: a rate above or below 0")
    if rate is None and given.drive is None:
        raise InputError(f"{given.name} has no [drive]; allowed: a drive, or a tail rate (--tail-rate '1 Hz')")
    objectives = _objectives(maximise, minimise, options)
    conditions = tuple(condition_of(text) for text in ([subject_to] if isinstance(subject_to, str) else subject_to))
    manufacturability = Manufacturability.of(bench)
    manufacturability.check(space.batch(np.array([[0.0], [1.0]]) * np.ones(space.size)))

    def under(samples: SampledRobots) -> Evaluation:
        return Evaluation(space, chosen, objectives, conditions, manufacturability, samples, options.confidence, rate)

    searched = under(unknowns.draws(options.draws, options.seed))
    archive = Archive()
    learned = None
    if is_learned(chosen, space, unknowns):
        searched, archive, best, learned = learned_best(searched, unknowns, choice.model, options.seed, progress)
    else:
        best = best_design(searched, archive, seed=options.seed, progress=progress)
    if not best.possible:
        raise InputError(_none_is_possible(searched, best.shares, archive))
    front = None
    if len(objectives) > 1:
        front = pareto_front(searched, archive, seed=options.seed, points=_FRONT_POINTS, progress=progress)
    drawn = unknowns.draws(_MORE_DRAWS * options.draws, options.seed + _STATED_SEED, _SETS)
    stated = replace(searched, samples=drawn)
    answer = _answer(given, unknowns, searched, stated, best.shares, archive, front)
    answer = replace(answer, learned=learned, model_reason=choice.reason)
    if choice.model == WALLED and rate is None and posterior is None:
        built = [(shares, _built(given, space, shares)) for shares in answer.leading]
        answer = replace(answer, confirmed=confirmed(built, make_tables=options.confirm, progress=progress))
    elif options.confirm:
        raise InputError("confirm = True, but trials follow from the drive in the tube; allowed: model 'tube' alone")
    return replace(answer, warnings=(*answer.warnings, *margin_warnings(answer)))


def _objectives(maximise: str | Sequence[str], minimise: str | Sequence[str], options: Judged) -> tuple[Objective, ...]:
    """One objective or two."""
    found = []
    for sign, option, names in ((1.0, "maximise", maximise), (-1.0, "minimise", minimise)):
        for name in [names] if isinstance(names, str) else names:
            if "=" in name:
                if sign < 0:
                    raise InputError(
                        f"minimise = {name[:60]!r} is a condition; allowed: maximise, or the other condition"
                    )
                target = condition_of(name, option)
                found.append(Objective(target.quantity, 1.0, "probability", target=target))
            else:
                found.append(Objective(quantity_of(name, option), sign, options.statistic, options.level))
    if len({item.name for item in found}) < len(found):
        raise InputError(f"{found[0].name} is twice an objective; allowed: two different ones")
    if not 1 <= len(found) <= 2:
        raise InputError(f"{len(found)} objectives; allowed: one or two, by maximise and minimise")
    return tuple(found)


def _none_is_possible(searched: Evaluation, shares: Samples, archive: Archive) -> str:
    """Why no design will do, for the one that comes nearest."""
    values = searched.space.named(shares)
    outside = broken(searched.limits(shares[None]))
    if outside:
        why = outside[0].sentence()
    else:
        motion = searched.motion(shares[None])
        requested = [goal.quantity.name for goal in searched.objectives]
        requested += [condition.quantity.name for condition in searched.conditions]
        undefined = [name for name in requested if np.isnan(searched.quantity(motion, name)).all()]
        if undefined and motion.valid.all():
            return (
                f"{undefined[0]} has no value for {searched.space.robot.name}, as its drive, joint and placement are, "
                f"by model '{searched.model.name}'; allowed: a quantity that `predict --all` gives"
            )
        worst = {item.words: float(searched.excess(item, motion)[0]) for item in searched.conditions}
        kept = [words for words, excess in worst.items() if excess > 0]
        limits = reynolds_limits(searched.samples.batch, motion.reynolds_number, motion.tail_reynolds_number)
        inertia = stokes_flow_problem(searched.samples.batch, limits)
        why = inertia.replace("; ", ", ") or (f"{', '.join(kept)} is not kept" if kept else "it finds no steady motion")
    words = ", ".join(f"{item.path} = {with_unit(values[item.path], item.unit)}" for item in searched.space.variables)
    return (
        f"no design keeps all conditions ({archive.count} tried, {archive.refused} cannot be built or have no steady "
        f"motion, {archive.breaking} break a condition); the nearest, {words}: {why}; allowed: wider ranges or looser "
        "conditions"
    )


def _answer(
    given: Robot,
    unknowns: Unknowns,
    searched: Evaluation,
    stated: Evaluation,
    best: Samples,
    archive: Archive,
    front: Samples | None,
) -> Design:
    space, objective = searched.space, searched.objectives[0]
    motion = stated.motion(best[None])
    own = stated.quantity(motion, objective.quantity.name)
    quantities, low, high = {}, {}, {}
    ends = [0.5 - 0.5 * LEVEL, 0.5 + 0.5 * LEVEL]
    for item in STEADY:
        column = stated.quantity(motion, item.name)[0]
        quantities[item.name] = float(np.mean(column))
        if not unknowns.known and np.all(np.isfinite(column)):
            low[item.name], high[item.name] = (float(end) for end in np.quantile(column, ends))
    uncertainty = None
    if not unknowns.known:
        uncertainty = Uncertainty(
            stated.samples.number,
            low,
            high,
            None if objective.target is None else _share(objective.target.excess(own[0]) <= 0, stated.samples.sets),
            _deciding(stated.samples.values, own[0]),
        )
    alternatives = [_alternative("today", None, stated, own[0], unknowns)]
    leading = best_apart(searched, archive, best, CONFIRMED)
    alternatives += [_alternative("runner_up", second, stated, own[0], unknowns) for second in leading[1:2]]
    value = float(objective.of(own)[0])
    profiles = tuple(profile_of(searched, best, number) for number in range(space.size))
    bound_by = bound_by_of(stated, best, profiles)
    return Design(
        robot=_built(given, space, best),
        today=given,
        model=searched.model.name,
        objectives=searched.objectives,
        conditions=tuple(item.words for item in searched.conditions),
        values=space.named(best),
        units={variable.path: variable.unit for variable in space.variables},
        objective=value,
        quantities=quantities,
        uncertainty=uncertainty,
        alternatives=tuple(alternatives),
        profiles=profiles,
        front=None if front is None else _columns_of(searched, front),
        searched=searched,
        bound_by=bound_by,
        swum=archive.count,
        refused=archive.refused,
        breaking=archive.breaking,
        warnings=_warnings(given, unknowns, stated, best, motion, bound_by),
        leading=tuple(leading),
    )


def _share(flags: Flags, sets: int) -> tuple[float, float, float]:
    """A probability with its 95 % interval."""
    # From sets that fill the ranges evenly, by Student's t over their means, for such sets are surer than as many
    # independent draws (Owen 1997). From independent draws, and where all sets agree, by Clopper and Pearson 1934.
    from scipy.stats import binomtest, t

    share = float(np.mean(flags))
    means = flags.reshape(sets, -1).mean(axis=1)
    if sets > 1 and np.ptp(means) > 0:
        half = float(t.ppf(0.5 + 0.5 * LEVEL, sets - 1) * means.std(ddof=1) / np.sqrt(sets))
        return share, max(share - half, 0.0), min(share + half, 1.0)
    found = binomtest(int(np.count_nonzero(flags)), flags.size).proportion_ci(LEVEL, method="exact")
    return share, float(found.low), float(found.high)


def _deciding(unknowns: Mapping[str, Samples], values: Samples) -> dict[str, float]:
    """Squared rank correlation (Spearman 1904) of every unknown with the objective's quantity."""
    from scipy.stats import rankdata

    with np.errstate(divide="ignore", invalid="ignore"):
        table = np.corrcoef([rankdata(column) for column in (values, *unknowns.values())])
    shares = dict(zip(unknowns, np.nan_to_num(table[0, 1:] ** 2).tolist(), strict=True))
    return dict(sorted(shares.items(), key=lambda item: -item[1]))


def _alternative(
    name: str, shares: Samples | None, stated: Evaluation, best: Samples, unknowns: Unknowns
) -> Alternative:
    """Compare a design, or the robot as it is, with the best one draw by draw."""
    objective, space = stated.objectives[0], stated.space
    motion = stated.motion(None if shares is None else shares[None])
    values = stated.quantity(motion, objective.quantity.name)[0]
    if objective.target is None:
        better = objective.sign * (best - values) > 0
    else:
        better = (objective.target.excess(best) <= 0) & ~(objective.target.excess(values) <= 0)
    share = _share(better, stated.samples.sets) if not unknowns.known else (float(np.mean(better)),) * 3
    buildable = all_hold(stated.limits(None if shares is None else shares[None]))
    return Alternative(
        name,
        space.named(shares) if shares is not None else space.today,
        float(objective.of(values[None])[0]),
        *share,
        keeps=bool(np.all(buildable)) and float(stated.broken(motion)[0]) <= 0,
    )


def _columns_of(searched: Evaluation, shares: Samples) -> dict[str, Samples]:
    """Fields and both objectives of designs."""
    values = searched.scores(shares).values
    found = dict(zip((item.path for item in searched.space.variables), searched.space.values(shares).T, strict=True))
    return found | {item.name: values[n] for n, item in enumerate(searched.objectives)}


def _built(given: Robot, space: Space, best: Samples) -> Robot:
    """The robot with the best values of its fields."""
    found = with_numbers(given, {path: float(column[0]) for path, column in space.columns(best[None]).items()})
    return found.model_copy(update={"name": f"{given.name}-design"})


def _warnings(
    given: Robot, unknowns: Unknowns, stated: Evaluation, best: Samples, motion: Swimming, bound_by: Sequence[str]
) -> tuple[Note, ...]:
    """Cautions of the design."""
    found = list(given.warnings)
    known, built = unknowns.robot, _built(unknowns.robot, stated.space, best)
    if given.channel is not None and stated.model.name == "tube":
        gap = gap_of(Placement(), given.body.diameter, 0.5 * given.channel.diameter)
        found.append(Note.named("reference-pose-of-designs", gap=1000.0 * gap))
    elif given.channel is not None and stated.model.name in known.calibration:
        found.append(Note.named("one-calibration-for-all"))
    elif given.channel is not None:
        found.append(Note.named("designs-without-walls"))
    if stated.model.name in known.calibration:
        found += calibration_warnings(built, stated.model.name)
    reading = find_friction_model(given.friction.reading)
    if not {"friction.effective", "friction", "shared_friction"} & set(stated.samples.values):
        found += drive_warnings(known, stated.model, reading, motion, stated.tail_rate)
    found += unknowns.fit.answer_warnings(known, stated.model, reading, stated.tail_rate)
    found += _near_step_out(built, motion)
    limits = reynolds_limits(stated.samples.batch, motion.reynolds_number, motion.tail_reynolds_number)
    found += [limit.caution() for limit in broken(stated.model.cautions(stated.space.batch(best[None])))]
    found += reynolds_warnings(limits).values()
    if any("end of its range" in words for words in bound_by):
        found.append(Note.named("end-of-a-range"))
    return tuple(dict.fromkeys(found))


def _near_step_out(robot: Robot, motion: Swimming) -> list[Note]:
    """That the best design hardly follows its field: it is the fastest just before it slips."""
    if robot.magnetic is None:
        return []
    share = abs(robot.magnetic.rotation_rate) / float(np.min(np.abs(motion.step_out_rate)))
    if not share > _MOST_OF_STEP_OUT:
        return []
    room = show(1.2 * abs(robot.magnetic.rotation_rate), "Hz")
    return [Note.named("design-near-step-out", share=100 * share, room=room)]
