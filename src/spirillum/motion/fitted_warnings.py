"""What has to be said where fitted numbers are used: whose B_eff it is, under which reading, and on what it rests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from spirillum.motion.posterior_file import PosteriorFile
from spirillum.robot.calibration_file import CalibrationFile, FittedFriction, friction_of_tails, read_calibration
from spirillum.robot.robot import Robot

__all__ = ["Fitted", "fitted_of"]


@dataclass(frozen=True)
class Fitted:
    """What a calibration file or a posterior says of its friction and its origin."""

    friction: tuple[FittedFriction, ...] = ()
    """B_eff, tail by tail."""
    reading: str = ""
    """Reading of the friction under which it was inferred."""
    synthetic: str = ""
    """Name of the observations, if they say that they are synthetic."""

    def origin_warnings(self) -> list[str]:
        """Whether anything of it was measured."""
        if not self.synthetic:
            return []
        return [
            f"{self.synthetic} says that its numbers are synthetic: what was fitted to them rests on no measurement"
        ]

    def reading_warnings(self, readings: Sequence[str]) -> list[str]:
        """Whether B_eff is used under another reading than the one under which it was inferred.

        Args:
            readings: those that are asked.
        """
        other = [name for name in readings if name in ("rotor", "paper") and name != self.reading]
        if not (self.friction and self.reading and other):
            return []
        return [
            f"B_eff was inferred under friction reading '{self.reading}' and is used under '{other[0]}', where it "
            "means another torque: rates and speeds of that reading do not follow from the observations"
        ]

    def tail_warnings(self, robot: Robot) -> list[str]:
        """Whose B_eff a robot that is driven by its own motor has."""
        own, others = friction_of_tails(robot, self.friction)
        if own is not None and own > 0:
            return []
        if own is not None:
            return [
                "B_eff of this tail came out negative in the calibration: zero is used, and the rates are upper bounds"
            ]
        if not others:
            return []
        return [
            f"B_eff of this tail was not fitted: the middle of {len(others)} fitted tails is used, "
            f"{np.median(others):.4g} N m s/rad; they range from {min(others):.4g} to {max(others):.4g}"
        ]

    def tails_warnings(self, robots: Sequence[Robot]) -> list[str]:
        """The same for many robots, in one sentence."""
        found = [friction_of_tails(robot, self.friction) for robot in robots]
        unknown = sum(1 for own, others in found if own is None and others)
        zero = sum(1 for own, _ in found if own is not None and own <= 0)
        sentences = []
        if unknown:
            sentences.append(
                f"B_eff of {unknown} of {len(robots)} tails was not fitted: the middle of the fitted tails in their "
                "channel is used, and intervals hold their spread"
            )
        if zero:
            sentences.append(
                f"B_eff of {zero} of {len(robots)} tails came out negative in the calibration: zero is used"
            )
        return sentences


def fitted_of(calibration: str | Path | CalibrationFile | None, posterior: PosteriorFile | None) -> Fitted:
    """What the file that is used says.

    Args:
        calibration: calibration file; None without one.
        posterior: posterior; None without one.

    Raises:
        InputError: if the calibration file is wrong.
    """
    if posterior is not None:
        source = posterior.observations if posterior.synthetic else ""
        return Fitted(posterior.frictions, posterior.friction_reading, source)
    if calibration is None:
        return Fitted()
    file = calibration if isinstance(calibration, CalibrationFile) else read_calibration(calibration)
    provenance = file.provenance
    synthetic = (provenance.observations or "the calibration") if provenance.synthetic else ""
    return Fitted(file.friction, provenance.friction_reading, synthetic)
