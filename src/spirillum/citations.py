"""The references that results rest on."""

from __future__ import annotations

from collections.abc import Iterable

from spirillum.data_tables import rows_of
from spirillum.errors import InputError
from spirillum.fluid.registry import find_model
from spirillum.version import package_version

REFERENCES = {row["key"]: row["reference"] for row in rows_of("references.csv")}  #: Key to full reference.

_SOFTWARE = "The Spirillum developers. spirillum, version {version}."


def citation(result: object = None) -> str:
    """The references that a result rests on, one a line; the software itself comes first.

    Args:
        result: a `Prediction`, `Resistance`, dataset, model or robot with references of its own; a model's
            name; None for the software and its paper.

    Raises:
        InputError: if the object carries no references.
    """
    keys = list(dict.fromkeys(("biorob2012", *_keys_of(result))))
    return "\n".join([_SOFTWARE.format(version=package_version()), *(REFERENCES[key] for key in keys)])


def _keys_of(result: object) -> Iterable[str]:
    if result is None:
        return ()
    if isinstance(result, str):
        return find_model(result).references
    found = getattr(result, "references", None)
    if found is None:
        found = getattr(result, "attrs", {}).get("references")
    if isinstance(found, str):
        found = found.split()
    if found is None:
        raise InputError(
            f"a {type(result).__name__} carries no references; allowed: an answer, a dataset or a model's name"
        )
    return [key for key in found if key in REFERENCES]
