"""Which model explains the observations best, by how well it predicts tails that it was not fitted to.

Every model is fitted to the same observations. Leave-one-out accuracy asks for the log density of one robot's means
given all others (Vehtari, Gelman and Gabry, Stat. Comput. 27:1413, 2017): Pareto-smoothed importance sampling takes it
from one posterior, without fitting anew, and says where that fails. One robot is one point, since the model's
discrepancy is a robot's own.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.answer_entries import answer_of, content_of
from spirillum.arrays import Samples
from spirillum.calibration.calibrated import Calibrated, posterior_tree
from spirillum.calibration.fit import RobotSource, fit_model
from spirillum.calibration.fit_warnings import RATES_IN_RADIANS, inertia_warnings, synthetic_warning
from spirillum.calibration.parameters import DEFAULT_FREE, PARAMETERS, free_names, listed_names
from spirillum.calibration.posterior import Sampling
from spirillum.calibration.problem import UnexplainedError
from spirillum.display import DisplayMixin, counted
from spirillum.envelope import quantity
from spirillum.errors import InputError, check_choice
from spirillum.fluid.registry import find_swimmer_model
from spirillum.notes import Note
from spirillum.optional_dependencies import import_optional
from spirillum.progress import Progress
from spirillum.robot.load import PAPER_ROBOTS, PAPER_ROBOTS_TAKEN
from spirillum.swimming.motions import HELD, RELEASED
from spirillum.swimming.preparation import WALLED

_CLEAR = 4.0  # difference of the log density, over its standard error, from which a model is better without doubt
_PARETO = 0.7  # largest shape of the importance weights' tail at which leaving a robot out can be trusted
_MOST_BAD = 0.5  # share of the robots with a larger one above which no model is named the better
_FEWEST_ROBOTS = 4  # below that number a standard error over the robots is chance, and no model is named the better
_MANY_ROBOTS = 10  # below that number the standard error itself is hardly known
_WORST = 3
_MODELS = ("sbt", "rft")
_PAPERS_MODELS = "none is named, and the paper compares these two"
_FREE = "body_drag,body_rotation"
_FREE_IN_TUBE = "gap,pitch"
_FREE_IN_TRIAL = "friction_coefficient,roughness"
"""Two numbers for each channel in every model: else one would be praised for its freedom in what another was denied."""


@dataclass(frozen=True)
class ModelRank:
    """The rank of one model."""

    model: str
    elpd: float  #: Expected log density of one left-out robot after another, summed.
    standard_error: float
    difference: float  #: Of elpd to the best model; 0 for it.
    difference_error: float  #: Standard error of the difference, over the robots.
    pareto: Samples  #: Shape of the importance weights' tail, robot by robot.
    pointwise: Samples  #: Contribution of each robot.
    fit: Calibrated


@dataclass(frozen=True, repr=False)
class Ranking(DisplayMixin):
    """Models from the best to the worst."""

    ranked: tuple[ModelRank, ...]
    warnings: tuple[Note, ...]
    model_reason: str = ""  #: Why these models were ranked; empty where they were named.

    def __repr__(self) -> str:
        """The models in their order."""
        return f"Ranking({', '.join(item.model for item in self.ranked)})"

    @property
    def best(self) -> ModelRank:
        """The model that predicts left-out robots best."""
        return self.ranked[0]

    @property
    def enough(self) -> bool:
        """Whether there are robots enough for a standard error over them."""
        return self.best.pointwise.size >= _FEWEST_ROBOTS

    @property
    def trusted(self) -> bool:
        """Whether, for the two best models, most robots can be left out by importance sampling."""
        return all(float(np.mean(item.pareto > _PARETO)) <= _MOST_BAD for item in self.ranked[:2])

    @property
    def clear(self) -> bool:
        """Whether the best is better than the second beyond doubt."""
        second = self.ranked[1] if len(self.ranked) > 1 else None
        if not (self.enough and self.trusted):
            return False
        return second is not None and -second.difference > _CLEAR * second.difference_error

    def verdict(self) -> str:
        """The ranking in a sentence."""
        names = [item.model for item in self.ranked]
        if len(names) == 1:
            return f"only {names[0]} was fitted"
        second = self.ranked[1]
        if not self.enough:
            count = self.best.pointwise.size
            few = "1 tail is" if count == 1 else f"{count} tails are"
            return f"{few} too few to distinguish {names[0]} from {names[1]}; at least {_FEWEST_ROBOTS} are needed"
        if not self.trusted:
            return (
                f"{names[0]} and {names[1]} are not ranked: leaving out most of the {self.best.pointwise.size} robots "
                f"cannot be trusted (Pareto k above {_PARETO:g}); more robots, or fewer free parameters, would decide"
            )
        how = f"by {-second.difference:.1f} +- {second.difference_error:.1f} in log density"
        if self.clear:
            return f"{names[0]} predicts left-out tails better than {names[1]}, {how}"
        return f"{names[0]} and {names[1]} cannot be distinguished: {how} in favour of {names[0]}"

    def failures(self, item: ModelRank) -> list[dict[str, Any]]:
        """Where a model fails: robots with the largest misfit, relative to what the fit expects of a robot."""
        experiment = item.fit.experiment
        found: list[dict[str, Any]] = []
        for name, (values, low, high) in item.fit.predicted.items():
            seen = item.fit.problem.ratio(name).mean
            spread = np.abs(high - low) / (2.0 * 1.96)
            off = (seen - values) / spread * np.sign(values)  # positive where more was observed
            found += [
                {
                    "tail": experiment.labels()[place],
                    "quantity": name,
                    "observed_over_predicted": quantity(float(seen[place] / values[place]), "1"),
                    "standard_deviations": quantity(float(off[place]), "1"),
                }
                for place in range(experiment.size)
                if np.isfinite(off[place])
            ]
        return sorted(found, key=lambda row: -abs(row["standard_deviations"]["value"]))[:_WORST]

    def to_dict(self) -> dict[str, Any]:
        """The answer of `spirillum rank-models --json`."""
        models = [
            content_of(
                item,
                own_error=item.standard_error if self.enough else None,
                apart_error=item.difference_error if self.enough else None,
                discrepancy={name: v.value for name, v in item.fit.discrepancy.items()},
                parameters={
                    c.label: item.fit.values[c.label].quantity(c.parameter.unit) for c in item.fit.problem.coordinates
                },
                failures=self.failures(item),
            )
            for item in self.ranked
        ]
        return answer_of(self, models=models)


def rank_models(
    observations: str | Path,
    robots: RobotSource | Sequence[RobotSource] | None = None,
    *,
    models: Sequence[str] | None = None,
    free: str | Sequence[str] | None = None,
    sampling: Sampling | None = None,
    prepare: bool = False,
    answer: str = HELD,
    progress: Progress | None = None,
) -> Ranking:
    """Fit several models to the same observations and rank them by leave-one-out accuracy.

    Args:
        observations: observations file.
        robots: a robot for each channel; None: the paper's two.
        models: `sbt`, `rft`, `slender` or `tube`; None: `sbt` and `rft`, the paper's own question.
        free: free parameters of every model; None: body_drag,body_rotation, for `tube` gap,pitch.
        sampling: how the posteriors are sampled.
        prepare: compute missing tables of the model `tube`, minutes for each.
        answer: what `tube` is fitted as: `held`, or `trial` (two numbers: friction coefficient and roughness).
        progress: called with stage, number done, and total.

    Raises:
        InputError: for wrong input, a single model, or observations that none of the models explains.
    """
    check_choice("answer", answer, (HELD, RELEASED))
    wanted = free_by_model(models, free, answer)
    if answer == RELEASED and WALLED not in wanted:
        raise InputError(
            f"answer = 'trial' without model '{WALLED}', of which it is; allowed: with it among the models"
        )
    if prepare and "tube" not in wanted:
        raise InputError(
            f"prepare with models {', '.join(wanted)}, which take no tables; allowed: with 'tube' among them"
        )
    fits: dict[str, Calibrated] = {}
    failed: list[UnexplainedError] = []
    said = [] if robots is not None else [PAPER_ROBOTS_TAKEN]
    for name, names in wanted.items():
        try:
            fits[name] = fit_model(
                observations,
                PAPER_ROBOTS if robots is None else robots,
                model=name,
                free=names,
                method="posterior",
                sampling=sampling,
                prepare=prepare and name == "tube",
                answer=answer if name == WALLED else HELD,
                progress=progress,
            )
        except UnexplainedError as error:
            failed.append(error)
            said.append(Note.named("model-not-ranked", model=name, why=str(error).partition(";")[0]))
    if not fits:
        raise failed[0]
    found = ranked_fits(fits)
    reason = "" if models else _PAPERS_MODELS
    return replace(found, warnings=(*said, *found.warnings), model_reason=reason)


def free_by_model(
    models: Sequence[str] | None, free: str | Sequence[str] | None, answer: str = HELD
) -> dict[str, tuple[str, ...]]:
    """Models that are ranked, each with its free parameters."""
    names = list(dict.fromkeys(models or _MODELS))
    for name in names:
        find_swimmer_model(name)
    if len(names) < 2:
        raise InputError(f"models = {', '.join(names)}; allowed: at least two models to rank")
    if free:
        _check_common(names, free)
    in_tube = _FREE_IN_TRIAL if answer == RELEASED else _FREE_IN_TUBE
    wanted = {name: free or (in_tube if name == WALLED else _FREE) for name in names}
    return {
        name: free_names(wanted[name], find_swimmer_model(name).name, released=answer == RELEASED) for name in names
    }


def _check_common(models: Sequence[str], free: str | Sequence[str]) -> None:
    """Refuse models that have no common set of free numbers: the freer one would win by its freedom."""
    listed = listed_names(free)
    for model in models:
        lacking = [name for name in listed if name in PARAMETERS and model not in PARAMETERS[name].models]
        if lacking and model in DEFAULT_FREE:
            known = [PARAMETERS[name].models for name in listed if name in PARAMETERS]
            able = [name for name in DEFAULT_FREE if all(name in having for having in known)]
            raise InputError(
                f"models = {', '.join(models)}: '{model}' has no {lacking[0]} to fit, and models are ranked with the "
                f"same free numbers ({', '.join(listed)}); allowed: {', '.join(able) or 'other free numbers'}"
            )


def ranked_fits(fits: dict[str, Calibrated]) -> Ranking:
    """Rank models whose posteriors are of the same observations."""
    import_optional("arviz_stats", "a ranking of models", "posterior")
    from arviz_stats import compare, loo

    found = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # reported below as notes
        for name, fit in fits.items():
            found[name] = loo(posterior_tree(fit), pointwise=True, var_name="robot")
        order = [str(name) for name in compare(found).index] if len(found) > 1 else list(found)
    best = np.asarray(found[order[0]].elpd_i).reshape(-1)
    ranked = []
    for name in order:
        each = np.asarray(found[name].elpd_i).reshape(-1)
        gap = each - best
        ranked.append(
            ModelRank(
                model=name,
                elpd=float(found[name].elpd),
                standard_error=float(found[name].se),
                difference=float(gap.sum()),
                difference_error=float(np.sqrt(gap.size * np.var(gap))),
                pareto=np.asarray(found[name].pareto_k).reshape(-1),
                pointwise=each,
                fit=fits[name],
            )
        )
    return Ranking(tuple(ranked), tuple(_cautions(ranked)))


def _cautions(ranked: Sequence[ModelRank]) -> list[Note]:
    said = []
    for item in ranked:
        bad = int(np.count_nonzero(item.pareto > _PARETO))
        if bad:
            which = "it decides" if bad == 1 else "each of them decides"
            of = {"bad": bad, "robots": item.pareto.size, "limit": _PARETO}
            said.append(Note.named("robots-decide", model=item.model, which=which, **of))
        unusable = (note for note in item.fit.warnings if note.code == "posterior-unusable")
        said += [note.prefixed(f"{item.model}: ") for note in unusable]
    if all(RATES_IN_RADIANS in item.fit.warnings for item in ranked):
        said.append(RATES_IN_RADIANS)
    count = ranked[0].fit.experiment.size
    if count < _FEWEST_ROBOTS:
        said.append(Note.named("too-few-to-rank", robots=counted(count, "robot"), fewest=_FEWEST_ROBOTS))
    elif count < _MANY_ROBOTS:
        said.append(Note.named("few-to-rank", count=count))
    said += inertia_warnings(ranked[0].fit.experiment)
    if ranked[0].fit.experiment.synthetic:
        said.append(synthetic_warning(ranked[0].fit.experiment.source))
    return said
