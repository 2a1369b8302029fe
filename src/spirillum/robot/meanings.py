"""What the fields of a file mean, from the words below them in the source.

pydantic would read them whenever the classes are made, which takes a tenth of the time of a prediction.
"""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from itertools import pairwise
from textwrap import dedent

from pydantic import BaseModel


def meanings(model: type[BaseModel]) -> dict[str, str]:
    """Meanings of the fields of a table by their names; its own words replace those of what it is made from."""
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
