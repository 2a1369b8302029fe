"""Text of `study`."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.markup import escape

from spirillum.cli.tables.parts import Answer, grid
from spirillum.display import counted
from spirillum.studies.ranking import ENDS, LET_GO, RANKED, best_in_words
from spirillum.units import display_unit, in_unit


def table(answer: Answer, console: Console, *, rows: int = 10) -> None:
    """Text of `study`: the ranking first, verdicts on a paper's statements last."""
    sizes = answer["dimensions"]
    robots = sizes["robot"] if "robot" in sizes else sizes["channel"] * sizes["wavelength"] * sizes["amplitude"]
    sizes_in_words = ((robots, "robot"), (sizes["model"], "model"), (sizes["friction"], "reading"))
    extent = ", ".join(counted(number, word) for number, word in sizes_in_words)
    console.print(f"[bold]{escape(answer['title'])}[/bold]: {extent} of the friction", highlight=False)
    show_ranking(answer["ranking"], console, rows)
    if answer["unanswered"]:
        console.print(empty_results(answer), highlight=False)
    console.print(f"observations: {escape(answer['observations'])}", highlight=False)
    if answer.get("predictions"):
        counts = ", ".join(f"{count} {verdict.replace('-', ': ')}" for verdict, count in answer["predictions"].items())
        console.print(f"statements of the paper, laid down and let go, nothing fitted: {counts}", highlight=False)
    if any(answer["claims"].values()):
        claims = ", ".join(f"{count} {verdict}" for verdict, count in answer["claims"].items())
        console.print(f"statements of the paper: {claims}", highlight=False)
    console.print(f"open {escape(answer['folder'])}/report.html", highlight=False, soft_wrap=True)


def empty_results(answer: Answer) -> str:
    """How many results are empty, and where the reasons stand."""
    return f"{answer['unanswered']} of {answer['results']} results are empty: warnings and variable `outside` say why"


def show_ranking(ranking: Answer, console: Console, rows: int) -> None:
    """The robots, the fastest first, and which of them is the best by what."""
    robots = ranking["robots"]
    if not robots:
        console.print("no robot has an answer", highlight=False)
        return
    columns = [column for name in robots[0] if name != "robot" for column in _columns(robots, name)]
    found = grid(_basis(ranking), "", "robot")
    found.columns[1].overflow = "fold"
    for title, _ in columns:
        found.add_column(title, justify="right", no_wrap=True)
    for rank, item in enumerate(robots[:rows]):
        found.add_row(str(rank + 1), escape(item["robot"]), *(cells[rank] for _, cells in columns))
    console.print(found)
    if len(robots) > rows:
        console.print(f"and {len(robots) - rows} more: --rows, ranking.csv", highlight=False)
    for best in ranking["best"]:
        console.print(escape(best_in_words(best)), highlight=False, soft_wrap=True)
    if "settled" in ranking:
        console.print(ranking["settled"], highlight=False)
    if ranking["low_and_high"] in ENDS:
        where = ", of robots that are not let go: in ranking.csv" if "settled" in ranking else ""
        console.print(f"low, high: {ENDS[ranking['low_and_high']]}{where}", highlight=False)


def _basis(ranking: Answer) -> str:
    walls = "; the channel's walls are not computed" if ranking["walls_left_out"] else ""
    first = "fastest once settled first" if "settled" in ranking else "fastest first"
    return f"{first}: model {ranking['model']}, friction {ranking['friction']}{walls}"


def _columns(robots: Sequence[Answer], name: str) -> list[tuple[str, list[str]]]:
    """Titles and cells of a quantity: its values, of the speed also the ends of its band."""
    own = robots[0][name]["unit"]
    sizes = [abs(item[name]["value"]) for item in robots if item[name]["value"]]
    if not sizes:
        return []
    shown = display_unit(max(sizes), own)
    with_ends = name == "forward_velocity" and LET_GO not in robots[0]  # else the table is wider than a terminal
    ends = [end for end in ("low", "high") if with_ends and any(end in item[name] for item in robots)]
    return [
        (
            RANKED[name].heading(shown) if end == "value" else end,
            [in_unit(item[name].get(end), own, shown) for item in robots],
        )
        for end in ("value", *ends)
    ]
