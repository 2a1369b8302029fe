"""Beside the models: what was observed, and its statistics."""

from spirillum.measurement.observations import Observation, read_observations

__all__ = ["Observation", "read_observations"]
