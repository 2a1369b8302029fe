"""Which robot of a study is best: fastest, most efficient, with the least current, and how surely.

One model and one friction model rank all robots: the model that computes the channel's walls where the study
has one, else the first that solves for the flow, else its first; the reading that the robots have themselves where the
study has it. Robots that are released too (`settled`) are ordered by their speed in steady motion, and where that model
leaves the channel's walls out, by their speed held at a pose by `tube` if all of them have it. Bands and intervals are
those of the study. A band goes over poses that robots may share, such as a gap: at how many of them the fastest
robot is the fastest is more informative than how far the bands overlap.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from spirillum.answer_entries import content_of
from spirillum.arrays import Values
from spirillum.display import counted, percent
from spirillum.envelope import quantity
from spirillum.fluid.registry import SWIMMER_MODELS
from spirillum.quantities import unit_of
from spirillum.swimming.motions import ASSUMPTION
from spirillum.units import display_unit, in_unit, show

if TYPE_CHECKING:
    import xarray as xr

_ALIKE = 0.01
_EQUAL = 1e-9  # relative difference up to which two robots have one value: rounding
_NAMED = 3  # robots that are named where several are equal
_MOST = 1000  # robots in an answer


class QuantityRanking(NamedTuple):
    """How a quantity ranks robots."""

    title: str  #: Its name in tables and figures.
    superlative: str  #: What the best robot is by it.
    sign: float  #: 1 where the largest value is the best, -1 where the least is.

    def heading(self, unit: str) -> str:
        """Title and unit of a column or an axis."""
        return f"{self.title}, {unit}".removesuffix(", 1")


STEADY_SPEED = "forward_velocity_settled"  #: The speed in steady motion after release.
HELD, TRIAL = "forward_velocity_held", "forward_velocity_trial"  #: Speeds by `tube` beside other models.
_BESIDE = (HELD, TRIAL, STEADY_SPEED)  # speeds beside that of a model, where the study has them
RANKED = {
    "forward_velocity": QuantityRanking("speed", "fastest", 1.0),
    HELD: QuantityRanking("tube", "fastest at a fixed pose by tube", 1.0),
    TRIAL: QuantityRanking("trial", "fastest in a trial", 1.0),
    STEADY_SPEED: QuantityRanking("steady", "fastest once settled", 1.0),
    "hydrodynamic_efficiency": QuantityRanking("efficiency", "most efficient", 1.0),
    "motor_current": QuantityRanking("current", "least current", -1.0),
    "shaft_power": QuantityRanking("power", "least power", -1.0),
}
"""Quantities that rank robots, in the order in which they are shown."""
SETTLED_BASIS = (
    "steady: by model tube, after release, in the steady state; all else: by the model above, at a fixed pose"
)
"""Assumptions of the speed after release that the other quantities do not share."""
BASIS = {STEADY_SPEED: SETTLED_BASIS, HELD: "tube: the channel's walls computed, at a fixed pose"}
"""Assumptions of the speed that orders the robots, where it is not that of the ranking's model."""
ENDS = {"band": "over the gaps and pitches that are not given", "interval": "95 % interval"}
"""What low and high are, by the kind of a ranking."""


def unit_of_ranked(name: str) -> str:
    """SI unit of a quantity that ranks robots."""
    return unit_of("forward_velocity" if name in _BESIDE else name)


def ranked_as(name: str, lead: str, model: str) -> QuantityRanking:
    """Return how a quantity ranks robots; a model's own speed has its name where that of `tube` leads."""
    if (name, lead) == ("forward_velocity", HELD):
        return QuantityRanking(model, f"fastest by {model}, walls not computed", 1.0)
    return RANKED[name]


class RankedRobot(NamedTuple):
    """A robot of a study with the quantities that rank it, SI; NaN for what does not apply."""

    name: str
    place: int  #: Its index in the flat order of the study.
    values: Mapping[str, float]
    low: Mapping[str, float]  #: Least values of bands or lower limits of intervals; NaN without one.
    high: Mapping[str, float]
    error: Mapping[str, float]  #: Stated errors of the model in each of them, relative; NaN where none is stated.

    def to_dict(self) -> dict[str, Any]:
        """As in JSON."""
        ends = {
            name: {"low": self.low[name], "high": self.high[name]} if np.isfinite(self.low[name]) else {}
            for name in self.values
        }
        return {
            "robot": self.name,
            **{name: quantity(value, unit_of_ranked(name), **ends[name]) for name, value in self.values.items()},
        }


class Best(NamedTuple):
    """The best robot by one quantity."""

    what: str  #: `fastest`, `most efficient`, `least current` or `least power`.
    quantity: str
    robot: RankedRobot
    places: int  #: Number of poses, the reference pose one of them, at which it is the best; 0 without a band.
    of_places: int  #: Number of poses at which the robots have answers.
    spread: float  #: Largest less least value of all robots, over the best one's; infinite where no other has a value.
    known: int
    robots: int
    ties: tuple[str, ...] = ()  #: Names of the other robots that have the same value, to rounding.
    lead: float = np.nan  #: Its lead on the next one, over its own value; NaN where it is alone.
    error: float = np.nan  #: Stated error of the model between these two, relative; NaN where none is stated.
    within: tuple[str, ...] = ()  #: Names of the robots that it leads by less than the error between both.

    @property
    def alike(self) -> bool:
        """Whether there are several robots, and the quantity hardly differs between them."""
        return self.spread < _ALIKE

    def to_dict(self) -> dict[str, Any]:
        """As in JSON."""
        return content_of(self)


@dataclass(frozen=True)
class StudyRanking:
    """The robots of a study, the fastest first."""

    model: str
    friction: str
    walls: bool  #: Whether the walls of a channel that robots are in are left out.
    held: bool  #: Whether they are ordered by the speed held at a pose in a tube, where released robots swim otherwise.
    kind: str  #: What low and high are: `band`, `interval`, or empty where there are none.
    robots: tuple[RankedRobot, ...]  #: Robots that have an answer, the fastest first.
    best: tuple[Best, ...]  #: The best of them by each quantity.

    @property
    def message(self) -> str:
        """The ranking in a sentence."""
        if not self.robots:
            return "no robot has an answer"
        first = self.robots[0]
        by = self.lead if np.isfinite(first.values[self.lead]) else "forward_velocity"
        speed, low, high = (of[by] for of in (first.values, first.low, first.high))
        shown = self.unit(by)
        band = f" ({in_unit(low, 'm/s', shown)} to {in_unit(high, 'm/s', shown)})" if np.isfinite(low) else ""
        size = f"{in_unit(speed, 'm/s', shown)} {shown}{band}"
        return best_in_words(next(best for best in self.best if best.quantity == by).to_dict(), size, held=self.held)

    def unit(self, name: str) -> str:
        """The unit in which people read a quantity: one for all speeds, as in the columns."""
        own = unit_of_ranked(name)
        sizes = [
            abs(robot.values[other]) for robot in self.robots for other in robot.values if unit_of_ranked(other) == own
        ]
        return display_unit(max((size for size in sizes if np.isfinite(size)), default=0.0), own)

    @property
    def lead(self) -> str:
        """Name of the speed by which robots are ordered."""
        return next(iter(self.quantities), "forward_velocity")

    def heading(self, name: str, unit: str) -> str:
        """Title and unit of the column or axis of a quantity."""
        return ranked_as(name, self.lead, self.model).heading(unit)

    @property
    def basis(self) -> str:
        """Assumptions of that speed, where it is not that of the model; else empty."""
        return BASIS.get(self.lead, "")

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of the quantities."""
        return tuple(self.robots[0].values) if self.robots else ()

    def to_dict(self) -> dict[str, Any]:
        """As in JSON; at most a thousand robots."""
        basis = self.basis if self.lead == STEADY_SPEED else ""
        return content_of(self, ends=self.kind or "none", basis=basis, first=self.robots[:_MOST])


_AT_A_POSE = " at a fixed pose"
_AFTER_THE_LEAD = {TRIAL: -1, HELD: 1}  # what the lab shows next, of some robots alone last


def order_in_words(lead: str, *, held: bool) -> str:
    """Return by which speed robots are ordered."""
    return f"{RANKED[lead].superlative}{_AT_A_POSE if held else ''} first"


def ranked_columns(
    robots: Sequence[Mapping[str, Any]], name: str, model: str, *, wide: bool
) -> list[tuple[str, list[str]]]:
    """Titles and cells of a quantity of ranked robots, with its band: in brackets, or not `wide` in columns."""
    own = robots[0][name]["unit"]
    if not any(item[name]["value"] for item in robots):
        return []
    alike = [other for other in robots[0] if other != "robot" and robots[0][other]["unit"] == own]  # speeds: one unit
    shown = display_unit(max(abs(item[other]["value"] or 0.0) for item in robots for other in alike), own)
    ends = [end for end in ("low", "high") if any(end in item[name] for item in robots)]
    columns = [[in_unit(item[name].get(end), own, shown) for item in robots] for end in ("value", *ends)]
    _, lead, *_ = robots[0]
    title = ranked_as(name, lead, model).heading(shown)
    if wide and ends:
        values = [one if low == "-" else f"{one} ({low} to {high})" for one, low, high in zip(*columns, strict=True)]
        return [(title, values)]
    if name != "forward_velocity" or STEADY_SPEED in robots[0]:  # else the table is wider than a terminal
        ends = []
    return list(zip([title, *ends], columns, strict=False))


def best_in_words(best: Mapping[str, Any], size: str = "", *, held: bool = False) -> str:
    """Return which robot is the best by a quantity, and how surely; `held` is said of the model's own speed."""
    what = f"{best['what']}{_AT_A_POSE if held and best['quantity'] == 'forward_velocity' else ''}"
    if best["alike"]:
        alike = f"no difference that counts (all within {100 * best['spread']['value']:.1g} %)"
        return f"{what}: {', '.join(filter(None, (size, alike)))}"
    sure = f"at {best['places']} of {best['of_places']} poses" if "places" in best else ""
    some = best["robots"] < best["of_robots"]
    among = f"among {best['robots']} of {best['of_robots']} robots, the others have no such value" if some else ""
    ties = best.get("ties", [])
    more = f" and {len(ties) - _NAMED} more" if len(ties) > _NAMED else ""
    equal = f"no better than {'; '.join(ties[:_NAMED])}{more}" if ties else ""
    lead = "" if ties or "lead" not in best else _lead_in_words(best)
    return ", ".join(filter(None, (f"{what}: {best['robot']}", size, lead, equal, sure, among)))


def _lead_in_words(best: Mapping[str, Any]) -> str:
    """By how much the best robot leads, beside the error of the model between the two."""
    lead = f"the next is {percent(best['lead']['value'])} behind"
    if "model_error" not in best:
        return f"{lead} (no error is stated: {ASSUMPTION})" if best["quantity"] == TRIAL else lead
    within, error = best["within_error"], percent(best["model_error"]["value"])
    if not within:
        return f"{lead}, the model's error is {error}"
    more = f", as {counted(len(within) - 1, 'other')} {'is' if len(within) == 2 else 'are'}" if within[1:] else ""
    return f"{lead}, within the model's error of {error}{more}"


def can_be_ranked(dataset: xr.Dataset) -> bool:
    """Whether a dataset is a study with all its dimensions and the quantities that rank robots."""
    chosen, indexes = ("model", "friction"), dataset.indexes
    named = all(name in indexes and indexes[name].is_unique and dataset.sizes.get(name, 0) > 0 for name in chosen)
    over = {*chosen, *robot_dims(dataset)}
    return named and all(name in dataset and set(dataset[name].dims) == over for name in RANKED if name not in _BESIDE)


def robot_dims(dataset: xr.Dataset) -> tuple[str, ...]:
    """Dimensions over which the robots go, in the flat order of the study."""
    return ("robot",) if "robot" in dataset.dims else ("channel", "wavelength", "amplitude")


def ranking_of(dataset: xr.Dataset) -> StudyRanking:
    """The ranking of a study's robots."""
    settings = json.loads(str(dataset.attrs.get("settings", "{}")))
    robots = settings.get("robots", [])
    walled = any(robot.get("channel") for robot in robots)
    models, readings = ([str(name) for name in dataset[of].values] for of in ("model", "friction"))
    of_walls = [name for name in models if name in SWIMMER_MODELS and SWIMMER_MODELS[name].placed]
    solved = [name for name in models if name in SWIMMER_MODELS and not SWIMMER_MODELS[name].closed_form]
    model = (of_walls or solved or models)[0]
    own = [str((robot.get("friction") or {}).get("reading")) for robot in robots]
    reading = next((name for name in readings if name in own), readings[0])
    chosen = dataset.sel(model=model, friction=reading)
    names = list(_names(dataset))
    has_motor = bool(np.isfinite(chosen["motor_current"].values).any())
    known = ["forward_velocity", "hydrodynamic_efficiency", "motor_current" if has_motor else "shaft_power"]
    beside = [name for name in _BESIDE if name in chosen and bool(np.isfinite(chosen[name].values).any())]
    known[1:1] = [name for name in beside if name != STEADY_SPEED]
    answered = np.isfinite(_flat(chosen, "forward_velocity", names))
    if HELD in beside and bool(np.isfinite(_flat(chosen, HELD, names)[answered]).all()):
        known.insert(0, known.pop(known.index(HELD)))
    if STEADY_SPEED in beside:
        known.insert(0, STEADY_SPEED)
    values = {name: _flat(chosen, name, names) for name in known}
    values[known[-1]] = np.abs(values[known[-1]])  # a motor in the other sense of rotation draws no less
    low, high, kind = _ends(chosen, known, names)
    errors = {name: _stated_errors(chosen, name, len(names))[0] for name in known}
    order = np.argsort(-values["forward_velocity"], kind="stable")
    order = order[np.isfinite(values["forward_velocity"][order])]
    order = order[np.argsort(-values[known[0]][order], kind="stable")]  # NaN last, in their order
    ranked = {
        int(index): RankedRobot(
            names[index],
            int(index),
            *({name: float(of[name][index]) for name in known} for of in (values, low, high, errors)),
        )
        for index in order
    }
    judged = [known[0], *sorted(known[1:], key=lambda name: _AFTER_THE_LEAD.get(name, 0))]
    best = tuple(
        _best(chosen, name, values[name], ranked, ranked_as(name, known[0], model))
        for name in judged
        if np.isfinite(values[name][order]).any()
    )
    placed, settled = SWIMMER_MODELS[model].placed, STEADY_SPEED in beside
    held = walled and placed and not settled
    return StudyRanking(
        model, reading, walled and not placed, held, kind if ranked else "", tuple(ranked.values()), best
    )


def _names(dataset: xr.Dataset) -> Iterator[str]:
    """Names of the robots in the flat order of the study."""
    if "robot" in dataset.dims:
        yield from (str(name) for name in dataset["robot"].values)
        return
    several = dataset.sizes["channel"] > 1
    for channel in dataset["channel"].values:
        for wavelength in dataset["wavelength"].values:
            for amplitude in dataset["amplitude"].values:
                unit = "um" if float(wavelength) < 1e-4 else "mm"
                tail = f"{show(float(wavelength), unit).removesuffix(f' {unit}')} x {show(float(amplitude), unit)}"
                yield f"{channel}, {tail}" if several else tail


def _flat(chosen: xr.Dataset, name: str, names: list[str]) -> Values:
    return chosen[name].transpose(*robot_dims(chosen)).values.astype(float).reshape(len(names))


def _ends(chosen: xr.Dataset, known: list[str], names: list[str]) -> tuple[dict[str, Values], dict[str, Values], str]:
    """Ends of the band or of the interval of each quantity, and which of them they are."""
    found: list[dict[str, Values]] = []
    kind = ""
    for end in ("low", "high"):
        ends = {}
        for name in known:
            of = {"band": f"{name}_{end}", "interval": f"{name}_interval_{end}"}
            there = [
                word for word, item in of.items() if item in chosen and bool(np.isfinite(chosen[item].values).any())
            ]
            ends[name] = _flat(chosen, of[there[0]], names) if there else np.full(len(names), np.nan)
            kind = kind or (there[0] if there else "")
        found.append(ends)
    return found[0], found[1], kind


def _best(
    chosen: xr.Dataset, name: str, values: Values, ranked: Mapping[int, RankedRobot], by: QuantityRanking
) -> Best:
    _title, word, sign = by
    among = np.array(list(ranked))
    winner = int(among[np.nanargmax(sign * values[among])])
    finite = values[among][np.isfinite(values[among])]
    spread = float(np.ptp(finite) / max(abs(values[winner]), 1e-300)) if finite.size > 1 else np.inf
    near = np.abs(values[among] - values[winner]) <= _EQUAL * abs(values[winner])
    ties = tuple(ranked[int(place)].name for place in among[near] if place != winner)
    leads = sign * (values[winner] - values[among]) / max(abs(values[winner]), 1e-300)
    errors, alike = _stated_errors(chosen, name, values.size)
    between = errors[among] + (0.0 if alike else errors[winner])
    others = [n for n in np.argsort(leads, kind="stable") if among[n] != winner and np.isfinite(leads[n])]
    lead, error = (float(of[others[0]]) if others else np.nan for of in (leads, between))
    within = tuple(ranked[int(among[n])].name for n in others if leads[n] < between[n])
    wins, places = _wins(chosen, name, sign * values, winner, among)
    return Best(word, name, ranked[winner], wins, places, spread, finite.size, among.size, ties, lead, error, within)


def _wins(chosen: xr.Dataset, name: str, values: Values, winner: int, among: Values) -> tuple[int, int]:
    """At how many poses the winner is the best, and the number of poses with all answers; zeros without a band."""
    if (places := chosen.get(f"{name}_at_place")) is None:
        return 0, 0
    sign = RANKED[name].sign
    others = places.transpose(*robot_dims(chosen), ...).values.astype(float).reshape(values.size, -1)
    there = np.column_stack([values, sign * others])[among]
    there = there[:, np.isfinite(there).all(axis=0)]
    wins = int(np.count_nonzero(among[np.argmax(there, axis=0)] == winner)) if there.shape[1] else 0
    return wins, there.shape[1]


_ERRORS = {
    "forward_velocity": "error_estimate",
    **{name: name.replace("forward_velocity", "error_estimate") for name in _BESIDE},
}
"""Speeds that rank robots, and the variables with their errors."""


def _stated_errors(chosen: xr.Dataset, name: str, robots: int) -> tuple[Values, bool]:
    """Relative errors of a quantity of all robots, NaN where none is stated; whether it is one error of the model.

    Each robot's own, which are independent, or that which the model states of any robot's speed.
    """
    own = _ERRORS.get(name, "")
    if own in chosen and set(chosen[own].dims) == set(robot_dims(chosen)):
        found = chosen[own].transpose(*robot_dims(chosen)).values.astype(float).ravel()
        if np.isfinite(found).any():
            return found, False
    stated = SWIMMER_MODELS[str(chosen["model"].values)].known_speed_error if name == "forward_velocity" else None
    return np.full(robots, np.nan if stated is None else stated), True
