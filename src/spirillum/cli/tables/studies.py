"""Studies of many robots, and designs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from rich.markup import escape
from rich.table import Table

from spirillum.cli.tables.parts import (
    Answer,
    Blocks,
    Detail,
    band_grid,
    cell,
    files_of,
    grid,
    in_words,
    quantity_grid,
    reason_of,
    series_rows,
)
from spirillum.designs.design_result import ALTERNATIVES
from spirillum.display import counted, percent
from spirillum.notes import notes_in_answer
from spirillum.studies.ranking import ENDS, HELD, TRIAL, best_in_words, order_in_words, ranked_columns
from spirillum.units import display_unit, in_unit


def study(answer: Answer, *, rows: int = 10, figures: bool = True) -> Blocks:
    """The ranking of `study` first, verdicts on a paper's statements last."""
    sizes = answer["dimensions"]
    robots = sizes["robot"] if "robot" in sizes else sizes["channel"] * sizes["wavelength"] * sizes["amplitude"]
    sizes_in_words = ((robots, "robot"), (sizes["model"], "model"), (sizes["friction"], "friction model"))
    extent = ", ".join(counted(number, word) for number, word in sizes_in_words)
    yield f"{answer['title']}: {extent}"
    yield from _ranking(answer, rows)
    yield from reason_of({"model": answer["ranking"]["model"], **answer})
    yield from _empty_results(answer)
    yield f"observations: {answer['observations']}"
    if answer.get("predictions"):
        counts = ", ".join(f"{count} {verdict.replace('-', ': ')}" for verdict, count in answer["predictions"].items())
        yield f"statements of the paper, by robots released from rest, nothing fitted: {counts}"
    if any(answer["claims"].values()):
        counts = ", ".join(f"{count} {verdict}" for verdict, count in answer["claims"].items())
        yield f"statements of the paper: {counts}"
    if figures:
        yield f"open {answer['folder']}/report.html"
    else:
        yield f"dataset.nc and ranking.csv in {answer['folder']}; without --no-figures a rerun draws figures and report"


def study_store(answer: Answer) -> Blocks:
    """Text of `study --store`."""
    sizes = " x ".join(f"{size} {name}" for name, size in answer["dimensions"].items())
    yield f"{answer['title']}: {sizes}"
    yield from _empty_results(answer)
    yield f"observations: {answer['observations']}"
    yield f"{answer['results']} results in {answer['folder']}"


def _empty_results(answer: Answer) -> Iterator[str]:
    """How many results are empty, and where the reasons stand."""
    if answer["unanswered"]:
        yield f"{answer['unanswered']} of {answer['results']} results are empty: notes and variable `outside` say why"


_MANY = 5  # quantities from which on a ranking has units below their names, to fit into a terminal
_WHOLE = 24  # length of names that are not wrapped


def _ranking(answer: Answer, rows: int) -> Blocks:
    """The robots, the fastest first, and which of them is the best by what."""
    ranking = answer["ranking"]
    robots = ranking["robots"]
    if not robots:
        why = [str(note) for note in notes_in_answer(answer) if note.code == "without-answer"]
        yield f"no robot has an answer{': ' if why else ''}{'; '.join(why)}"
        return
    _, lead, *_ = robots[0]
    model, names = ranking["model"], [name for name in robots[0] if name != "robot"]
    columns = [column for name in names for column in ranked_columns(robots, name, model, wide=False)]
    walls = "; the channel's walls are not computed" if ranking["walls_left_out"] else ""
    order = f"{order_in_words(lead, held=ranking['held'])}{'; beside it' if lead == HELD else ''}"
    found = grid(f"{order}: model {ranking['model']}, friction {ranking['friction']}{walls}", "", "robot")
    found.columns[1].no_wrap = all(len(item["robot"]) <= _WHOLE for item in robots)
    split = len(columns) >= _MANY
    for title, _ in columns:
        found.add_column(title.replace(", ", "\n") if split else title, justify="right", no_wrap=True)
    for rank, item in enumerate(robots[:rows]):
        found.add_row(str(rank + 1), escape(item["robot"]), *(cells[rank] for _, cells in columns))
    yield found
    if len(robots) > rows:
        yield f"and {len(robots) - rows} more: --rows, ranking.csv"
    yield from (best_in_words(best, held=ranking["held"]) for best in ranking["best"])
    if TRIAL in names:
        motions = f"trial{', later as in steady' if 'settled' in ranking else ''}"
        yield f"in the lab: a robot laid in its tube swims as in {motions}; a fixed pose is for a known gap and pitch"
    if "settled" in ranking:
        yield Detail(ranking["settled"])
    if ranking["low_and_high"] in ENDS:
        where = ", of robots at a fixed pose: in ranking.csv" if "settled" in ranking else ""
        yield Detail(f"low, high: {ENDS[ranking['low_and_high']]}{where}")


_SHOWN = (
    "forward_velocity",
    "tail_rotation_rate",
    "body_rotation_rate",
    "motor_current",
    "shaft_power",
    "hydrodynamic_efficiency",
)
"""Quantities of a design in the table; all are in the JSON."""


def design(answer: Answer) -> Blocks:
    """The best values of `design`, what they give, what they are compared with."""
    model = f"model {answer['model']}{', calibrated' if answer['calibrated'] else ''}"
    yield f"{answer['robot']}, {model}: {answer['objective']['words']} {in_words(answer['objective'])}"
    yield _best_values(answer)
    shown = {name: answer["quantities"][name] for name in _SHOWN}
    if "uncertainty" in answer:
        yield band_grid("what it gives: means, and 95 % intervals", shown)
    else:
        yield quantity_grid("what it gives", shown)
    if "probability" in answer.get("uncertainty", {}):
        yield f"probability that the target is met: {_share(answer['uncertainty']['probability'])}"
    yield from _basis_of_design(answer)
    reasons = [one["trial"]["reason"] for one in answer.get("confirmed", ()) if "reason" in one["trial"]]
    tabled = len(reasons) < len(answer.get("confirmed", ()))
    if tabled:
        yield _confirmed(answer["confirmed"])
    for reason in dict.fromkeys(reasons):
        yield f"-: no trial of designs: {reason}" if tabled else Detail(f"no trial of designs: {reason}")
    if "front" in answer:
        yield _front(answer["front"])
    yield from files_of(answer, file="robot file", picture="picture", stl="body for a printer")


def _confirmed(designs: Sequence[Answer]) -> Table:
    units = {path: display_unit(item["value"], item["unit"]) for path, item in designs[0]["design"].items()}
    rows = grid("the best designs", *(f"{path}, {unit}".removesuffix(", 1") for path, unit in units.items()))
    for column in ("held, mm/s", "trial, mm/s"):
        rows.add_column(column, justify="right")
    for digits in range(4, 10):  # more of them until no two designs look alike
        labels = [
            [in_unit(item["value"], item["unit"], units[path], digits) for path, item in one["design"].items()]
            for one in designs
        ]
        if len({*map(tuple, labels)}) == len(designs):
            break
    for one, cells in zip(designs, labels, strict=True):
        speeds = [one[motion].get("forward_velocity", {"value": None})["value"] for motion in ("held", "trial")]
        rows.add_row(*cells, *(in_unit(speed, "m/s", "mm/s") for speed in speeds))
    return rows


def _best_values(answer: Answer) -> Table:
    fields = grid("", "field", "best", "within 1 %", "unit", "today")
    today = next(item for item in answer["alternatives"] if item["name"] == "today")
    for path, item in answer["design"].items():
        unit = display_unit(item["value"], item["unit"])
        ends = answer["sensitivity"][path]["within_one_per_cent"]["value"]
        low, high = (in_unit(end, item["unit"], unit) for end in ends)
        value, was = cell(item, unit), cell(today["design"][path], unit)
        fields.add_row(escape(path), value, f"{low} to {high}", "" if unit == "1" else unit, was)
    return fields


def _basis_of_design(answer: Answer) -> Iterator[Detail]:
    """What the best design is compared with, how certain it is, and how it was found."""
    yield from reason_of(answer)
    yield from _compared(answer)
    if (deciding := answer.get("uncertainty", {}).get("deciding")) is not None and deciding:
        shares = [f"{name} {100 * share:.0f} %" for name, share in deciding.items()]
        yield Detail(f"shares of the spread: {', '.join(shares)}")
    wound = [f"{name.replace('_', ' ')} {in_words(item)}" for name, item in answer["winding"].items()]
    yield Detail(f"to wind: {', '.join(wound)}")
    if answer["bound_by"]:
        yield Detail(f"bound by: {'; '.join(answer['bound_by'])}")
    if "learned" in answer:
        known = answer["learned"]
        errors = {
            "the objective of the best was": "error_of_the_best",
            "those of the better half, each left out, were": "error_left_out",
        }
        missed = [
            f"{whose} missed by {percent(known[name]['value'])}"
            for whose, name in errors.items()
            if known[name]["value"] is not None
        ]
        yield Detail(
            f"learned from {known['solves']} designs that were solved for: {', '.join(missed) or 'exact there'}"
        )
    counts = answer["designs"]
    yield Detail(
        f"{counts['swum']} designs: {counts['refused']} cannot be built or have no steady motion, "
        f"{counts['breaking_a_condition']} break a condition"
    )


def _compared(answer: Answer) -> Iterator[Detail]:
    for other in answer["alternatives"]:
        fields = ", ".join(f"{path} {in_words(item)}" for path, item in other["design"].items())
        words = f"{ALTERNATIVES[other['name']]} ({fields}): {in_words(other['objective'])}"
        if not other["keeps_conditions"]:
            words += ", does not keep all conditions"
        if "uncertainty" in answer:
            words += f"; the best is better with probability {_share(other['probability_that_the_design_is_better'])}"
        yield Detail(words)


def _share(item: Answer) -> str:
    return f"{item['value']:.2f} ({item['low']:.2f} to {item['high']:.2f})"


def _front(front: Mapping[str, Answer]) -> Table:
    units = {name: display_unit(max(map(abs, item["value"])), item["unit"]) for name, item in front.items()}
    names = [f"{name.replace('_', ' ')}{'' if units[name] == '1' else f' ({units[name]})'}" for name in front]
    return grid("designs of which none is better in both", *names, rows=series_rows(front, units))


def validation(answer: Answer) -> Blocks:
    """A line for each case, then a row for each quantity of `validate`: published, ours, difference, error, covered."""
    left = [row for row in answer["rows"] if not row["as_recorded"]]
    count = sum(row["covered"] is True for row in answer["rows"])
    published = sum(row["published"] is not None for row in answer["rows"])
    cases = counted(len(answer["cases"]), "case")
    yield f"{cases}, nothing fitted: {count} of {published} published numbers covered by stated errors and assumptions"
    for row in left:
        ends = " to ".join(f"{row['recorded'][end]:.4g}" for end in ("low", "high"))
        where = f"{row['case']}, {row['point']}, {row['quantity']}"
        yield f"left its recorded range: {where}: {row['ours']:.4g}, not {ends}"
    table = grid("", "case", "quantity", "ours/published", "sd", "rows", "covered")
    for case in answer["cases"]:
        for one in case["ratios"]:
            cells = f"{one['mean']:.2f}", f"{one['deviation']:.2f}" if one["count"] > 1 else "", str(one["count"])
            table.add_row(case["case"], escape(one["quantity"]), *cells, str(one["covered"]))
        for verdict in dict.fromkeys(claim["verdict"] for claim in case["statements"]):
            number = sum(claim["verdict"] == verdict for claim in case["statements"])
            table.add_row(case["case"], f"statements: {verdict}", "", "", str(number), "")
    yield table
    yield from files_of(answer, folder="report")
    yield from (Detail(f"{case['case']}: {' '.join(case['explanation'].split())}") for case in answer["cases"])
