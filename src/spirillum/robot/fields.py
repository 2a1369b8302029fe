"""Field types of the robot file: a quantity with its unit goes in, an SI float comes out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, WithJsonSchema
from pydantic_core import PydanticCustomError

from spirillum.errors import InputError
from spirillum.units import KINDS, Kind, parse_quantity

__all__ = [
    "BackEmfConstant",
    "Charge",
    "Density",
    "Factor",
    "Inductance",
    "InverseCurrent",
    "Length",
    "LengthOrZero",
    "Mass",
    "Rate",
    "Resistance",
    "ResistancePerCurrent",
    "RotaryFriction",
    "Section",
    "Torque",
    "TorqueConstant",
    "Viscosity",
    "Voltage",
]


class Section(BaseModel):
    """A table of the robot file: frozen, and closed to keys that it does not know."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


def _reader(kind: Kind) -> Callable[[Any], float]:
    def read(value: Any) -> float:
        try:
            return parse_quantity(value, kind)
        except InputError as error:
            # Handed over as a parameter: pydantic would read braces in the text as placeholders.
            raise PydanticCustomError("quantity", "{sentence}", {"sentence": str(error)}) from error

    return read


def _schema(kind: Kind) -> WithJsonSchema:
    return WithJsonSchema(
        {
            "type": "string",
            "description": f"{kind.name} with its unit, {kind.allowed}",
            "examples": [kind.example],
        }
    )


def _quantity(name: str) -> tuple[BeforeValidator, WithJsonSchema]:
    kind = KINDS[name]
    return BeforeValidator(_reader(kind)), _schema(kind)


Length = Annotated[float, *_quantity("length")]
LengthOrZero = Annotated[float, *_quantity("length or zero")]
Mass = Annotated[float, *_quantity("mass")]
Density = Annotated[float, *_quantity("density")]
Viscosity = Annotated[float, *_quantity("viscosity")]
Rate = Annotated[float, *_quantity("rate")]
Torque = Annotated[float, *_quantity("torque")]
RotaryFriction = Annotated[float, *_quantity("rotary friction")]
Voltage = Annotated[float, *_quantity("voltage")]
Resistance = Annotated[float, *_quantity("resistance")]
Inductance = Annotated[float, *_quantity("inductance")]
TorqueConstant = Annotated[float, *_quantity("torque constant")]
BackEmfConstant = Annotated[float, *_quantity("back-emf constant")]
Charge = Annotated[float, *_quantity("charge")]
InverseCurrent = Annotated[float, *_quantity("inverse current")]
ResistancePerCurrent = Annotated[float, *_quantity("resistance per current")]
Factor = Annotated[float, Field(strict=True, ge=1e-3, le=1e3, allow_inf_nan=False)]
