"""Units as FMI describes them: exponents of the SI base units and the radian."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

__all__ = ["base_units"]

_DERIVED: Mapping[str, Mapping[str, int]] = {
    "kg": {"kg": 1},
    "m": {"m": 1},
    "s": {"s": 1},
    "A": {"A": 1},
    "rad": {"rad": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "C": {"A": 1, "s": 1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "H": {"kg": 1, "m": 2, "s": -2, "A": -2},
}


def base_units(unit: str) -> dict[str, int]:
    """Exponents of `kg`, `m`, `s`, `A` and `rad` in a unit of the registry, such as ``m/(s N m)``.

    Raises:
        KeyError: for a symbol that is in none of the FMU's units.
    """
    found: Counter[str] = Counter()
    above, _, below = unit.partition("/")
    for side, sign in ((above, 1), (below.strip("()"), -1)):
        for symbol in side.split():
            if symbol != "1":
                for base, power in _DERIVED[symbol].items():
                    found[base] += sign * power
    return {base: power for base, power in found.items() if power}
