"""Table of `control`."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer, add_quantities, friendly, grid
from spirillum.units import display_unit, in_unit


def table(answer: Answer, console: Console) -> None:
    """Table of `control`."""
    task = answer["task"]
    asked = ", ".join(f"{name.replace('_', ' ')} {_words(item)}" for name, item in task.items() if _given(name, item))
    title = f"{answer['robot']}: {task['kind']}, {asked}; controller {answer['controller']}, seed {answer['seed']}"
    rows = grid(title, "quantity", "value", "unit", "SI")
    quantities = {answer["error"]["meaning"]: answer["error"]}
    quantities |= {name: answer[name] for name in ("final_position_x", "duration", "time_on", "electrical_energy")}
    add_quantities(rows, quantities)
    console.print(rows)
    console.print(f"{'good' if answer['good'] else 'not good'} enough; {_drawn(answer['drawn'])}", soft_wrap=True)
    frames, commands = answer["frames"], answer["commands"]
    console.print(
        f"camera: {frames['taken']} frames, {frames['lost']} lost; remote: {commands['sent']} commands, "
        f"{commands['lost']} lost; the drive is off at the end",
        highlight=False,
        soft_wrap=True,
    )
    if answer["late"] is not None:
        late = " ".join(friendly(answer["late"]["value"], "s"))
        console.print(f"live: at the end {late} behind the clock", highlight=False)
    if answer["learnt"] is not None:
        console.print(f"learnt: {_learnt(answer['learnt'], answer['drawn'])}", highlight=False, soft_wrap=True)
    if answer["scores"] is not None:
        _scores(answer["scores"], answer["error"]["unit"], console)
    for name in ("plot", "movie", "file"):
        if answer.get(name):
            console.print(
                f"{'run' if name == 'file' else name} in {escape(answer[name])}", highlight=False, soft_wrap=True
            )


def _given(name: str, item: Any) -> bool:
    return name != "kind" and item is not None


def _words(item: Any) -> str:
    return " ".join(friendly(item["value"], item["unit"])).strip() if isinstance(item, dict) else str(item)


def _drawn(drawn: Answer) -> str:
    """What the controller did not know."""
    said = [f"drawn: friction times {drawn['friction_factor']:.3g}"]
    if drawn["gap_factor"] != 1.0:
        said.append(f"gap times {drawn['gap_factor']:.3g}")
    pulse = drawn["pulse"]
    if pulse is None:
        said.append("no pulse of flow")
    else:
        velocity = _words(pulse["velocity"])
        said.append(f"flow of {velocity} from {pulse['start']['value']:.3g} s to {pulse['end']['value']:.3g} s")
    return ", ".join(said)


def _learnt(learnt: Answer, drawn: Answer) -> str:
    """Factors with their intervals beside the truth."""
    said = []
    for name, item in learnt.items():
        words = f"times {item['value']:.3g} ({item['low']:.3g} to {item['high']:.3g})" if item["told"] else "not told"
        said.append(f"{name.replace('_factor', '')} {words}, in truth {drawn[name]:.3g}")
    return "; ".join(said)


def _scores(scores: Answer, unit: str, console: Console) -> None:
    """Every controller with its intervals."""
    rows = grid("", "controller", "runs", "good", "mean error", "beyond feedback", "energy")
    for column in range(1, 6):
        rows.columns[column].justify = "right"
    for name, one in scores["controllers"].items():
        share = one["good"]
        good = f"{100 * share['value']:.0f} % ({100 * share['low']:.0f} to {100 * share['high']:.0f})"
        beyond = "" if name == "feedback" else _interval(one["error_beyond_feedback"], unit)
        rows.add_row(name, str(one["runs"]), good, _interval(one["error"], unit), beyond, _interval(one["energy"], "J"))
    console.print(rows)
    console.print(
        f"error: {scores['error']}, its size; in brackets 95 % intervals; 'beyond feedback': run by run",
        highlight=False,
        soft_wrap=True,
    )
    failed = scores["failed_seeds"]
    if failed:
        shown = ", ".join(str(seed) for seed in failed[:12]) + (", ..." if len(failed) > 12 else "")
        console.print(f"feedback was not good enough with the seeds {shown}: --seed does one again", highlight=False)


def _interval(item: Answer, unit: str) -> str:
    shown = display_unit(item["value"], unit)
    value = in_unit(item["value"], unit, shown)
    words = "" if shown == "1" else f" {shown}"
    if item["low"] is None:
        return f"{value}{words}"
    low, high = (in_unit(item[key], unit, shown) for key in ("low", "high"))
    return f"{value} ({low} to {high}){words}"
