"""Table of `suggest`."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer, grid


def table(answer: Answer, console: Console, rows: int = 10) -> None:
    """Table of `suggest`."""
    title = (
        f"{answer['posterior']}, model {answer['model']}: what {answer['trials']} trials of one more tail would tell"
    )
    console.print(f"[bold]{escape(title)}[/bold]", highlight=False, soft_wrap=True)
    found = grid("", "channel (mm)", "tail (mm)", "information (bit)", "behind the first (bit)", "narrows most")
    first = answer["candidates"][0]
    for item in answer["candidates"][:rows]:
        sizes = [f"{1e3 * item[name]['value']:g}" for name in ("channel_diameter", "wavelength", "amplitude")]
        name, share = min(item["narrowing"].items(), key=lambda pair: pair[1]["value"])
        words = name.replace("_", " ").replace("[", " [")  # wraps between words
        told = f"{words} to {100 * share['value']:.0f} %"
        behind = item["behind_the_best"]
        apart = "-" if item is first else f"{behind['value']:.3f} +- {behind['standard_error']:.2g}"
        size = f"{sizes[1]} x {sizes[2]}"
        found.add_row(sizes[0], size, f"{item['expected_information']['value']:.3f}", apart, escape(told))
    console.print(found)
    tied = sum(item["tied_with_the_best"] for item in answer["candidates"]) - 1
    if tied > 0:
        others = "1 other is" if tied == 1 else f"{tied} others are"
        words = f"a tie: {others} within two standard errors of the first, which the draws do not tell apart"
        console.print(words, highlight=False, soft_wrap=True)
