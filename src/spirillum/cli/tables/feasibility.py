"""Tables of `measure --feasibility`."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer, grid
from spirillum.display import percent
from spirillum.units import for_people, in_unit, shown_in


def table(answer: Answer, console: Console) -> None:
    """Tables of `measure --feasibility`."""
    verdict = "all rates can be resolved" if answer["feasible"] else "[bold]not all rates can be resolved[/bold]"
    expected = grid(f"{answer['robot']}: expected", "quantity", "value", "unit", "from")
    for name, item in answer["expected"].items():
        unit = for_people(item["unit"])
        expected.add_row(name.replace("_", " "), in_unit(item["value"], item["unit"], unit), unit, item["source"])
    console.print(expected)
    for check in answer["checks"]:
        mark = "yes" if check["passed"] else "[red]NO[/red] "
        console.print(f"{mark:<4} {escape(check['sentence'])}", highlight=False, soft_wrap=True)
    if answer["intervals"]:
        span = f"{answer['time_measured']['value']:.4g} s"
        rows = grid(f"expected 95 % interval of one trial, {span} long", "quantity", "half width", "unit", "share")
        for name, item in answer["intervals"].items():
            reach = item["half_width"]
            unit = for_people(reach["unit"])
            share = "-" if item["share"] is None else percent(item["share"])
            rows.add_row(name.replace("_", " "), f"{shown_in(reach['value'], unit):.2g}", unit, share)
        console.print(rows)
        console.print(f"basis: {answer['basis']}", highlight=False, soft_wrap=True)
    scale, parts = percent(answer["scale_uncertainty"]), answer["scale_sources"]
    words = ", ".join(f"{name} {percent(share)}" for name, share in sorted(parts.items(), key=lambda item: -item[1]))
    console.print(
        f"standard uncertainty of lengths: {scale}{' (' + words + ')' if words else ''}",
        highlight=False,
        soft_wrap=True,
    )
    console.print(f"verdict: {verdict}", highlight=False)
