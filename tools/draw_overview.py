"""Draw the picture that opens the README: the paper's robot in its wide channel, from its robot file."""

from pathlib import Path

import spirillum as sp
from spirillum.plots.robot import robot_figure

TARGET = Path(__file__).parent.parent / "docs" / "images" / "overview.png"

if __name__ == "__main__":
    robot_figure(sp.load("biorob2012-wide")).savefig(TARGET, dpi=150, metadata={"Software": None})
    print(TARGET.name, TARGET.stat().st_size, "bytes")
