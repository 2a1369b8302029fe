"""Measured against truth: degraded (or clean) films of the virtual camera, with random speeds, rates and places.

    python benchmarks/measuring_virtual_trials.py 100 [--clean | --glare-fixed | --glare-alone] [--keep FOLDER]
        [--duration 60] [--slow] [--speeds 0.8 4] [--first 200]

Synthetic throughout. Prints errors and whether the 95 % intervals hold the truth, and how much faster than real time
`measure` was. A hundred trials take an hour of one core, most of it for drawing the films.
"""

import argparse
import json
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import spirillum as sp

QUANTITIES = ("forward_velocity", "body_rotation_rate", "tail_rotation_rate")
STYLES: dict[str, str | dict[str, Any]] = {
    "clean": "clean",
    "degraded": "degraded",
    "glare-fixed": {"preset": "degraded", "glare_moves": False},
    "glare-alone": {"preset": "clean", "glare": 0.2, "glare_moves": False},
}
"""Degradations by the names of their films."""
SPEEDS = (0.1, 1.5)
"""Slowest and fastest robot, mm/s."""
SLOW_SPEED, SLOW_BODY = 0.2, 0.02
"""mm/s and Hz below which a trial is slow."""


def between(rng: np.random.Generator, low: float, high: float) -> float:
    """A number that is as likely in every octave."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def drawn(number: int, speeds: Sequence[float] = SPEEDS) -> tuple[np.random.Generator, float, float, float]:
    """The random numbers of a trial: for more of them, speed (mm/s), and rates of tail and body (Hz)."""
    rng = np.random.default_rng(1000 + number)
    return rng, between(rng, *speeds), between(rng, 0.2, 5.0), between(rng, 0.01, 0.3)


def is_slow(number: int) -> bool:
    """Whether the robot of a trial swims or turns slowly."""
    _, speed, _, body = drawn(number)
    return speed < SLOW_SPEED or body < SLOW_BODY


def rendered(folder: Path, number: int, style: str, duration: float, speeds: Sequence[float]) -> Path:
    """A film with random truth, and its setup and truth beside it; one that is there is kept."""
    film = folder / f"{style}-{number:03d}.mp4"
    if film.with_suffix(".truth.json").exists():
        return film
    rng, speed, tail, body = drawn(number, speeds)
    camera = {
        "view": "side" if rng.random() < 0.2 else "top",
        "direction": "left" if rng.random() < 0.5 else "right",
    }
    trial = {
        "duration": duration,
        "body_angle": float(rng.uniform(0.0, 2.0 * np.pi)),
        "tail_phase": float(rng.uniform(0.0, 2.0 * np.pi)),
        "lateral": float(rng.uniform(-2e-3, 2e-3)),
        "heading": float(np.radians(rng.uniform(-1.5, 1.5))),
    }
    sp.render(
        str(rng.choice(["biorob2012-wide", "biorob2012-narrow"])),
        film,
        motion={"forward_velocity": f"{speed} mm/s", "tail_rate": f"{tail} Hz", "body_rate": f"{-body} Hz"},
        trial=trial,
        camera=camera,
        degradation=STYLES[style],
        seed=number,
    )
    return film


def main() -> None:
    """Render, measure, compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("trials", type=int)
    style = parser.add_mutually_exclusive_group()
    style.add_argument("--clean", dest="style", action="store_const", const="clean", default="degraded")
    style.add_argument(
        "--glare-fixed",
        dest="style",
        action="store_const",
        const="glare-fixed",
        help="degraded, with glare that stands still in the lab instead of moving with the body",
    )
    style.add_argument(
        "--glare-alone",
        dest="style",
        action="store_const",
        const="glare-alone",
        help="clean, but for glare that stands still",
    )
    parser.add_argument("--keep", type=Path, help="folder for the films")
    parser.add_argument("--duration", type=float, default=20.0, help="of a film, s")
    parser.add_argument("--slow", action="store_true", help="only trials of slow robots")
    parser.add_argument("--speeds", type=float, nargs=2, default=SPEEDS, help="slowest and fastest robot, mm/s")
    parser.add_argument("--first", type=int, default=0, help="number of the first trial, by which all is random")
    asked = parser.parse_args()
    numbers = [number for number in range(asked.first, asked.first + asked.trials) if is_slow(number) or not asked.slow]
    errors: dict[str, list[float]] = {name: [] for name in QUANTITIES}
    inside: dict[str, list[bool]] = {name: [] for name in QUANTITIES}
    spent = 0.0
    with TemporaryDirectory() as temporary:
        folder = asked.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        for number in numbers:
            film = rendered(folder, number, asked.style, asked.duration, asked.speeds)
            start = time.perf_counter()
            measured = sp.measure([film], film.with_suffix(".setup.toml"), annotated=False)
            spent += time.perf_counter() - start
            trial = measured.to_dict()["trials"][0]
            truth = json.loads(film.with_suffix(".truth.json").read_text(encoding="utf-8"))
            words = []
            for name in QUANTITIES:
                found, true = trial[name], truth[name]["value"]
                if found.get("value") is None:
                    words.append(f"{name} not given")
                    continue
                errors[name].append(100.0 * (found["value"] / true - 1.0))
                inside[name].append(found["low"] <= true <= found["high"])
                words.append(f"{name} {errors[name][-1]:+.3f} %{'' if inside[name][-1] else ' outside'}")
            flags = " ".join(flag["name"] for flag in trial["flags"])
            print(film.stem, ", ".join(words), flags, flush=True)
    for name in QUANTITIES:
        size = np.abs(errors[name])
        missing = len(numbers) - len(inside[name])
        print(
            f"{name}: {sum(inside[name])} of {len(inside[name])} inside, {missing} not given; error "
            f"median {np.median(size):.3f} %, 90 % below {np.quantile(size, 0.9):.3f} %, largest {size.max():.3f} %"
        )
    print(f"{len(numbers) * asked.duration / spent:.1f} times faster than real time")


if __name__ == "__main__":
    main()
