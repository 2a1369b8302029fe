"""Draw the picture of docs/walls.md: the body's true drag, and the factor that inverting the paper's kinematics finds.

A few minutes without kept answers; the robot is the paper's, tail 25 mm, 2.5 mm.
"""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

import spirillum as sp
from spirillum.view.figures.style import COLOURS, new_figure, styled

TARGET = Path(__file__).parent.parent / "docs" / "images" / "walls.png"
TUBES = {"wide": (COLOURS["blue"], "o", 1.95), "narrow": (COLOURS["vermillion"], "s", 3.6)}
"""Colour, marker and Table III's factor of each tube."""
DRAG_GAPS = np.array([0.1, 0.2, 0.3, 0.5, 0.7, 1.0])
GAPS = np.array([0.3, 0.5, 1.0])
FILM = 0.5
"""Film between glass and wire where the tail lies along the floor, mm."""


def drag_factor(robot: str, gap: float) -> float:
    """Axial drag of the body in the tube over that of Perrin's spheroid."""
    place = {"gap": f"{gap} mm", "pitch": "0 deg"}
    drags = [
        sp.resistance(robot, part="body", model=model, **more).matrix[0, 0]
        for model, more in (("tube", {"placement": place}), ("perrin", {}))
    ]
    return float(drags[0] / drags[1])


def inverted(robot: str, speed: float, tail_rate: float) -> float:
    """Factor on the body's drag with which an unbounded tail (SBT) beside it has that speed, eq. (15)."""
    body = sp.resistance(robot, part="body", model="perrin").matrix[0, 0]
    tail = sp.resistance(robot, part="tail", model="sbt").matrix
    return float(-(tail[0, 0] * speed + tail[0, 3] * tail_rate) / (body * speed))


def factors(robot: str, gap: float) -> tuple[float, float, float]:
    """Inverted factors: level, nose up until the tail's tip is at the floor, tail along the floor."""
    fields = sp.load(robot)
    tail, body = fields.tail, fields.body
    drop = 1e3 * (0.5 * body.diameter - tail.amplitude - 0.5 * tail.wire_diameter) + gap - FILM
    asked: dict[str, Any] = {"model": "tube", "tail_rate": "1.2 Hz"}
    raised = sp.predict(robot, **asked, placement={"gap": f"{gap} mm"})
    level_floor = {"gap": f"{gap} mm", "pitch": "0 deg", "tail_drop": f"{drop} mm"}
    along = sp.predict(robot, **asked, placement=level_floor, resolution={"tolerance": 0.05})
    if raised.band is None:
        raise RuntimeError("the pitch was left open")
    speeds = raised.forward_velocity, float(raised.band.swimming.forward_velocity[-1]), along.forward_velocity
    level, tip, floor = (inverted(robot, speed, raised.tail_rotation_rate) for speed in speeds)
    return level, tip, floor


def panel(axes: Axes, title: str) -> None:
    """Dress a panel."""
    axes.set_title(title, loc="left")
    axes.set_xlabel("gap under the body (mm)")
    axes.set_ylim(0.0, 18.0)
    axes.set_xlim(0.05, 1.05)


def draw() -> None:
    """Compute, draw, save."""
    with styled():
        figure = new_figure(7.6, 4.1)
        left, right = figure.subplots(1, 2, sharey=True)
        ways = (("level", "-"), ("tip at the floor", (0, (5, 2))), ("tail along the floor", (0, (1, 1.5))))
        for name, (colour, marker, table) in TUBES.items():
            robot = f"biorob2012-{name}"
            drags = [drag_factor(robot, gap) for gap in DRAG_GAPS]
            left.plot(DRAG_GAPS, drags, color=colour, marker=marker, label=f"{name} tube")
            found = np.array([factors(robot, gap) for gap in GAPS])
            print(name, "drag", np.round(drags, 2), "inverted", np.round(found, 2).tolist())
            for number, (words, line) in enumerate(ways):
                right.plot(
                    GAPS, found[:, number], color=colour, marker=marker, linestyle=line, label=f"{name}, {words}"
                )
            right.axhline(table, color=colour, linewidth=0.9, alpha=0.6)
            right.text(1.04, table + 0.12, f"paper, {name}: {table:g}", color=colour, ha="right", va="bottom", size=8)
        panel(left, "a) body's drag in the tube / Perrin's")
        panel(right, "b) factor that inverting (15) finds")
        for axes in (left, right):
            axes.legend(
                loc="upper right" if axes is right else "upper left", ncol=2 if axes is right else 1, fontsize=7
            )
        figure.tight_layout()
        figure.savefig(TARGET, dpi=150, metadata={"Software": None})


if __name__ == "__main__":
    draw()
    print(TARGET.name, TARGET.stat().st_size, "bytes")
