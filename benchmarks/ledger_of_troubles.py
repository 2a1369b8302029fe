"""The ledger of troubles: each trouble of a bench, drawn in three styles with random truth, measured and counted.

    python benchmarks/ledger_of_troubles.py 20 [--rows ROWS.jsonl] [--only NAME ...] [--style STYLE ...] [--write]

Synthetic throughout: the virtual camera, flat drawings, and a light table (`tests/support`). Films of three seconds,
25 frames a second, 320 to 480 pixels wide. One row a film is appended to the file of rows; what stands there is not
drawn again, so that an interrupted run goes on. `--write` puts the summary between its markers in
docs/measuring-accuracy.md. All troubles in all styles take three to four minutes of one core for each seed.
"""

import argparse
import json
import sys
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import spirillum as sp
from spirillum.errors import InputError

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tests" / "support"))

from bench_scenes import DURATION, FPS, STYLES, Scene, scene  # noqa: E402
from bench_troubles import (  # noqa: E402
    ACROSS,
    BODY,
    HEADING,
    MOTOR,
    RATES,
    SPEED,
    TAIL,
    TROUBLES,
    Film,
    Trouble,
)

PAGE = HERE.parent / "docs" / "measuring-accuracy.md"
BEGIN = "<!-- ledger of troubles: written by benchmarks/ledger_of_troubles.py -->"
END = "<!-- end of the ledger -->"
HARMLESS = ("synthetic", "short-turn", "dropped-frames", "stray-frames")
"""Beginnings of the names of flags that do not say that a number may be wrong."""
BELIEVED = "frame rate wrong"
"""A trouble that no film can contradict: it has its row, and is left out of the totals."""
Row = dict[str, Any]


def film_of(drawing: Scene, images: Sequence[np.ndarray]) -> Film:
    """The film of a scene without a trouble."""
    count = len(images)
    return Film(list(images), list(range(count)), [index / FPS for index in range(count)], dict(drawing.setup))


def truth_of(drawing: Scene, trouble: Trouble) -> dict[str, float]:
    """True values of what is compared, SI."""
    true = drawing.truth
    found = {SPEED: true.velocity, BODY: true.body_rate, TAIL: true.tail_rate, MOTOR: true.tail_rate - true.body_rate}
    return found | ({ACROSS: true.lateral, HEADING: true.heading} if trouble.still else {})


def measured(film: Film, drawing: Scene, trouble: Trouble, folder: Path) -> Row:
    """What `measure` says of a film, beside the truth."""
    path, setup = film.write(folder, drawing.robot_text)
    truth = truth_of(drawing, trouble)
    numbers: dict[str, Row]
    start = time.process_time()
    try:
        trial = sp.measure([path], setup, annotated=False).to_dict()["trials"][0]
    except InputError as error:
        numbers = {name: {"true": rounded(true)} for name, true in truth.items()}
        return {"flags": ["refused"], "said": str(error), "numbers": numbers, "cpu": spent(start)}
    numbers = {}
    for name, true in truth.items():
        found = trial[name]
        numbers[name] = {"true": rounded(true)}
        if found.get("value") is None:
            numbers[name]["why"] = found.get("reason", "")
        else:
            numbers[name] |= {
                key: rounded(found[key]) for key in ("value", "low", "high") if found.get(key) is not None
            }
    flags = [flag["name"] for flag in trial["flags"]]
    return {"flags": flags, "numbers": numbers, "cpu": spent(start)}


def spent(start: float) -> float:
    """Processor time since then, s."""
    return round(time.process_time() - start, 2)


def rounded(value: float) -> float:
    """To seven digits."""
    return float(f"{value:.7g}")


def rows_in(path: Path) -> list[Row]:
    """Rows that are there; a last one that was cut off is left out."""
    rows = []
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        try:
            rows.append(json.loads(line))
        except ValueError:
            print(f"left out: {line[:60]}")
    return rows


def run(seeds: Iterable[int], troubles: Sequence[Trouble], rows: Path, styles: Sequence[str] = STYLES) -> None:
    """Draw and measure what is missing in the file of rows."""
    done = {(row["trouble"], row["style"], row["seed"]) for row in rows_in(rows)}
    for seed in seeds:
        for style in styles:
            for variant in dict.fromkeys(trouble.variant for trouble in troubles):
                asked = [
                    trouble
                    for trouble in troubles
                    if trouble.variant == variant and (trouble.name, style, seed) not in done
                ]
                if not asked:
                    continue
                drawing = scene(style, seed, variant)
                images = [drawing.draw(index / FPS) for index in range(round(DURATION * FPS) + 1)]
                for trouble in asked:
                    rng = np.random.default_rng([1902, seed, sum(trouble.name.encode())])
                    film = trouble.change(film_of(drawing, images), drawing, rng)
                    with TemporaryDirectory() as folder:
                        row = measured(film, drawing, trouble, Path(folder))
                    row = {"trouble": trouble.name, "style": style, "seed": seed} | row
                    with rows.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(row) + "\n")
                    print(said(row), flush=True)


def said(row: Row) -> str:
    """A row in a line."""
    words = []
    for name in RATES:
        number = row["numbers"][name]
        share = off(number)
        words.append(f"{name.split('_')[0]} {'-' if share is None else f'{share:.2f}'}")
    return f"{row['seed']:3d} {row['style']:11s} {row['trouble']:25s} {' '.join(words)} {' '.join(row['flags'])}"


def off(number: Row) -> float | None:
    """Error over the half width of the interval on its side; None where nothing is given."""
    if number.get("low") is None:
        return None
    error = number["value"] - number["true"]
    width = number["value"] - number["low"] if error > 0 else number["high"] - number["value"]
    return float(abs(error) / max(width, 1e-300))


def flagged(row: Row) -> bool:
    """Whether the film has a flag that says that something is wrong."""
    return any(not flag.startswith(HARMLESS) for flag in row["flags"])


def counts(rows: Sequence[Row], names: Sequence[str] = (*RATES, ACROSS, HEADING)) -> dict[str, int]:
    """How many numbers are given, inside, far outside, and far outside without a flag."""
    shares = [
        (share, flagged(row))
        for row in rows
        for name in names
        if name in row["numbers"] and (share := off(row["numbers"][name])) is not None
    ]
    return {
        "given": len(shares),
        "inside": sum(share <= 1.0 for share, _ in shares),
        "far": sum(share > 2.0 for share, _ in shares),
        "unflagged": sum(share > 2.0 and not flag for share, flag in shares),
    }


def withheld(rows: Sequence[Row]) -> tuple[int, int]:
    """Films without a speed though it could be read off them, and films of which it could."""
    known = {trouble.name for trouble in TROUBLES if SPEED in trouble.known}
    could = [row for row in rows if row["trouble"] in known]
    return sum(off(row["numbers"][SPEED]) is None for row in could), len(could)


def percents(rows: Sequence[Row], name: str) -> str:
    """Median error, largest error, and median half width of a quantity, %."""
    given = [row["numbers"][name] for row in rows if off(row["numbers"][name]) is not None]
    given = [number for number in given if number["true"] != 0.0]
    if not given:
        return "-"
    errors = [100 * abs(number["value"] / number["true"] - 1) for number in given]
    widths = [50 * (number["high"] - number["low"]) / abs(number["true"]) for number in given]
    return f"{np.median(errors):.2g}/{max(errors):.2g}/{np.median(widths):.2g}"


def table(rows: Sequence[Row]) -> str:
    """The summary, Markdown."""
    seeds = len({row["seed"] for row in rows})
    styles = [style for style in STYLES if any(row["style"] == style for row in rows)]
    lines = [
        f"{len(rows)} videos, {len(styles)} styles, {seeds} seeds, {len(styles) * seeds} videos of each artifact.",
        "",
        "| Artifact | What becomes of it | Speed | Body rate | Tail rate | Inside | Far |",
        "|---|---|---|---|---|---|---|",
    ]
    for trouble in TROUBLES:
        own = [row for row in rows if row["trouble"] == trouble.name]
        if not own:
            continue
        count = counts(own)
        cells = [
            trouble.name,
            becomes(own),
            *(percents(own, name) for name in (SPEED, BODY, TAIL)),
            f"{count['inside']}/{count['given']}",
            far(count),
        ]
        lines.append(f"| {' | '.join(cells)} |")
    lines += [
        "",
        "| Style | Videos | Numbers inside | Far | No speed though it could be read |",
        "|---|---|---|---|---|",
    ]
    for style in (*styles, "all"):
        own = [row for row in rows if style in (row["style"], "all") and row["trouble"] != BELIEVED]
        count, (without, could) = counts(own), withheld(own)
        inside = f"{count['inside']} of {count['given']} ({100 * count['inside'] / max(count['given'], 1):.1f} %)"
        share = f"{without} of {could} ({100 * without / max(could, 1):.1f} %)"
        lines.append(f"| {style} | {len(own)} | {inside} | {far(count)} | {share} |")
    return "\n".join(lines)


def becomes(rows: Sequence[Row]) -> str:
    """What is given of a trouble's films, and how many are flagged, in words."""
    names = {"speed": SPEED, "body rate": BODY, "tail rate": TAIL}
    given = {what: sum(off(row["numbers"][name]) is not None for row in rows) for what, name in names.items()}
    if len(set(given.values())) == 1 and given["speed"] < len(rows):
        words = [f"all given in {given['speed']}" if given["speed"] else "withheld"]
    else:
        counted = ((what, count) for what, count in given.items() if count < len(rows))
        words = [f"{what} given in {count}" if count else f"{what} withheld" for what, count in counted]
    flags = sum(flagged(row) for row in rows)
    words.append("flagged" if flags == len(rows) else f"flagged in {flags}" if flags else "not flagged")
    return ", ".join(words) if len(words) > 1 else f"given, {words[0]}"


def far(count: dict[str, int]) -> str:
    """Numbers far outside, and how many of these without a flag, in words."""
    return "0" if not count["far"] else f"{count['far']}, unflagged {count['unflagged']}"


def write(text: str) -> None:
    """Put the summary between its markers in the page."""
    page = PAGE.read_text(encoding="utf-8")
    before, rest = page.split(BEGIN)
    PAGE.write_text(f"{before}{BEGIN}\n\n{text}\n\n{END}{rest.split(END, 1)[1]}", encoding="utf-8")


def main() -> None:
    """Draw, measure, count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("seeds", type=int, help="how many; 0: only the summary of the rows that are there")
    parser.add_argument("--first", type=int, default=0, help="number of the first seed")
    parser.add_argument("--rows", type=Path, default=Path("ledger-of-troubles.jsonl"))
    parser.add_argument("--only", nargs="+", help="names of troubles", choices=[trouble.name for trouble in TROUBLES])
    parser.add_argument("--style", nargs="+", help="styles", choices=STYLES, default=STYLES)
    parser.add_argument("--write", action="store_true", help="put the summary into docs/measuring-accuracy.md")
    asked = parser.parse_args()
    troubles = [trouble for trouble in TROUBLES if not asked.only or trouble.name in asked.only]
    run(range(asked.first, asked.first + asked.seeds), troubles, asked.rows, asked.style)
    text = table(rows_in(asked.rows))
    print(text)
    if asked.write:
        write(text)


if __name__ == "__main__":
    main()
