"""The registry of quantities: name, symbol, units, meaning and source of what answers, datasets and figures hold.

A new quantity is one row of `quantities.csv`. Tables on the terminal, `--json`, the attributes of datasets, the labels
of figures and the documentation read it from here.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from spirillum.data_tables import rows_of
from spirillum.envelope import quantity
from spirillum.units import for_people


class Quantity(NamedTuple):
    """A quantity by its one definition."""

    name: str  #: Name in answers, datasets and Python.
    symbol: str  #: Symbol as in the paper, in matplotlib's notation for formulas; empty where it has none.
    unit: str  #: SI unit; rates in rad/s.
    meaning: str  #: What it is, in half a sentence.
    source: str  #: Equation, table or reference.
    short: str = ""  #: Name at the head of a narrow column, where it has one.

    @property
    def display_unit(self) -> str:
        """The unit in which people read it, as long as it is neither very small nor very large."""
        return for_people(self.unit)


QUANTITIES = {row["name"]: Quantity(**row) for row in rows_of("quantities.csv")}  #: Every quantity by its name.


def unit_of(name: str) -> str:
    """SI unit of a quantity."""
    return QUANTITIES[name].unit


def in_units(values: Mapping[str, Any]) -> dict[str, Any]:
    """Quantities of the registry by name, as an answer has them."""
    return {name: quantity(value, unit_of(name)) for name, value in values.items()}


def attributes(name: str, *, meaning: str | None = None, source: str | None = None) -> dict[str, Any]:
    """Attributes of a dataset's variable: `units`, `long_name` and `source`, from the registry or as given."""
    item = QUANTITIES[name]
    return {"units": item.unit, "long_name": meaning or item.meaning, "source": source or item.source}
