"""Folders and reports that are written: study, measurement, calibration."""
