"""Geometry, fluid and placement to resistance: one file for each model, one interface for all."""

from spirillum.hydrodynamics.model import PARTS, ResistanceModel, SwimmerModel
from spirillum.hydrodynamics.models import MODELS, SWIMMER_MODELS, check_placement, find_model, find_swimmer_model

__all__ = [
    "MODELS",
    "PARTS",
    "SWIMMER_MODELS",
    "ResistanceModel",
    "SwimmerModel",
    "check_placement",
    "find_model",
    "find_swimmer_model",
]
