"""Geometry, fluid and placement to resistance: one file for each model, one interface for all."""
