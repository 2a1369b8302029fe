"""What `setup propose` finds in films of the virtual camera, against their truth; the ruler's spacing is given.

    python benchmarks/proposing_setups.py 30 [--keep FOLDER]

Synthetic throughout: robots in both tubes, both directions, three sizes of picture, clean and degraded, some with
troubles. All is right where robot with its channel, direction, ruler (within 1 %), travel and stripes are. Ten minutes
of one core.
"""

import argparse
import json
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import spirillum as sp
from spirillum.robot.load import PAPER_ROBOTS

TROUBLES = (None, None, "rolled", "lost-frames", "uneven-stripes")
SIZES = ("640x480", "320x240", "800x600")


def rendered(folder: Path, number: int) -> Path:
    """A film with random truth, and its setup and truth beside it; one that is there is kept."""
    film = folder / f"film-{number:02d}.mp4"
    if film.with_suffix(".truth.json").exists():
        return film
    rng = np.random.default_rng(7000 + number)

    def between(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    robot, speed, tail, body = str(rng.choice(PAPER_ROBOTS)), between(0.4, 3.0), between(0.5, 4.0), between(0.03, 0.3)
    trouble = TROUBLES[rng.integers(len(TROUBLES))]
    sp.render(
        robot,
        film,
        motion={"forward_velocity": f"{speed} mm/s", "tail_rate": f"{tail} Hz", "body_rate": f"{-body} Hz"},
        trial={
            "duration": float(rng.uniform(3.0, 6.0)),
            "body_angle": float(rng.uniform(0.0, 2.0 * np.pi)),
            "tail_phase": float(rng.uniform(0.0, 2.0 * np.pi)),
            "lateral": float(rng.uniform(-3e-3, 3e-3)),
            "heading": float(np.radians(rng.uniform(-2.0, 2.0))),
        },
        camera={
            "direction": "left" if rng.random() < 0.5 else "right",
            "size": str(rng.choice(SIZES)),
            "view": "side" if rng.random() < 0.15 else "top",
        },
        degradation="degraded" if rng.random() < 0.5 else "clean",
        troubles=trouble,
        seed=number,
    )
    return film


def ruler_pixels(truth: dict[str, object]) -> float:
    """Distance of the ruler's lines in the middle of the picture, pixels: an upright camera above oil."""
    camera = truth["camera"]
    eye, surface = camera["height"]["value"], camera["surface"]["value"]
    return camera["focal_length_pixels"] * 2e-3 / (eye - surface + surface / camera["index"])


def wrong_in(found: sp.Proposal, truth: dict[str, object]) -> list[str]:
    """Names of what was not found, or is not as it is."""
    wanted = {
        "robot": truth["robot"],
        "direction": truth["direction"],
        "stripes": list(sp.load(truth["robot"]).seal.stripes),
    }
    seen = {finding.name: finding.value for finding in found.findings}
    wrong = [name for name, value in wanted.items() if seen.get(name) != value]
    if seen["ruler"] is None or abs(seen["ruler"] / ruler_pixels(truth) - 1.0) > 0.01:
        wrong.append("ruler")
    if not seen.get("travel", 0.0) > 0.0:
        wrong.append("travel")
    return wrong


def main() -> None:
    """Render, propose, compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("films", type=int)
    parser.add_argument("--keep", type=Path, help="folder for the films")
    asked = parser.parse_args()
    right, spent = 0, []
    with TemporaryDirectory() as temporary:
        folder = asked.keep or Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        for number in range(asked.films):
            film = rendered(folder, number)
            start = time.perf_counter()
            found = sp.propose_setup(film, spacing="2 mm")
            spent.append(time.perf_counter() - start)
            truth = json.loads(film.with_suffix(".truth.json").read_text(encoding="utf-8"))
            wrong = wrong_in(found, truth)
            right += not wrong
            print(
                film.name, "all right" if not wrong else f"wrong: {', '.join(wrong)}", f"{spent[-1]:.1f} s", flush=True
            )
    print(
        f"{right} of {asked.films} all right; {np.median(spent):.1f} s a film in the median, {max(spent):.1f} s at most"
    )


if __name__ == "__main__":
    main()
