"""Calibrations, rankings of models, suggestions of measurements, observations."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import starmap

from rich.markup import escape

from spirillum.calibration.fit_warnings import CALLED
from spirillum.cli.tables.parts import Answer, Blocks, Detail, grid, reason_of
from spirillum.display import counted, percent
from spirillum.units import display_unit, in_unit


def calibration(answer: Answer) -> Blocks:
    """Fitted numbers of `calibrate`."""
    counts = f"{counted(answer['rows'], 'row')} of {counted(answer['robots'], 'robot')}"
    yield f"{answer['observations']}{_synthetic(answer)}: {counts}, model {answer['model']}, method {answer['method']}"
    friction = _friction_by_name(answer)
    named = answer["parameters"] | friction
    named |= {f"model discrepancy, {CALLED[name]}": item for name, item in answer["discrepancy"].items()}
    known = {name: item for name, item in answer["error_of_a_trial"].items() if item["value"] is not None}
    named |= {f"error of a trial, {CALLED[name]}": item for name, item in known.items()}
    yield grid("", "parameter", "value", "low", "high", "unit", rows=starmap(_numbers, named.items()))
    if answer["discrepancy"]:
        typical = "what the fit leaves, or a typical one; one tail cannot tell it from wrong fixed numbers"
        misses = "by how much the model misses the mean of a tail, as a standard deviation"
        yield f"model discrepancy: {typical if answer['robots'] == 1 else misses}"
    if friction:
        yield from _friction(answer)
    if answer["method"] != "paper":
        yield Detail("low and high: 95 % interval")
    if "sampler" in answer:
        sampler = answer["sampler"]
        worst, fewest = max(sampler["r_hat"].values()), min(sampler["effective_draws"].values())
        yield Detail(f"sampler: R-hat at most {worst:.3f}, at least {fewest:.0f} effective draws")
    yield from reason_of(answer)
    yield f"{len(answer['files'])} files in {answer['folder']}, among them calibration.toml"


def _synthetic(answer: Answer) -> str:
    return " (synthetic)" if answer["synthetic"] else ""


def _numbers(name: str, item: Answer) -> tuple[str, ...]:
    """A fitted number with its interval; shares in per cent."""
    share = name.startswith(("model discrepancy", "error"))
    unit = "%" if share else display_unit(item["value"], item["unit"])
    numbers = []
    for key in ("value", "low", "high"):
        value = item.get(key)
        factor, shown = (100.0, item["unit"]) if share else (1.0, unit)
        numbers.append("-" if value is None else in_unit(factor * value, item["unit"], shown))
    return escape(name), *numbers, "" if unit == "1" else unit


_MATTERS = 0.1  # relative change of B_eff over that of a constant, from which on the constant is named


def _friction_by_name(answer: Answer) -> dict[str, Answer]:
    """The effective friction of a tail, or the least and the greatest of several."""
    every = (tail["effective_friction"] for tail in answer["tails"] if "effective_friction" in tail)
    found = sorted((item for item in every if item["value"] is not None), key=lambda item: float(item["value"]))
    if len(found) < 2:
        return dict(zip(["B_eff"], found, strict=False))
    return {f"B_eff, least of {len(found)} tails": found[0], "B_eff, greatest of them": found[-1]}


def _friction(answer: Answer) -> Iterator[str | Detail]:
    """Definition of the effective friction, and assumptions of its interval."""
    yield (
        f"B_eff: effective rotary friction, eq. (18), friction model {answer['friction']}; tail by tail in "
        "predictions.csv"
    )
    changes = answer.get("effective_friction_exact", {})
    exact = [
        f"{field} (1 % more: {by['value']:+.2g} %)" for field, by in changes.items() if abs(by["value"]) > _MATTERS
    ]
    if exact:
        yield f"B_eff takes as exact: {', '.join(exact)}; --assume-uncertainty includes theirs"
    if answer.get("effective_friction_statement"):
        yield Detail(answer["effective_friction_statement"])


def model_ranking(answer: Answer) -> Blocks:
    """Models by how well they predict left-out tails."""
    counts = f"{counted(len(answer['models']), 'model')}, {counted(answer['robots'], 'robot')}"
    yield f"{answer['observations']}{_synthetic(answer)}: {counts}"
    compared = [name for name in CALLED if any(name in item["discrepancy"] for item in answer["models"])]
    rows = grid("", "model", "log density", "difference", *(f"misses {CALLED[name]} by" for name in compared))
    for item in answer["models"]:
        one = answer["robots"] == 1  # a single tail does not tell by how much a model misses others
        misses = [None if one else item["discrepancy"].get(name) for name in compared]
        shares = ["-" if miss is None else percent(miss["value"]) for miss in misses]
        density = f"{item['expected_log_density']['value']:.1f}"
        rows.add_row(item["model"], density, _apart(item["difference"]), *shares)
    yield rows
    yield answer["verdict"]
    yield from reason_of({"model": ", ".join(item["model"] for item in answer["models"]), **answer})
    yield from (Detail(_failures(item)) for item in answer["models"])


_STANDS_OUT = 2.5  # standard deviations below which the worst of some tens of means is as far off as chance makes it


def _failures(item: Answer) -> str:
    """Where a model fails, on the scale of what its own fit expects of a tail."""
    rows = item["fails_most_at"]
    places = [
        f"{row['tail']} ({CALLED[row['quantity']]}: observed "
        f"{100 * (row['observed_over_predicted']['value'] - 1):+.0f} %, "
        f"{abs(row['standard_deviations']['value']):.1f} standard deviations)"
        for row in rows
    ]
    largest = max((abs(row["standard_deviations"]["value"]) for row in rows), default=0.0)
    words = f"{item['model']} is furthest off at {'; '.join(places)}"
    return f"{words}: no tail stands out from what it misses everywhere" if largest < _STANDS_OUT else words


def _apart(difference: Answer) -> str:
    """A difference with its standard error; a dash for that of the best model, and for an error that is withheld."""
    if difference["value"] == 0:
        return "-"
    error = difference["standard_error"]
    return f"{difference['value']:.1f} (error: -)" if error is None else f"{difference['value']:.1f} +- {error:.1f}"


def suggestion(answer: Answer, rows: int = 10) -> Blocks:
    """Candidates of `suggest`, the most informative first."""
    what = f"what {answer['trials']} trials of one more tail would decide"
    motion = "" if answer.get("answer", "held") == "held" else f", as {answer['answer']}"
    yield f"{answer['posterior']}, model {answer['model']}{motion}: {what}"
    found = grid("", "channel (mm)", "tail (mm)", "information (bit)", "behind the first (bit)", "narrows most")
    first = answer["candidates"][0]
    for item in answer["candidates"][:rows]:
        channel, *tail = [f"{1e3 * item[n]['value']:g}" for n in ("channel_diameter", "wavelength", "amplitude")]
        name, share = min(item["narrowing"].items(), key=lambda pair: pair[1]["value"])
        words = name.replace("_", " ").replace("[", " [")  # wraps between words
        remark = f"{words} to {100 * share['value']:.0f} %"
        behind = item["behind_the_best"]
        apart = "-" if item is first else f"{behind['value']:.3f} +- {behind['standard_error']:.2g}"
        information = f"{item['expected_information']['value']:.3f}"
        found.add_row(channel, " x ".join(tail), information, apart, escape(remark))
    yield found
    yield from reason_of(answer)
    tied = sum(item["tied_with_the_best"] for item in answer["candidates"]) - 1
    if tied > 0:
        others = "1 other is" if tied == 1 else f"{tied} others are"
        yield f"a tie: {others} within two standard errors of the first, which the draws do not distinguish"


def observations(answer: Answer) -> Blocks:
    """Text of `observations check`."""
    rows, tails, channels = (counted(answer[name], name[:-1]) for name in ("rows", "tails", "channels"))
    yield f"{answer['file']}: valid, {rows} of {tails} in {channels}"
    yield f"measured: {', '.join(f'{name} {count}' for name, count in answer['measured'].items())}"
