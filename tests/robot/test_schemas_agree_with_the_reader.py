"""What the reader of a file takes, the JSON schema of that file takes too; and the examples of the schema are read."""

import tomllib
from collections.abc import Iterator
from functools import cache
from typing import Any

import jsonschema
import pytest
from pydantic import BaseModel, ValidationError, create_model
from pydantic.fields import FieldInfo

from spirillum.fitted.calibration_file import CalibrationFile
from spirillum.robot.fields import Section
from spirillum.robot.load import preset_names, preset_text
from spirillum.robot.robot import Robot
from spirillum.schemas import schema_of as made_schema_of
from spirillum.studies.spec import Study
from spirillum.units import KINDS
from spirillum.vision.setup import Setup

FILES: dict[str, type[BaseModel]] = {"robot": Robot, "study": Study, "calibration": CalibrationFile, "setup": Setup}
TABLES = (
    {},
    {"diameter": "40 mm"},
    {"length": "3 mm", "stripes": ["red", "blue"]},
    {"constant": "10 ohm"},
    {"source": "here", "fitted_to": dict.fromkeys(("channel_diameter", "body_diameter", "body_length"), "18 mm")},
)
VALUES: tuple[Any, ...] = (
    *(kind.example for kind in KINDS.values()),
    *("-1 mm", "none", "on", "off", "true", "capsule", "flat", "right", "rotor", "text", ""),
    *(0, 1, 2, 0.5, 1.0, 2.5, 50.0, True, False),
    *([], ["red", "blue"], ["1 mm", "2 mm"], [0.1, 0.2], ["tube"], ["rotor"], [1, 2]),
    *TABLES,
    [TABLES[-1]],
)
schema_of = cache(made_schema_of)
"""Nobody here changes a schema, and to make one takes a fifth of a second."""


def _fields() -> Iterator[tuple[str, FieldInfo]]:
    """Every field of every table of every file."""
    wanted = {name for file in FILES for name in (FILES[file].__name__, *schema_of(file).get("$defs", {}))}

    def below(model: type[BaseModel]) -> Iterator[type[BaseModel]]:
        for one in model.__subclasses__():
            yield one
            yield from below(one)

    models = {model.__name__: model for model in below(Section) if model.__name__ in wanted}
    for model in models.values():
        for name, info in model.model_fields.items():
            yield f"{model.__name__}.{name}", info


FIELDS = dict(_fields())


@cache
def alone_with_its_schema(path: str) -> tuple[Any, dict[str, Any]]:
    """A table of that field alone."""
    info = FIELDS[path]
    alone: Any = create_model("Alone", __base__=Section, field=(info.annotation, info))
    return alone, alone.model_json_schema()


@pytest.mark.parametrize("path", FIELDS)
def test_what_is_read_is_in_the_schema(path: str) -> None:
    alone, schema = alone_with_its_schema(path)
    checker = jsonschema.Draft202012Validator(schema)
    for value in VALUES:
        try:
            alone(field=value)
        except ValidationError:
            continue
        assert checker.is_valid({"field": value}), value


@pytest.mark.parametrize("path", FIELDS)
def test_examples_of_the_schema_are_read(path: str) -> None:
    alone, schema = alone_with_its_schema(path)
    own = schema["properties"]["field"]
    for form in (own, *own.get("anyOf", ())):
        for example in (
            *form.get("examples", ()),
            *form.get("enum", ()),
            *([form["const"]] if "const" in form else ()),
        ):
            alone(field=example)


def test_schema_takes_the_presets_as_they_are_written() -> None:
    checker = jsonschema.Draft202012Validator(schema_of("robot"))
    for name in preset_names():
        checker.validate(tomllib.loads(preset_text(name)))


@pytest.mark.parametrize("path", ["body", "tail.wavelength", "motor.resistance.constant", "calibration.rft.source"])
def test_only_a_file_that_extends_another_may_leave_out_what_is_required(path: str) -> None:
    table: Any = tomllib.loads(preset_text("biorob2012-wide"))
    table["motor"]["resistance"] = {"constant": "10 ohm"}
    inner, *outer = reversed(path.split("."))
    place = table
    for name in reversed(outer):
        place = place[name]
    del place[inner]
    checker = jsonschema.Draft202012Validator(schema_of("robot"))
    assert not checker.is_valid(table)
    assert checker.is_valid({"extends": "biorob2012-wide", **table})


def test_motor_resistance_is_a_value_or_a_table() -> None:
    forms = schema_of("robot")["$defs"]["Motor"]["properties"]["resistance"]["anyOf"]
    assert [form.get("type") or form["$ref"] for form in forms] == ["#/$defs/MotorResistance", "string"]
