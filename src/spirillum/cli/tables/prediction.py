"""Table of `predict`."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import (
    LAID_DOWN,
    Answer,
    add_bands,
    add_quantities,
    grid,
    show_error,
    show_lying,
    show_placement,
    show_reason,
    show_unsteady,
)
from spirillum.display import fitted_words, rows_of
from spirillum.swimming.steady_quantities import headline


def table(answer: Answer, console: Console, *, all_of_it: bool = False) -> None:
    """Table of `predict`: the five quantities that matter most, or all of them."""
    show_unsteady(answer, console)
    calibrated = fitted_words(answer["calibrated"], answer.get("fitted_by", ""))
    free = ", free motion" if answer["motion"] == "free" else ""
    title = f"{answer['robot']}: model {answer['model']}, friction {answer['friction']}, {calibrated}{free}"
    only = None if all_of_it else headline(answer)
    if "band" in answer or "kind" in answer["forward_velocity"]:
        rows = grid(title, "quantity", "value", "low", "high", "unit")
        add_bands(rows, answer, only)
    else:
        rows = grid(title, "quantity", "value", "unit", "SI")
        add_quantities(rows, answer, only)
    console.print(rows)
    more = len(rows_of(answer)) - rows.row_count
    if more:
        console.print(f"and {more} more quantities: --all", highlight=False)
    show_placement(answer["placement"], console, LAID_DOWN if "lying" in answer else "placement")
    if "lying" in answer:
        show_lying(answer["lying"], console)
    show_reason(answer, console)
    if "other_models" in answer:
        console.print(escape(answer["other_models"]["statement"]), highlight=False, soft_wrap=True)
    if answer["forward_velocity"].get("kind") == "interval":
        level = answer["forward_velocity"]["level"]
        console.print(f"low and high: {100 * level:g} % interval of the robot's own motion", highlight=False)
        console.print(f"interval {answer['interval_of']}", highlight=False, soft_wrap=True)
    if "band" in answer:
        places = len(answer["band"]["gap"]["value"])
        console.print(
            f"band: low and high are the least and the largest of {places + 1} places at which the robot is held, none "
            "of them likelier than another; value: the place above; let go (--motion free), it may swim outside the "
            "band",
            highlight=False,
            soft_wrap=True,
        )
    show_error(answer["error_estimate"], console)
