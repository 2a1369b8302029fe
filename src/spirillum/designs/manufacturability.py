"""What a bench can wind and a tube can hold: conditions that every design keeps."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from spirillum.errors import InputError
from spirillum.robot.arguments import Options
from spirillum.robot.batch import RobotBatch
from spirillum.robot.fields import LengthOrZero
from spirillum.robot.geometry import coil_curvature
from spirillum.robot.limits import Limit
from spirillum.units import show


class Manufacturability(Options):
    """How tightly a wire is wound, and how far the tail stays off the glass."""

    argument: ClassVar[str] = "bench"
    prefixed: ClassVar[bool] = True

    mandrel: Annotated[float, Field(ge=0.0, le=100.0)] = 1.0
    """Least bending diameter of the wire, in wire diameters (IEC 60851-3, mandrel winding)."""
    clearance: LengthOrZero | None = None
    """Least distance between the tail on the tube's axis and the glass; None: one wire diameter."""

    def check(self, designs: RobotBatch) -> None:
        """Refuse a clearance that no design leaves, before any of them is swum.

        Args:
            designs: some of them, with the widest channel, the thinnest wire and the smallest amplitude of all.

        Raises:
            InputError: if there is none.
        """
        room = 0.5 * float(designs.channel_diameter.max() - designs.wire_diameter.min())
        amplitude = float(designs.amplitude.min())
        most = room - amplitude
        if self.clearance is not None and 0.0 <= most < self.clearance:
            raise InputError(
                f"bench.clearance = {show(self.clearance, 'mm')}; allowed: at most {show(most, 'mm')}, which the tube "
                f"leaves beside a tail of {show(amplitude, 'mm')} amplitude"
            )

    def limits(self, batch: RobotBatch) -> list[Limit]:
        """The conditions, for every robot of a batch."""
        wire = batch.wire_diameter
        curvature = coil_curvature(batch.wavelength, batch.amplitude)
        clearance = wire if self.clearance is None else np.full(1, self.clearance)
        return [
            Limit.of(
                "tail.amplitude",
                batch.amplitude,
                "at most",
                0.5 * (batch.channel_diameter - wire) - clearance,
                "mm",
                "a tail on the tube's axis keeps bench.clearance off the glass",
                "too-near-the-glass",
            ),
            Limit.of(
                "radius of curvature of the tail",
                1.0 / curvature,
                "at least",
                0.5 * (1.0 + self.mandrel) * wire,
                "mm",
                "the wire is bent around no less than bench.mandrel of its diameters",
                "bent-too-tightly",
            ),
        ]
