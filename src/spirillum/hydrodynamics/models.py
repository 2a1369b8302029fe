"""The models by name."""

from __future__ import annotations

from spirillum.errors import InputError, did_you_mean
from spirillum.hydrodynamics.model import ResistanceModel, SwimmerModel
from spirillum.hydrodynamics.perrin import Perrin
from spirillum.hydrodynamics.rft import Rft
from spirillum.hydrodynamics.sbt import Sbt
from spirillum.hydrodynamics.slender import Slender

__all__ = ["MODELS", "SWIMMER_MODELS", "find_model", "find_swimmer_model"]

SWIMMER_MODELS: dict[str, SwimmerModel] = {model.name: model for model in (Sbt(), Rft(), Slender())}
"""Models that make a robot swim."""
MODELS: dict[str, ResistanceModel] = {**SWIMMER_MODELS, "perrin": Perrin()}
"""Models that give a resistance matrix."""


def find_model(name: str) -> ResistanceModel:
    """The model of that name.

    Raises:
        InputError: if there is none.
    """
    if str(name) not in MODELS:
        raise InputError(f"model = {name!r}{did_you_mean(str(name), MODELS)}; allowed: {', '.join(MODELS)}")
    return MODELS[name]


def find_swimmer_model(name: str) -> SwimmerModel:
    """The model of that name that makes a robot swim.

    Raises:
        InputError: if there is none.
    """
    if str(name) not in SWIMMER_MODELS:
        hint = did_you_mean(str(name), SWIMMER_MODELS)
        raise InputError(f"model = {name!r}{hint}; allowed: {', '.join(SWIMMER_MODELS)}")
    return SWIMMER_MODELS[name]
