"""Table of `track`: speed and rates over all frames, and how fast it was."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer, grid
from spirillum.measurement.shown import shown
from spirillum.measurement.trials import RATE_NAMES


def table(answer: Answer, console: Console) -> None:
    """Table of `track`: speed and rates over all frames, and how fast it was."""
    if "forward_velocity" in answer:
        rows = grid(f"{answer['source']}: all frames", "quantity", "value", "low", "high", "unit")
        for name in RATE_NAMES:
            item = answer[name]
            numbers = shown(item["value"], item.get("low"), item.get("high"), item["unit"])
            rows.add_row(name.replace("_", " "), *numbers)
        console.print(rows)
    seen = f"robot seen on {answer['frames_tracked']} of {answer['frames']} frames, {answer['frames_dropped']} dropped"
    latency = answer["latency"]
    if latency["median"]["value"] is not None:
        median, high = (1e3 * latency[name]["value"] for name in ("median", "percentile_95"))
        seen += f"; latency {median:.1f} ms, 95th percentile {high:.1f} ms"
    console.print(escape(seen), highlight=False, soft_wrap=True)
