"""Motion: predicted, compared, simulated, swept, settled, controlled, and the flow around it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rich.table import Table

from spirillum.cli.tables.parts import (
    RELEASED,
    Answer,
    Blocks,
    Detail,
    answered_columns,
    band_grid,
    cell,
    columns_grid,
    error_of,
    files_of,
    friendly,
    grid,
    in_words,
    placement_of,
    quantity_grid,
    range_words,
    reason_of,
    released_columns,
    resting_pose,
    sentences_of,
    series_rows,
    unsteady,
)
from spirillum.display import error_words, fitted_words, rows_of, times
from spirillum.dynamics.run_summary import merged_events
from spirillum.envelope import quantity
from spirillum.quantities import QUANTITIES
from spirillum.swimming.motions import ASSUMPTION, END_STATES, headline
from spirillum.units import display_unit, in_unit, speed_unit


def prediction(answer: Answer, *, all_of_it: bool = False) -> Blocks:
    """The five quantities of `predict` that matter most, or all of them."""
    yield from unsteady(answer)
    calibrated = fitted_words(answer["calibrated"], answer.get("fitted_by", ""))
    free = ", free motion" if answer["motion"] == "free" else ""
    title = f"{answer['robot']}: model {answer['model']}, friction {answer['friction']}, {calibrated}{free}"
    only = None if all_of_it else headline(answer)
    banded = "band" in answer or "kind" in answer["forward_velocity"]
    released = answered_columns(answer)
    rows = (columns_grid if released else band_grid if banded else quantity_grid)(title, answer, only)
    yield rows
    more = len(rows_of(answer)) - rows.row_count
    if more:
        yield f"and {more} more quantities: --all"
    if "gap" in answer["placement"] and "steady_state" not in answer:
        yield _over_poses(answer, "held" if released else "value")
    if answer["forward_velocity"].get("kind") == "interval":
        level = f"{100 * answer['forward_velocity']['level']:g} % interval"
        yield f"{'held ' if released else ''}low and high: {level} of the posterior, {answer['interval_of']}"
    if "trial" in answer:
        yield from released_columns(answer, "; its interval: --interval")
    yield from _in_the_lab(answer, released)
    for item in answer.get("published", ()):
        yield _compare_with_published(item)
    yield from files_of(answer, plot="plot")
    yield from placement_of(answer["placement"], RELEASED if "steady_state" in answer else "placement")
    if "steady_state" in answer:
        yield from resting_pose(answer["steady_state"])
    yield from reason_of(answer)
    if "other_models" in answer:
        yield Detail(answer["other_models"]["statement"])
    yield from error_of(answer["error_estimate"])


def _in_the_lab(answer: Answer, released: Sequence[str]) -> Iterator[str]:
    """Which of the motions a robot has in an experiment; a fit of held robots says in its caution what to compare."""
    if any(note["code"] == "fit-other-motion" for note in answer["notes"]):
        return
    if "trial" in released:
        later = ", later as in steady" if "steady" in released else ""
        yield f"in the lab: a robot laid in its tube swims as in trial{later}; held is for a known gap and pitch"
    elif "band" in answer:
        yield "in the lab: a robot laid in its tube swims as in a trial or steady motion, mostly slower than at a pose"


def _over_poses(answer: Answer, column: str) -> str:
    """Return the pose of a value, and the range of poses of its band."""
    pose = answer["placement"]
    known = ", ".join(f"{name} {in_words(pose[name])}" for name in ("gap", "pitch") if name in pose)
    given = f"{column}: at a fixed pose ({known})"
    if "band" not in answer:
        return given
    ranges = ", ".join(f"{name} {range_words(pose[name])}" for name in ("gap", "pitch") if "low" in pose[name])
    ends = f"{column} low and high" if column == "held" else "low and high"
    return f"{given}; {ends}: extremes over {len(answer['band']['gap']['value'])} more: {ranges}"


def _compare_with_published(item: Answer) -> str:
    """A published number with ours in its unit, and their ratios."""
    paper = item["published"]
    unit = display_unit(paper["value"], paper["unit"])
    ours = ", ".join(
        f"{name} {cell(own, unit)} {unit} ({times(own['value'] / paper['value'])})"
        for name, own in item["ours"].items()
        if own["value"] is not None
    )
    published = f"published ({item['source']}): {item['case']}: {cell(paper, unit)} {unit}"
    return f"{published}; here: {ours}; {item['remark']}"


_LEFT_OUT = ("propulsive_power", "overall_efficiency", "cost_of_transport")
"""Rows that follow from others and are in the JSON only."""


def model_comparison(answer: Answer, *, all_of_it: bool = False) -> Blocks:
    """The quantities of `compare-models` that matter most, a row for each model, or all of them."""
    models = [item for item in answer["models"] if item["answered"]]
    yield from (_all_quantities if all_of_it else _side_by_side)(answer, models)
    for item in answer["models"]:
        if item["answered"]:
            if "trial" in item:
                yield from released_columns({"trial": item["trial"]})
            errors = "; ".join(text for _, text in error_words(item["error_estimate"]))
            yield Detail(f"known error of {item['model']}: {errors}")
        else:
            yield f"no answer by {item['model']}: {item['reason']}"
    yield from files_of(answer, file="picture", plot="why models differ")


def _side_by_side(answer: Answer, models: Sequence[Answer]) -> Blocks:
    reference = answer["reference"]
    names = [name for name in headline(next(m for m in models if m["model"] == reference)) if _known(models, name)]
    rows = grid(f"{answer['robot']}: models side by side, friction {answer['friction']}", "model")
    for name in names:
        unit = _common_unit(models, name)
        rows.add_column(QUANTITIES[name].short + (f"\n{unit}" if unit != "1" else ""), justify="right")
        if name == names[0]:
            rows.add_column(f"against\n{reference}", justify="right")
    for item in models:
        cells = [cell(item[name], _common_unit(models, name)) for name in names]
        against = "" if item["model"] == reference else _difference(item["relative_difference"][names[0]]["value"])
        name = f"{item['model']}*" if item["calibrated"] else str(item["model"])
        rows.add_row(name, cells[0], against, *cells[1:])
        if "forward_velocity" in item.get("trial", ()):
            rows.add_row(*_trial_row(item["trial"], models, names, reference))
    yield rows
    if any(item["calibrated"] for item in models):
        yield "*: with calibration factors"
    yield "all quantities: --all"


def _trial_row(trial: Answer, models: Sequence[Answer], names: Sequence[str], reference: str) -> Iterator[str]:
    """The row of a trial, against the reference model's held speed."""
    (base,) = (item["forward_velocity"]["value"] for item in models if item["model"] == reference)
    yield "trial"
    for name in names:
        item = trial.get(name)
        yield "-" if item is None else cell(item, _common_unit(models, name))
        if name == names[0]:
            yield _difference(trial["forward_velocity"]["value"] / base - 1.0 if base else None)


def _all_quantities(answer: Answer, models: Sequence[Answer]) -> Blocks:
    """A row for each quantity: first the values, then how far they are from the reference model's."""
    reference, names = answer["reference"], models[0]["relative_difference"]
    known = [name for name in names if name not in _LEFT_OUT and _known(models, name)]
    values = grid(f"{answer['robot']}: models side by side, friction {answer['friction']}", "quantity")
    others = grid(f"against {reference}", "quantity")
    for item in models:
        values.add_column(item["model"], justify="right", no_wrap=True)
        if item["model"] != reference:
            others.add_column(item["model"], justify="right", no_wrap=True)
    for name in known:
        unit = _common_unit(models, name)
        cells = [cell(item[name], unit) for item in models]
        words = name.replace("_", " ")
        values.add_row(words + (f", {unit}" if unit != "1" else ""), *cells)
        apart = [item["relative_difference"][name]["value"] for item in models if item["model"] != reference]
        others.add_row(words, *map(_difference, apart))
    values.add_row("calibrated", *("yes" if item["calibrated"] else "no" for item in models))
    yield values
    if len(models) > 1:
        yield others


def _known(models: Sequence[Answer], name: str) -> bool:
    return any(item[name]["value"] is not None for item in models)


def _common_unit(models: Sequence[Answer], name: str) -> str:
    """The unit of a quantity for all models: that of the largest value."""
    sizes = [abs(item[name]["value"]) for item in models if item[name]["value"]]
    return display_unit(max(sizes, default=None), models[0][name]["unit"])


def _difference(share: float | None) -> str:
    if share is None:
        return "-"
    if not 1.0 / _FACTOR < 1.0 + share < _FACTOR:
        return times(1.0 + share)
    text = f"{100.0 * share:+.1f}"
    return "0.0%" if float(text) == 0 else f"{text}%"


_FACTOR = 2.0  # ratio from which on a difference is shown as a multiple


def simulation(answer: Answer) -> Blocks:
    """Means and final values of `simulate`, and what happened in the run."""
    title = f"{answer['robot']}: model {answer['model']}, friction {answer['friction']}, {answer['motion']} motion"
    yield _averages(title, answer)
    yield quantity_grid("", dict(_final_values(answer)))
    if "draws" in answer:
        intervals = {name: item for name, item in answer.items() if isinstance(item, Mapping) and "low" in item}
        yield band_grid("", intervals, of="mean")
        yield Detail(
            f"low and high: 95 % interval over {answer['draws']} draws, of a tail like those that were fitted, which "
            "the model may miss by as much as these"
        )
    yield from _events(answer["events"])
    yield from reason_of(answer)
    if "placement" in answer:
        yield from placement_of(answer["placement"])
    if "in_tube" in answer:
        pose = answer["in_tube"]
        shown = {name: in_words(pose[name]) for name in pose if name != "ends"}
        if pose["wait"]["value"]:
            shown["gap"] += " after the wait, where the run begins"
        details = [f"{name.replace('_', ' ')} {words}" for name, words in shown.items()]
        yield Detail(f"in the tube: ends {pose['ends']}, {', '.join(details)}")
    if "state" in answer:
        state = answer["state"]
        yield Detail(f"state at the end: {state} ({END_STATES[state]}); {ASSUMPTION}")
    yield from error_of(answer["error_estimate"])
    whole = f"the part from {answer['begins']['value']:.4g} s on" if "begins" in answer else "the run"
    yield Detail(f"last 2/3 of run: over the last two thirds of {whole}, on or off")
    if "in_tube" in answer:
        yield "drive on: what a trial of `predict` gives, with its wait and duration"
    yield Detail(f"steady part: {answer['steady']}")
    yield from files_of(answer, plot="plot", movie="movie", file="trajectory")
    yield from sentences_of(answer, "slow-film")


def _averages(title: str, answer: Answer) -> Table:
    """Means over the last two thirds, while the drive is on, and while the motion is steady."""
    table = grid(title, "mean over", "last 2/3 of run", "drive on", "steady part", "unit")
    for name in (name.removesuffix("_on") for name in answer if name.endswith("_on")):
        items = [answer.get(name, _NONE), answer[f"{name}_on"], answer[f"{name}_steady"]]
        most = max((abs(item["value"]) for item in items if item["value"] is not None), default=None)
        unit = display_unit(most, items[1]["unit"])
        if items[1]["unit"] == "m/s":
            unit = speed_unit(most, answer.get("mean_tail_rotation_rate_on", _NONE)["value"])
        values = [in_unit(_rounded(item["value"], most), items[1]["unit"], unit) for item in items]
        table.add_row(name.removeprefix("mean_").replace("_", " "), *values, unit)
    return table


def _rounded(value: float | None, most: float | None) -> float | None:
    """A value without what is rounding error beside the largest one: a robot at rest has no speed of 1e-19 m/s."""
    return 0.0 if value is not None and most is not None and abs(value) <= _ROUNDING * most else value


_ROUNDING = 1e-12
_NONE: Answer = {"value": None}  # of the time, which has no mean


def _events(events: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    for event in merged_events([(event["time"], event["what"]) for event in events]):
        again = f", {event.times} times until {_when(event.last)}" if event.times > 1 else ""
        yield f"{_when(event.time)}: {event.what}{again}"


def _when(time: float) -> str:
    """A time from the start of the run, s, negative in the wait before it."""
    return f"{time:.4g} s" if time >= 0.0 else f"{-time:.4g} s before the run, in the wait"


def _final_values(answer: Answer) -> Iterator[tuple[str, Any]]:
    """Quantities of a run that have no averages, vectors by their parts."""
    for name, item in answer.items():
        averaged = name.endswith(("_on", "_steady")) or f"{name}_on" in answer
        if name == "error_estimate" or averaged or not isinstance(item, Mapping) or "unit" not in item:
            continue
        if isinstance(item["value"], list):
            for part, value in zip("xyz", item["value"], strict=True):
                yield f"{name} {part}", quantity(value, item["unit"])
        else:
            yield name, item


_SWEPT = ("field_rate", "tail_rotation_rate", "forward_velocity", "wobble_angle", "phase_lag")
"""Quantities of a sweep."""


def magnetic_sweep(answer: Answer) -> Blocks:
    """Motion over the rates of a rotating field."""
    title = f"{answer['robot']}: rotating field, model {answer['model']}, free motion"
    units = {name: QUANTITIES[name].display_unit for name in _SWEPT}
    heads = [f"{QUANTITIES[name].short}, {unit}" for name, unit in units.items()]
    yield grid(title, *heads, rows=series_rows(answer, units))
    yield from reason_of(answer)
    yield f"step-out in axial motion at {cell(answer['step_out_rate'], 'Hz')} Hz; no lag where the robot slips"
    yield from files_of(answer, plot="plot", file="sweep")


_FILM = ("gap", "normal_resistance", "over_lubrication", "sideways_force")
"""Quantities of the lubrication film under the level robot."""


def settling(answer: Answer) -> Blocks:
    """The steady motion of `settle`, the resting pose, and the lubrication film in transit."""
    yield from unsteady(answer)
    steady = {name: item for name, item in answer.items() if name != "error_estimate"}
    yield quantity_grid(f"{answer['robot']}: settling in its tube", steady)
    drainage = answer["drainage_time"]
    if drainage["value"] is not None:
        gap = cell(drainage["until"], "mm")
        yield quantity_grid(f"in transit, as the gap first falls to {gap} mm", answer["passing"])
    if answer["film"]["gap"]["value"]:
        units = {name: QUANTITIES[name].display_unit for name in _FILM}
        heads = [f"{name.replace('_', ' ')} ({unit})".removesuffix(" (1)") for name, unit in units.items()]
        film = grid("film under it, level", *heads, rows=series_rows(answer["film"], units))
        for column in film.columns:
            column.justify = "right"
        yield film
    yield from reason_of(answer)
    yield from placement_of(answer["placement"], RELEASED)
    yield from resting_pose(answer["steady_state"])
    yield from error_of(answer["error_estimate"])
    yield from files_of(answer, file="picture")


def flow(answer: Answer) -> Blocks:
    """The motion of `flow`, then what each file holds."""
    title = f"{answer['robot']}: flow, model {answer['model']}, {answer['frame']} frame"
    yield quantity_grid(title, {**answer, **answer["placement"]})
    yield from reason_of(answer)
    if answer["placement"].get("ends"):
        yield Detail(f"ends of the channel: {answer['placement']['ends']}")
    for item in answer["files"]:
        points = item["grid"]["points"]
        shape = f"plane {''.join(points)}" if len(points) == 2 else "box"
        size = " x ".join(str(count) for count in points.values())
        found = {"spacing": item["grid"]["spacing"], **item}
        yield quantity_grid(f"{item['file']}: {shape}, {size} points", found)


def remote(answer: Answer) -> Blocks:
    """Text of `remote`."""
    drive_state = f"duty {answer['duty']['value']:g} for {answer['time_on']['value']:g} s, now off"
    yield f"{answer['port']}: {answer['name']}, {drive_state}"


def control(answer: Answer) -> Blocks:
    """The run of `control`, and the scores of all controllers."""
    task = answer["task"]
    goals = ", ".join(
        f"{name.replace('_', ' ')} {in_words(item)}"
        for name, item in task.items()
        if name != "kind" and item is not None
    )
    title = f"{answer['robot']}: {task['kind']}, {goals}; controller {answer['controller']}, seed {answer['seed']}"
    quantities = {answer["error"]["meaning"]: answer["error"]}
    quantities |= {name: answer[name] for name in ("final_position_x", "duration", "time_on", "electrical_energy")}
    yield quantity_grid(title, quantities)
    yield f"{'good' if answer['good'] else 'not good'} enough; {_unknowns_table(answer['drawn'])}"
    frames, commands = answer["frames"], answer["commands"]
    yield (
        f"camera: {frames['taken']} frames, {frames['lost']} lost; remote: {commands['sent']} commands, "
        f"{commands['lost']} lost; the drive is off at the end"
    )
    if answer["late"] is not None:
        yield f"live: at the end {' '.join(friendly(answer['late']['value'], 's'))} behind the clock"
    if answer["learnt"] is not None:
        yield f"learnt: {_learnt(answer['learnt'], answer['drawn'])}"
    if answer["scores"] is not None:
        yield from _scores(answer["scores"], answer["error"]["unit"])
    yield Detail(f"start: {answer['start']}")
    yield from reason_of(answer)
    yield from files_of(answer, plot="plot", movie="movie", file="run")


def _unknowns_table(drawn: Answer) -> str:
    """What the controller did not know."""
    details = [f"sampled: friction times {drawn['friction_factor']:.3g}"]
    if drawn["gap_factor"] != 1.0:
        details.append(f"gap times {drawn['gap_factor']:.3g}")
    pulse = drawn["pulse"]
    if pulse is None:
        details.append("no pulse of flow")
    else:
        velocity = in_words(pulse["velocity"])
        details.append(f"flow of {velocity} from {pulse['start']['value']:.3g} s to {pulse['end']['value']:.3g} s")
    return ", ".join(details)


def _learnt(learnt: Answer, drawn: Answer) -> str:
    """Factors with their intervals beside the truth."""
    details = []
    for name, item in learnt.items():
        words = (
            f"times {item['value']:.3g} ({item['low']:.3g} to {item['high']:.3g})" if item["told"] else "not identified"
        )
        details.append(f"{name.replace('_factor', '')} {words}, in truth {drawn[name]:.3g}")
    return "; ".join(details)


def _scores(scores: Answer, unit: str) -> Blocks:
    rows = grid("", "controller", "runs", "good", "mean error", "beyond feedback", "energy")
    for column in rows.columns[1:]:
        column.justify = "right"
    for name, one in scores["controllers"].items():
        share = one["good"]
        good = f"{100 * share['value']:.0f} % ({100 * share['low']:.0f} to {100 * share['high']:.0f})"
        beyond = "" if name == "feedback" else _interval(one["error_beyond_feedback"], unit)
        rows.add_row(name, str(one["runs"]), good, _interval(one["error"], unit), beyond, _interval(one["energy"], "J"))
    yield rows
    yield f"error: {scores['error']}, its size; in brackets 95 % intervals; 'beyond feedback': run by run"
    failed = scores["failed_seeds"]
    if failed:
        shown = ", ".join(str(seed) for seed in failed[:12]) + (", ..." if len(failed) > 12 else "")
        yield f"feedback was not good enough with the seeds {shown}: --seed does one again"


def _interval(item: Answer, unit: str) -> str:
    shown = display_unit(item["value"], unit)
    value, low, high = (in_unit(item[key], unit, shown) for key in ("value", "low", "high"))
    words = "" if shown == "1" else f" {shown}"
    return f"{value}{words}" if item["low"] is None else f"{value} ({low} to {high}){words}"
