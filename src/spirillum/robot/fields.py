"""Field types of the robot file: convert a quantity with its unit to an SI float; descriptions of fields."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from textwrap import dedent
from typing import Annotated, Any, NamedTuple, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    WithJsonSchema,
)
from pydantic.fields import FieldInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError

from spirillum.errors import InputError
from spirillum.units import KINDS, Kind, parse_quantity

__all__ = [
    "NONE",
    "AlsoReads",
    "Angle",
    "BackEmfConstant",
    "Charge",
    "Current",
    "Density",
    "Factor",
    "FieldValue",
    "Inductance",
    "InverseCurrent",
    "Length",
    "LengthOrZero",
    "MagneticField",
    "MagneticMoment",
    "Mass",
    "MomentAngle",
    "Pitch",
    "Pressure",
    "Rate",
    "Resistance",
    "ResistancePerCurrent",
    "RotaryFriction",
    "Section",
    "SignedLength",
    "Text",
    "Time",
    "Torque",
    "TorqueConstant",
    "Velocity",
    "Viscosity",
    "Voltage",
    "Yaw",
    "all_metadata",
    "default_of",
    "field_values",
    "kind_of",
    "quantity_schema",
]


def meanings(model: type[BaseModel]) -> dict[str, str]:
    """Meanings of the fields of a table by their names; its own docstrings override inherited ones."""
    ours = (part for part in reversed(model.__mro__) if part.__module__.startswith("spirillum."))
    return {name: words for part in ours for name, words in _words(part) if name in model.model_fields}


def _words(part: type) -> Iterator[tuple[str, str]]:
    """Names that are declared in a class, with the texts that follow them."""
    (definition,) = ast.parse(dedent(inspect.getsource(part))).body
    assert isinstance(definition, ast.ClassDef)  # noqa: S101 - the source of a class
    for field, below in pairwise(definition.body):
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name) and isinstance(below, ast.Expr):
            text = below.value.value if isinstance(below.value, ast.Constant) else None
            if isinstance(text, str):
                yield field.target.id, inspect.cleandoc(text)


class Section(BaseModel):
    """A table of the robot file: frozen, and closed to keys that it does not know."""

    model_config = ConfigDict(frozen=True, extra="forbid")


def _reader(kind: Kind) -> Callable[[Any], float]:
    def read(value: Any) -> float:
        try:
            return parse_quantity(value, kind)
        except InputError as error:
            # Handed over as a parameter: pydantic would read braces in the text as placeholders.
            raise PydanticCustomError("quantity", "{sentence}", {"sentence": str(error)}) from error

    return read


@dataclass(frozen=True)
class AlsoReads:
    """For the JSON schema of a field: a form that its reader takes beside that of its type."""

    form: Callable[[JsonSchemaValue], JsonSchemaValue]
    """Schema of that form, from the schema of the type."""

    def __get_pydantic_json_schema__(self, core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        """See pydantic."""
        own = handler(core)
        return {"anyOf": [own, self.form(own)]}


NONE = AlsoReads(lambda _: {"const": "none"})
"""The word `none` for a table that is left out."""
UNSET = BeforeValidator(lambda value: None if value == "none" else value)
"""A value that the word `none` takes away, also one of a preset."""


def quantity_schema(kind: Kind) -> JsonSchemaValue:
    """JSON schema of a quantity of a kind."""
    return {
        "type": "string",
        "x-quantity": {"kind": kind.name, "unit": kind.unit, "minimum": kind.low, "maximum": kind.high},
        "examples": [kind.example],
    }


def _quantity(name: str) -> tuple[Kind, BeforeValidator, WithJsonSchema]:
    """Metadata of a quantity field; the kind stays with the field, so that `field_values` has its unit."""
    kind = KINDS[name]
    return kind, BeforeValidator(_reader(kind)), WithJsonSchema(quantity_schema(kind))


def _printable(text: str) -> str:
    if not all(c.isprintable() or c == "\n" for c in text):
        raise ValueError("text without control characters, which \\ and a letter between double quotes are")
    return text


Text = Annotated[str, AfterValidator(_printable)]
"""Words for people; they end up in files, figures and on terminals."""


class FieldValue(NamedTuple):
    """A field of a section with its value."""

    path: str
    """Dotted name in the file."""
    value: Any
    """Value; SI for a quantity, None where unset."""
    unit: str | None
    """SI unit of a quantity, None for anything else."""


def field_values(section: Section, path: str = "") -> Iterator[FieldValue]:
    """All fields of a section and the sections within it."""
    for name, info in type(section).model_fields.items():
        value = getattr(section, name)
        kinds = [item for item in all_metadata(info) if isinstance(item, Kind)]
        if isinstance(value, Section):
            yield from field_values(value, f"{path}{name}.")
        elif isinstance(value, dict):
            for key, item in value.items():
                yield from field_values(item, f"{path}{name}.{key}.")
        else:
            yield FieldValue(f"{path}{name}", value, kinds[0].unit if kinds else None)


def kind_of(section: Section, path: str) -> Kind | None:
    """Kind of quantity of a field; None for anything else."""
    kinds = [item for item in all_metadata(_info_of(section, path)) if isinstance(item, Kind)]
    return kinds[0] if kinds else None


def default_of(section: Section, path: str) -> Any:
    """Default of a field."""
    return _info_of(section, path).default


def _info_of(section: Section, path: str) -> FieldInfo:
    *tables, name = path.split(".")
    inner: Any = section
    for table in tables:
        inner = inner[table] if isinstance(inner, dict) else getattr(inner, table)
    fields: dict[str, FieldInfo] = type(inner).model_fields
    return fields[name]


def all_metadata(info: FieldInfo) -> list[Any]:
    """Metadata of a field, also of one that may be None (there it sits inside the union)."""
    inside = [item for part in get_args(info.annotation) for item in getattr(part, "__metadata__", ())]
    return [*info.metadata, *inside]


Length = Annotated[float, *_quantity("length")]
LengthOrZero = Annotated[float, *_quantity("length or zero")]
SignedLength = Annotated[float, *_quantity("length of either sign")]
Mass = Annotated[float, *_quantity("mass")]
Density = Annotated[float, *_quantity("density")]
Viscosity = Annotated[float, *_quantity("viscosity")]
Pressure = Annotated[float, *_quantity("pressure")]
Rate = Annotated[float, *_quantity("rate")]
Torque = Annotated[float, *_quantity("torque")]
Pitch = Annotated[float, *_quantity("pitch")]
Yaw = Annotated[float, *_quantity("yaw")]
Velocity = Annotated[float, *_quantity("velocity")]
RotaryFriction = Annotated[float, *_quantity("rotary friction")]
MagneticMoment = Annotated[float, *_quantity("magnetic moment")]
MagneticField = Annotated[float, *_quantity("magnetic field")]
Angle = Annotated[float, *_quantity("angle")]
MomentAngle = Annotated[float, *_quantity("moment angle")]
Time = Annotated[float, *_quantity("time")]
Voltage = Annotated[float, *_quantity("voltage")]
Resistance = Annotated[float, *_quantity("resistance")]
Inductance = Annotated[float, *_quantity("inductance")]
TorqueConstant = Annotated[float, *_quantity("torque constant")]
BackEmfConstant = Annotated[float, *_quantity("back-emf constant")]
Current = Annotated[float, *_quantity("current")]
Charge = Annotated[float, *_quantity("charge")]
InverseCurrent = Annotated[float, *_quantity("inverse current")]
ResistancePerCurrent = Annotated[float, *_quantity("resistance per current")]
Factor = Annotated[float, Field(strict=True, ge=1e-3, le=1e3, allow_inf_nan=False)]
