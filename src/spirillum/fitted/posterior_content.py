"""Content of a posterior's file besides its draws, checked: a file may come from anywhere."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, Json

from spirillum.fluid.registry import SWIMMER_MODELS

_Length = Annotated[float, Field(gt=1e-9, lt=1e3)]
_Number = Annotated[float, Field(gt=-1e12, lt=1e12)]
_Name = Annotated[str, Field(min_length=1, max_length=200)]
_Names = Annotated[str, Field(max_length=10_000)]


def _fitted_model(name: str) -> str:
    if name not in SWIMMER_MODELS:
        raise ValueError("a model that swims: " + ", ".join(SWIMMER_MODELS))
    return name


class _Table(BaseModel):
    model_config = ConfigDict(frozen=True, allow_inf_nan=False)


class _Parameter(_Table):
    label: _Name
    parameter: _Name
    channel: Annotated[int, Field(ge=0, lt=1000)] | None


class _OfTail(_Table):
    channel_diameter: _Length
    wavelength: _Length
    amplitude: Annotated[float, Field(ge=0, lt=1e3)]


class _Friction(_OfTail):
    value: _Number
    low: Annotated[float, Field(allow_inf_nan=True)]
    high: Annotated[float, Field(allow_inf_nan=True)]


class _Seen(_Table):
    mean: _Number
    trials: Annotated[float, Field(gt=0, lt=1e9)]
    scale: Annotated[float, Field(gt=1e-12, lt=1e12)]
    stated: Annotated[float, Field(ge=0, lt=1e9)] = 0.0


_Quantity = Literal["advance", "turning", "motor_rate"]


class _Tail(_OfTail):
    tail_rate: _Number | None = None
    seen: dict[_Quantity, _Seen]
    by_motor: bool
    correlation: Annotated[float, Field(gt=-1, lt=1)]
    floor: Annotated[float, Field(ge=1e-9, lt=1e3)]


class _Body(_Table):
    diameter: _Length
    length: _Length


class _Robot(_Table):
    body: _Body


class PosteriorAttributes(_Table):
    """Attributes of a posterior's file."""

    model: Annotated[str, AfterValidator(_fitted_model)]
    observations: _Names
    synthetic: bool
    converged: bool
    channels: Json[Annotated[tuple[_Length, ...], Field(min_length=1, max_length=1000)]]
    parameters: Json[Annotated[tuple[_Parameter, ...], Field(min_length=1, max_length=1000)]]
    friction: Json[Annotated[tuple[_Friction, ...], Field(max_length=100_000)]]
    friction_reading: Literal["", "rotor", "paper"]
    quantities: Json[Annotated[tuple[_Quantity, ...], Field(max_length=10)]]
    settings: Json[Annotated[tuple[_Robot, ...], Field(min_length=1, max_length=100_000)]]
    tails: Json[Annotated[tuple[_Tail, ...], Field(max_length=100_000)]] = ()
    answer: Literal["held", "trial"] = "held"

    @classmethod
    def of(cls, attributes: dict[str, Any]) -> PosteriorAttributes:
        """Attributes as they were read."""
        return cls.model_validate({name: _plain(value) for name, value in attributes.items()})


def _plain(value: Any) -> Any:
    """A number of numpy as one of Python."""
    return value.item() if hasattr(value, "item") and getattr(value, "size", 1) == 1 else value
