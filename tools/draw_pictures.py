"""Draw the pictures of the README: the paper's robot from its robot file, and the flow around it."""

from pathlib import Path

import spirillum as sp
from spirillum.plots.flow import flow_figure
from spirillum.plots.robot import robot_figure

FOLDER = Path(__file__).parent.parent / "docs" / "images"

if __name__ == "__main__":
    flow = sp.flow("biorob2012-wide", tail_rate="1.2 Hz")
    pictures = {
        "overview": (robot_figure(sp.load("biorob2012-wide")), 150),
        "flow": (flow_figure(flow, flow.plane("xz")), 90),
    }
    for name, (figure, dpi) in pictures.items():
        target = FOLDER / f"{name}.png"
        figure.savefig(target, dpi=dpi, metadata={"Software": None})
        print(target.name, target.stat().st_size, "bytes")
