"""Tables of `flow`: the motion, then what each file holds."""

from __future__ import annotations

from rich.console import Console

from spirillum.cli.tables.parts import Answer, add_quantities, grid, show_reason


def table(answer: Answer, console: Console) -> None:
    """Tables of `flow`."""
    title = f"{answer['robot']}: flow, model {answer['model']}, {answer['frame']} frame"
    rows = grid(title, "quantity", "value", "unit", "SI")
    add_quantities(rows, {**answer, **answer["placement"]})
    console.print(rows)
    show_reason(answer, console)
    if answer["placement"].get("ends"):
        console.print(f"ends of the channel: {answer['placement']['ends']}", highlight=False)
    for item in answer["files"]:
        points = item["grid"]["points"]
        shape = f"plane {''.join(points)}" if len(points) == 2 else "box"
        size = " x ".join(str(count) for count in points.values())
        found = grid(f"{item['file']}: {shape}, {size} points", "quantity", "value", "unit", "SI")
        add_quantities(found, {"spacing": item["grid"]["spacing"], **item})
        console.print(found)
