"""JSON schemas of the files that users write."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel

from spirillum.errors import InputError, did_you_mean


def schema_of(name: str) -> dict[str, Any]:
    """JSON schema of a file."""
    from spirillum.fitted.calibration_file import CalibrationFile
    from spirillum.robot.fields import Section, meanings
    from spirillum.robot.robot import Robot
    from spirillum.studies.spec import Study
    from spirillum.vision.setup import Setup

    known: dict[str, type[BaseModel]] = {"robot": Robot, "study": Study, "calibration": CalibrationFile, "setup": Setup}
    if name not in known:
        raise InputError(f"schema {name!r}{did_you_mean(name, known)}; allowed: {', '.join(known)}")
    schema = known[name].model_json_schema()
    models = {model.__name__: model for model in _models(Section)}
    for title, table in ((known[name].__name__, schema), *schema.get("$defs", {}).items()):
        for field, words in meanings(models[title]).items():
            table["properties"][field].setdefault("description", words)
    if name == "robot":
        words = "Preset, or robot file beside this one, that the file starts from."
        extends = {"type": "string", "description": words, "title": "Extends"}
        schema["properties"]["extends"] = extends
        schema |= _needed_unless_extended(schema)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


_REQUIRING = ("required", "if", "else")  # keys of a table that state its requirements


def _needed_unless_extended(schema: dict[str, Any]) -> dict[str, Any]:
    """Take what every table requires out of a schema; it is required where the file extends no other one."""
    tables = schema.get("$defs", {})

    def needed(part: dict[str, Any]) -> dict[str, Any]:
        whole = tables[part["$ref"].rpartition("/")[2]] if "$ref" in part else part
        for form in whole.get("anyOf", ()):
            if found := needed(form):
                return found
        below = {name: found for name, item in whole.get("properties", {}).items() if (found := needed(item))}
        rest = whole.get("additionalProperties")
        others = needed(rest) if isinstance(rest, dict) else {}
        found = {"properties": below, "additionalProperties": others} | {word: whole.get(word) for word in _REQUIRING}
        return {name: item for name, item in found.items() if item}

    condition = needed(schema)
    for table in (schema, *tables.values()):
        for word in _REQUIRING:
            table.pop(word, None)
    return {"if": {"required": ["extends"]}, "else": condition}


def _models(base: type[BaseModel]) -> Iterator[type[BaseModel]]:
    for model in base.__subclasses__():
        yield model
        yield from _models(model)
