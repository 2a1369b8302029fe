"""From observations to parameters: fits, their uncertainty, and what the data cannot tell."""

from spirillum.calibration.fit import Calibrated, calibrate

__all__ = ["Calibrated", "calibrate"]
