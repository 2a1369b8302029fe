"""The fluid on the plane of the axis of a robot of the page, in a process of its own; run by `spirillum.pages.job`."""

from __future__ import annotations

import base64
import tomllib
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.pages.job import Job, worker
from spirillum.pages.numbers import axial_forces_of
from spirillum.robot.robot import Robot
from spirillum.robot.text import robot_text

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Flowing", "plane_shown"]

_RESOLUTION = 96
"""Points along the plane."""
_COARSE: Mapping[str, Any] = {"tolerance": 0.05}
"""Of the tube's flow: the plane is a picture."""
_FASTEST = 0.98
"""Share of the points that are slower than what has the fullest colour."""


class Flowing(Job):
    """A flow on its way, and the plane once it is there."""

    def __init__(
        self, robot: Robot, model: str, run: Mapping[str, str], phase: float, tell: Callable[[], None]
    ) -> None:
        """Begin.

        Args:
            robot: the robot that swims.
            model: model by which it swims.
            run: `gap`, `pitch`, `flow` where they are set.
            phase: of the tail, rad.
            tell: called from a thread when there is progress.
        """
        asked = {"robot": robot_text(robot), "model": model, "run": dict(run), "phase": phase}
        super().__init__(__name__, asked, tell)

    def told(self) -> dict[str, Any]:
        """How it goes, without the plane itself."""
        said = self.progress()
        return {name: said[name] for name in ("what", "failed", "done") if name in said}


def plane_shown(plane: xr.Dataset, phase: float) -> dict[str, Any]:
    """A plane of the flow as the page draws it: velocities along x and z in rows of rising z, m/s, NaN in solids.

    Args:
        plane: what `Flow.plane` returns for `xz`.
        phase: of the tail, rad.
    """
    velocity = [plane[name].transpose("z", "x").values for name in ("velocity_x", "velocity_z")]
    speed = np.hypot(*velocity)
    warnings = [line for line in str(plane.attrs.get("warnings", "")).split("\n") if line]
    return {
        "model": plane.attrs["model"],
        "phase": phase,
        "size": [plane.sizes["x"], plane.sizes["z"]],
        "x": [float(plane["x"].min()), float(plane["x"].max())],
        "z": [float(plane["z"].min()), float(plane["z"].max())],
        "fastest": float(np.nanquantile(speed, _FASTEST)),
        "velocity": [base64.b64encode(part.astype("<f4").tobytes()).decode() for part in velocity],
        "warnings": warnings,
    }


def _flowing(request: dict[str, Any], progress: Callable[[str, int, int], None]) -> dict[str, Any]:
    from spirillum.fields.flow import FLOW_MODELS, flow

    model = request["model"] if request["model"] in FLOW_MODELS else "slender"
    walled = model == "tube"
    progress("solving for the flow", 0, 0)
    around = flow(
        tomllib.loads(request["robot"]),
        model=model,
        placement=request["run"] if walled else None,
        resolution=_COARSE if walled else None,
        phase=request["phase"],
    )
    shown = plane_shown(around.plane("xz", resolution=_RESOLUTION, progress=progress), request["phase"])
    forces = axial_forces_of(around.prediction) if walled else []  # without walls they stand beside the numbers
    return {"plane": shown | {"forces": forces}}


if __name__ == "__main__":
    worker(_flowing)
