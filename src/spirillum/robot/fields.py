"""Field types of the robot file, with units and descriptions, and the validation messages of its tables."""

from __future__ import annotations

import ast
import inspect
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from textwrap import dedent
from typing import Annotated, Any, NamedTuple, TypeVar, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    ValidationError,
    WithJsonSchema,
)
from pydantic.fields import FieldInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError

from spirillum.data_tables import field_texts, rows_of
from spirillum.errors import InputError, clipped, did_you_mean
from spirillum.units import KINDS, Kind, parse_quantity


def meanings(model: type[BaseModel]) -> dict[str, str]:
    """Meanings of the fields of a table by their names; those of a class override inherited ones."""
    found: dict[str, str] = {}
    for part in (part for part in reversed(model.__mro__) if part.__module__.startswith("spirillum.")):
        source = dedent(inspect.getsource(part))
        (definition,) = ast.parse(source).body
        assert isinstance(definition, ast.ClassDef)  # noqa: S101 - the source of a class
        found |= field_texts(definition, source.splitlines())
    return {name: words for name, words in found.items() if words and name in model.model_fields}


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

    form: Callable[[JsonSchemaValue], JsonSchemaValue]  #: Schema of that form, from the schema of the type.

    def __get_pydantic_json_schema__(self, core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        """See pydantic."""
        own = handler(core)
        return {"anyOf": [own, self.form(own)]}


NONE = AlsoReads(lambda _: {"const": "none"})  #: The word `none` for a table that is left out.
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


Text = Annotated[str, AfterValidator(_printable)]  #: Words for people; they end up in files, figures and on terminals.


class FieldValue(NamedTuple):
    """A field of a section with its value."""

    path: str  #: Dotted name in the file.
    value: Any  #: Value; SI for a quantity, None where unset.
    unit: str | None  #: SI unit of a quantity, None for anything else.

    @property
    def text(self) -> str:
        """The value for a sentence, with its unit."""
        number = isinstance(self.value, float)
        return f"{self.value:g} {self.unit or ''}".rstrip() if number else str(self.value)[:60]


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


_OTHERWISE = {row["field"]: row["remedy"] for row in rows_of("robot/other_fields.csv")}
"""Derived quantities that are no fields of a robot file, and fields of other files, with their remedies."""
_ALLOWED = {row["error"]: row["allowed"] for row in rows_of("robot/allowed_kinds.csv")}
"""Allowed values by pydantic's kinds of errors that name no fields."""
_IN_ITS_RANGE = {"drive.duty": "0 to 1; motor.polarity = 'reverse' reverses the tail's rotation"}
"""Remedies for out-of-range numbers whose meaning is expressed by another field."""
_LONGEST_FIELD = 200  # characters of a field's name in a sentence, so that what is allowed has room
_MOST_NAMED = 6  # fields with further problems that a sentence names
_M = TypeVar("_M", bound=BaseModel)


def problems_in(model: type[_M], table: Mapping[str, Any], under: str = "") -> _M | list[str]:
    """Check a raw table; return the model, or every problem as a sentence, unknown fields first."""
    try:
        return model.model_validate(table)
    except ValidationError as error:
        sentences: list[str] = []
        # A misspelt field is missing under its right name, too; its own sentence says what to do.
        for problem in sorted(error.errors(include_url=False), key=lambda item: item["type"] != "extra_forbidden"):
            sentences += _sentences(model, problem, under)
        return list(dict.fromkeys(sentences))
    except RecursionError:
        return ["its tables are nested too deeply; see `spirillum schema robot`"]


def refuse(*sentences: str) -> PydanticCustomError:
    """The error of a table that is refused by whole sentences, for a validator to raise."""
    return PydanticCustomError("assembly", "{sentences}", {"sentences": "\n".join(sentences)})


def field_of(problem: str) -> str:
    """The field with which a problem's sentence begins."""
    return re.split(r"[^\w.-]", problem, maxsplit=1)[0][:_LONGEST_FIELD]


def refused_table(problems: Sequence[str], source: str | Callable[[str], str] = "") -> InputError:
    """All problems of a table, or of files, as one error: the first as its sentence, the others' fields by name."""
    files = [source if isinstance(source, str) else source(problem) for problem in problems]
    every = [f"{file}: {problem}" if file else problem for file, problem in zip(files, problems, strict=True)]
    if len(problems) == 1:
        return InputError(every[0])
    fields = [field_of(problem) for problem in problems[1:]]
    named = ", ".join(fields[:_MOST_NAMED]) + (", ..." if len(fields) > _MOST_NAMED else "")
    return InputError(f"{every[0]} (and {len(fields)} more: {named})", every)


def _sentences(model: type[BaseModel], problem: Mapping[str, Any], under: str) -> Iterable[str]:
    """Our sentences for one of pydantic's findings."""
    kind, context = problem["type"], problem.get("ctx", {})
    names = [str(name) for name in problem["loc"]]
    names = names[:-1] if names[1:] and names[-1] == "[key]" else names  # of a name in a table by name
    if kind == "assembly":
        return str(context["sentences"]).split("\n")
    field = ".".join([under, *names] if under else names)[:_LONGEST_FIELD]
    if kind == "value_error" and isinstance(context.get("error"), InputError):
        return [str(context["error"])]
    if kind == "quantity":
        return [f"{field} {context['sentence']}"]
    if kind == "missing":
        entry = isinstance(problem["loc"][-1], int)
        return [
            f"{field.rpartition('.')[0]} has too few entries" if entry else f"{field} is missing; it has to be given"
        ]
    if kind == "extra_forbidden":
        allowed = list(_section_at(model, names[:-1]).model_fields)
        hint = f": {_OTHERWISE[field]}" if field in _OTHERWISE else did_you_mean(names[-1][:60], allowed)
        return [f"{field[:120]} is not a known field{hint}; allowed: {', '.join(allowed)}"]
    return [_refused(problem, field, _range_at(model, names))]


def refused_value(error: ValidationError, field: str) -> str:
    """A sentence for a single value that was refused."""
    return _refused(error.errors(include_url=False)[0], field)


def _refused(problem: Mapping[str, Any], field: str, bounds: str = "") -> str:
    """A sentence of field, value, and what is allowed: both bounds of a range where they are known."""
    shown, words = clipped(problem.get("input")), _allowed(problem, field)
    if bounds and problem["type"] in ("greater_than_equal", "less_than_equal") and field not in _IN_ITS_RANGE:
        words = bounds
    given = problem.get("input")
    if isinstance(given, float) and math.isnan(given):  # the limit that was looked at first says little
        return f"{field or 'the file'} = nan is no number; allowed: {words}"
    hint = ""
    if problem["type"] == "literal_error":
        hint = did_you_mean(str(problem["input"])[:60], re.findall(r"'([^']+)'", words))
    return f"{field or 'the file'} = {shown} is not allowed{hint}; allowed: {words}"


def _allowed(problem: Mapping[str, Any], field: str) -> str:
    """Allowed values, for the kinds of errors that name no fields."""
    kind, context = problem["type"], problem.get("ctx", {})
    kind = f"string_{kind}" if kind in ("too_long", "too_short") and isinstance(problem.get("input"), str) else kind
    if kind in _ALLOWED:
        most, least = context.get("max_length"), context.get("min_length")
        return _ALLOWED[kind].format(field=field, length=most, most=_entries(most), least=_entries(least))
    if kind in ("greater_than_equal", "less_than_equal") and field in _IN_ITS_RANGE:
        return _IN_ITS_RANGE[field]
    own = {"literal_error": "expected", "value_error": "error"}
    return str(context[own[kind]]) if kind in own else str(problem["msg"]).removeprefix("Input should be ")


def _entries(count: Any) -> str:
    return "one entry" if count == 1 else f"{count} entries"


def _section_at(model: type[BaseModel], names: Iterable[str]) -> type[BaseModel]:
    """The section that a location leads to; the last one on its way where it leads nowhere."""
    for name in names:
        info = model.model_fields.get(name)
        model = (info and section_in(info.annotation)) or model
    return model


def _range_at(model: type[BaseModel], names: Sequence[str]) -> str:
    """Both bounds of the number that a location leads to; empty where there are not two."""
    info = _section_at(model, names[:-1]).model_fields.get(names[-1]) if names else None
    metadata = [] if info is None else all_metadata(info)
    found = [getattr(item, name) for name in ("ge", "le") for item in metadata if hasattr(item, name)]
    return f"{found[0]:g} to {found[1]:g}" if len(found) == 2 else ""


def section_in(annotation: Any) -> type[BaseModel] | None:
    """The section class inside an annotation such as ``Channel | Literal['none']``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for part in getattr(annotation, "__args__", ()):
        if (found := section_in(part)) is not None:
            return found
    return None
