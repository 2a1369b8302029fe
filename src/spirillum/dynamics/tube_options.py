"""Settings of a run in a tube beside the placement: azimuth, waiting time, dry friction, and a flow over time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from pydantic import BeforeValidator

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.fitted.calibration_file import FittedContact
from spirillum.formats.tables import read_series
from spirillum.robot.arguments import Options, in_range, refusal
from spirillum.robot.fields import Angle, Time
from spirillum.robot.load import with_resolution
from spirillum.robot.model_options import Resolution
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.units import KINDS, parse_option

TRIAL_WAIT = 60.0  #: Default time from release until the motor is switched on, s; assumed.
FLOW_COLUMNS = ("time_s", "flow_mm_s")
"""Columns of a flow file; between its rows the flow changes evenly, before and after them it is constant."""
_WHAT = "a flow file (CSV with the columns time_s and flow_mm_s)"
_LARGEST = 64 << 20
_LIMITS = dict(zip(FLOW_COLUMNS, ((0.0, 1e9), (-1e6, 1e6)), strict=True))


def _file(what: str) -> BeforeValidator:
    """None, or the path of a file that is described in these words."""

    def path(value: Any) -> Any:
        if not (value is None or isinstance(value, (str, Path))):
            raise refusal(f"= {str(value)[:40]}; allowed: {what}")
        return value

    return BeforeValidator(path)


class InTube(Options):
    """Start, surroundings and contact of a run in a tube, beside its placement."""

    argument: ClassVar[str] = "in_tube"
    prefixed: ClassVar[bool] = True

    azimuth: Angle = 0.0
    """Azimuth of the body's centre about +x from the lowest point of the tube.
    """
    wait: Time | None = None
    """Waiting time after release with the drive off, before the run; None: 60 s, as in a trial, in a flow none."""
    friction_coefficient: Annotated[float | None, BeforeValidator(in_range(0.0, 10.0))] = None
    """Coefficient of dry friction where asperities touch; None: 0.1, assumed; plausible 0 to 0.3, allowed 0 to 10."""
    flow: Annotated[str | Path | None, _file("a flow file; a constant flow is placement.flow")] = None
    """File of the mean flow over time, CSV with the columns `time_s`, `flow_mm_s`, instead of `placement.flow`."""
    continued: Annotated[str | Path | None, _file("the file of a run in a tube, by `spirillum simulate`")] = None
    """File of a run of the robot that ended early, continued after its last sample as if it had not ended."""

    def of_trial(self, placed: Placement) -> InTube:
        """These settings with the waiting time of a trial where none is given."""
        given = self.wait is not None or self.continued is not None
        moved = self.flow is not None or placed.flow is not None
        return self if given else self.model_copy(update={"wait": 0.0 if moved else TRIAL_WAIT})


class Release(NamedTuple):
    """Where and how a robot is released in its tube."""

    placement: Placement
    in_tube: InTube
    roughness: float | None = None  #: Height of the asperities, m; None: 1e-4 of the body's radius.
    weight: bool = True  #: Whether weight and buoyancy act.

    @classmethod
    def of(
        cls,
        placement: Placement | Mapping[str, Any] | None,
        in_tube: InTube | Mapping[str, Any] | None,
        roughness: str | float | None,
        *,
        weight: bool = True,
    ) -> Release:
        """From what a caller gives; a roughness with its unit, or a float in m."""
        height = None if roughness is None else parse_option("roughness", roughness, KINDS["length"])
        return cls(Placement.of(placement), InTube.of(in_tube), height, weight)

    def with_contact(self, contact: FittedContact) -> Release:
        """The release with fitted values in place of those that are not given."""
        requested = self.in_tube
        if requested.friction_coefficient is None and contact.friction_coefficient is not None:
            requested = requested.model_copy(update={"friction_coefficient": contact.friction_coefficient})
        return self._replace(
            in_tube=requested, roughness=contact.roughness if self.roughness is None else self.roughness
        )


def check_not_resolved(robot: Robot, resolution: Resolution | Mapping[str, Any] | None) -> None:
    """Refuse a resolution of free motion in the tube, which reads the robot's table at every phase."""
    with_resolution(robot, resolution, "tube")  # a wrong value has a sentence of its own
    for name, value in Resolution.of(resolution).model_dump(exclude_none=True).items():
        if (name, value) not in (("form", "auto"), ("form", "table")):
            raise InputError(
                f"{name} = {value!r} with model 'tube' and motion 'free', which reads the robot's table at every phase "
                "of the tail; allowed: motion 'held'"
            )


def read_flow(path: str | Path) -> Samples:
    """Read and check a flow file: times, s, and velocities, m/s, (n, 2)."""
    found = read_series(path, _WHAT, _LIMITS, _LARGEST)
    return np.array(found) * (1.0, 1e-3)
