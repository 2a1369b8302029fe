"""Texts from templates of this package: pages, descriptions of robots, tables."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any
from xml.sax.saxutils import escape


def rendered(
    template: str, *, escaped: bool = False, filters: Mapping[str, Callable[..., str]] | None = None, **names: Any
) -> str:
    """The text of a template, `folder/file`, every name of which has to be given; `escaped`: as a page."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    folder, _, file = template.rpartition("/")
    environment = Environment(
        loader=PackageLoader(f"spirillum.{folder}", ""),
        autoescape=escaped,  # noqa: S701 - other texts than pages are escaped by `attribute`
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=not escaped,
    )
    as_attribute = partial(escape, entities={'"': "&quot;", "\n": "&#10;"})
    environment.filters.update(filters or {}, attribute=as_attribute, numbers=numbers)
    return environment.get_template(file).render(**names)


def numbers(values: Iterable[float]) -> str:
    """Numbers as XML has them, to the last digit."""
    return " ".join(repr(float(value)) for value in values)
