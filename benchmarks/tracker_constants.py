"""What the tuned constants of the tracker do: each is halved and doubled, and rates are compared with the truth.

    python benchmarks/tracker_constants.py [--keep FOLDER] [--stages STRIPES,TAIL] [--all]

Synthetic throughout: a few short films of the virtual camera at 320 x 240 pixels, clean and degraded. Prints Markdown:
constants that change an error, or cost a number, in a table, and the names of all others. Twenty minutes of one core.
Stages that only decide on warnings are varied with `--all`.
"""

import argparse
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import spirillum as sp
from spirillum.vision.track import colours, constants, contour, cuts, search, steadiness, steps

QUANTITIES = ("forward_velocity", "body_rotation_rate", "tail_rotation_rate")
MODULES = (constants, search, contour, steps, colours, steadiness, cuts)
"""Of the tracker, each with the constants of its stages."""
STAGES = ("SEARCH", "CONTOUR", "OUTLINE", "DETECTION", "FOLLOWING", "COLOURS", "STRIPES", "TAIL", "UNWRAPPING")
WARNINGS = ("SIZE", "IDENTITY", "STEADINESS", "CUTS", "VISIBILITY")
"""Stages whose constants decide on warnings, not on numbers."""
FILMS = (
    {"robot": "biorob2012-wide", "degradation": "clean", "speed": 0.8, "tail": 1.3, "body": -0.11},
    {"robot": "biorob2012-wide", "degradation": "degraded", "speed": 0.6, "tail": 2.1, "body": -0.16},
    {"robot": "biorob2012-narrow", "degradation": "degraded", "speed": 1.2, "tail": 3.7, "body": -0.24},
)
"""Speeds in mm/s, rates in Hz."""
DURATION = 4.0
"""Of a film, s."""
CHANGE = 0.1
"""Change of a root mean square error, over that with the constants as they are, from which on a constant is listed."""


def rendered(folder: Path) -> list[Path]:
    """The films; those that are there are kept."""
    films = []
    for number, film in enumerate(FILMS):
        path = folder / f"film-{number}.mp4"
        films.append(path)
        if not path.with_suffix(".truth.json").exists():
            sp.render(
                str(film["robot"]),
                path,
                motion={
                    "forward_velocity": f"{film['speed']} mm/s",
                    "tail_rate": f"{film['tail']} Hz",
                    "body_rate": f"{film['body']} Hz",
                },
                trial={"duration": DURATION},
                camera={"size": "320x240"},
                degradation=str(film["degradation"]),
                seed=number,
            )
    return films


def errors(films: list[Path]) -> np.ndarray:
    """Errors of the three rates on each film, %, NaN where a number is not given, (films, 3)."""
    found = np.full((len(films), len(QUANTITIES)), np.nan)
    for row, film in zip(found, films, strict=True):
        try:
            measured = sp.measure([film], film.with_suffix(".setup.toml"), annotated=False)
        except (sp.InputError, ValueError):  # half or twice may be beyond what the tracker can work with
            continue
        trial = measured.to_dict()["trials"][0]
        truth = json.loads(film.with_suffix(".truth.json").read_text(encoding="utf-8"))
        for place, name in enumerate(QUANTITIES):
            value = trial[name].get("value")
            row[place] = np.nan if value is None else 100.0 * (value / truth[name]["value"] - 1.0)
    return found


@contextmanager
def changed(stage: Any, name: str, value: object) -> Iterator[None]:
    """Change one constant for a while; every module of the tracker holds this very object."""
    usual = getattr(stage, name)
    object.__setattr__(stage, name, value)
    try:
        yield
    finally:
        object.__setattr__(stage, name, usual)


def varied(value: object, factor: float) -> object | None:
    """A number times a factor, whole ones at least 1; None for what is no number."""
    if isinstance(value, int):
        return max(1, round(value * factor))
    return value * factor if isinstance(value, float) else None


def size(found: np.ndarray) -> np.ndarray:
    """Root mean square error of each rate, NaN where it is not given on some film."""
    return np.sqrt(np.mean(found**2, axis=0))


def cells(found: np.ndarray) -> str:
    """Root mean square errors for a table; where numbers are missing, on how many films they are given."""
    given = np.isfinite(found).sum(axis=0)
    texts = [f"{one:.2f}" for one in size(found)]
    return " | ".join(
        text if count == len(found) else f"given on {count}" for text, count in zip(texts, given, strict=True)
    )


def main() -> None:
    """Render, vary, compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--keep", type=Path, help="folder for the films")
    parser.add_argument("--stages", help="names of stages, separated by commas")
    parser.add_argument("--all", action="store_true", help="also stages that only decide on warnings")
    asked = parser.parse_args()
    stages = asked.stages.split(",") if asked.stages else [*STAGES, *(WARNINGS if asked.all else ())]
    with TemporaryDirectory() as temporary:
        folder = asked.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        films = rendered(folder)
        usual = errors(films)
        print("| Constant | Value | times | speed, % | body rate, % | tail rate, % |")
        print("|---|---|---|---|---|---|")
        print(f"| all as they are | | | {cells(usual)} |", flush=True)
        unchanged, skipped = [], []
        for stage_name in stages:
            stage = next(getattr(module, stage_name) for module in MODULES if hasattr(module, stage_name))
            for field in fields(stage):
                name, value, listed = f"`{stage_name}.{field.name}`", getattr(stage, field.name), False
                for factor, shown in ((0.5, "½"), (2.0, "2")):
                    other = varied(value, factor)
                    if other is None or other == value:
                        continue
                    with changed(stage, field.name, other):
                        found = errors(films)
                    apart = np.abs(size(found) - size(usual)) > CHANGE * size(usual)
                    if apart.any() or not np.isfinite(found).all():
                        print(f"| {name} | {value:.3g} | {shown} | {cells(found)} |", flush=True)
                        listed = True
                if varied(value, 2.0) is None:
                    skipped.append(name)
                elif not listed:
                    unchanged.append(name)
    print(f"\nWithin {CHANGE:.0%} of these errors, halved and doubled: {', '.join(unchanged)}.")
    print(f"\nNot varied, being lists: {', '.join(skipped)}.")


if __name__ == "__main__":
    main()
