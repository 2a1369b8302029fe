"""Draw the pictures of README and pages: the robot from its file, flat and in space, its wire, the flow around it."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import av
from frenet_figure import frenet_figure

import spirillum as sp
from spirillum.view.figures.design import design_figure
from spirillum.view.figures.flow import flow_figure
from spirillum.view.figures.magnetic import magnetic_figure
from spirillum.view.figures.robot import robot_figure
from spirillum.view.figures.trajectory import trajectory_figure

FOLDER = Path(__file__).parent.parent / "docs" / "images"


def _frame(film: Path, number: int) -> Any:
    """One frame of a film."""
    with av.open(str(film)) as container:
        for count, frame in enumerate(container.decode(video=0)):
            if count == number:
                return frame.to_image()
    raise ValueError(number)


if __name__ == "__main__":
    flow = sp.flow("biorob2012-wide", model="slender", tail_rate="1.2 Hz")
    tilted = sp.load("magnetic-helix", **{"magnetic.moment_angle": "75 deg"})
    best = sp.design(
        "biorob2012-wide",
        {"tail.wavelength": "10 mm:40 mm", "tail.amplitude": "1 mm:5 mm"},
        maximise="forward_velocity",
        subject_to=["tail_rotation_rate >= 0.8 Hz"],
        unknown={"friction.effective": "5e-6 N m s/rad:2e-5 N m s/rad"},
        model="sbt",
    )
    pictures = {
        "design": (design_figure(best), 150),
        "overview": (robot_figure(sp.load("biorob2012-wide")), 150),
        "flow": (flow_figure(flow, flow.plane("xz")), 150),
        "magnetic-sweep": (magnetic_figure(sp.magnetic_sweep(tilted)), 150),
        "tube-run": (trajectory_figure(sp.simulate("biorob2012-wide", timing={"duration": "20 s"})), 200),
        "frenet": (frenet_figure(sp.load("biorob2012-wide")), 120),
    }
    for name, (figure, dpi) in pictures.items():
        target = FOLDER / f"{name}.png"
        figure.savefig(target, dpi=dpi, metadata={"Software": None})
        print(target.name, target.stat().st_size, "bytes")
    with TemporaryDirectory() as name:
        folder = Path(name)
        sp.render(
            "biorob2012-wide",
            folder / "trial.mp4",
            motion={"tail_rate": "1.2 Hz"},
            trial={"duration": "4 s"},
            degradation="degraded",
        )
        sp.measure([folder / "trial.mp4"], folder / "trial.setup.toml", output=folder)
        frame = _frame(folder / "trial.annotated.mp4", 60)
        frame.save(FOLDER / "measured.png")
    target = FOLDER / "robot3d.png"
    target.unlink(missing_ok=True)
    sp.show("biorob2012-wide", target, phase="30 deg")
    print(target.name, target.stat().st_size, "bytes")
