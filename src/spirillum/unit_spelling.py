"""Other spellings of units: signs, capitals, and products that are written together, such as `mPas` or `mNm`."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice, product

from spirillum.scalars import plain_minus

_WORD = re.compile(r"([^\W\d_]+|°)((?:\^|\*\*)-?\d)?")
_SIGNS = str.maketrans({"º": "°", "·": "*", "⋅": "*", "∙": "*", "•": "*", "×": "*", "∕": "/", "⁄": "/"})
_MEANT = {"cps": ("cP", "rps"), "gs": ("G",), "gm": ("g",), "gms": ("g",), "r": ("turn",), "u": ("turn",)}
"""Abbreviations that no registry knows, or knows as another unit; the quantity decides which one is meant."""
_MOST = 64
_LONGEST_SYMBOL = 4
_MOST_PARTS = 3


def plain_unit(text: str) -> str:
    """A unit's text in the signs that pint reads: ``mm·s⁻¹`` and ``mm s-1`` become ``mm s^-1``."""
    plain = unicodedata.normalize("NFKC", text.translate(_SIGNS)).translate(_SIGNS)
    plain = plain_minus(plain).replace("Ω", "ohm").strip(" .")
    plain = re.sub(r"(?<=[^\W\d_])[.-](?=[^\W\d_])", " ", plain)  # N.m and N-m
    return re.sub(r"(?<=[^\W\d_])(-?\d)", r"^\1", plain)


def spelled_names(units: Iterable[str], prefixes: Iterable[str]) -> Mapping[str, frozenset[str]]:
    """Names of units with and without prefixes, by their lower-case form."""
    found: dict[str, set[str]] = {}
    listed, before = list(units), list(prefixes)
    combined = [p + u for u in listed for p in before if len(p) > 1 or len(u) <= _LONGEST_SYMBOL]
    for name in (*listed, *combined):
        found.setdefault(name.lower(), set()).add(name)
    return {lower: frozenset(names) for lower, names in found.items()}


def other_spellings(text: str, names: Mapping[str, frozenset[str]], *, loose: bool) -> Iterator[str]:
    """Texts that may be meant by a unit's text: unknown words in other capitals, or as products of symbols."""
    found = _WORD.findall(text)
    pattern = _WORD.sub("{}", text)
    choices = [list(dict.fromkeys(_meanings(word, power, names, loose=loose))) for word, power in found]
    for chosen in islice(product(*choices), _MOST):
        yield pattern.format(*chosen)


def _meanings(word: str, power: str, names: Mapping[str, frozenset[str]], *, loose: bool) -> Iterator[str]:
    lower = word.lower()
    yield from (name + power for name in _MEANT.get(lower, ()))
    if word in names.get(lower, ()):
        yield word + power
        return
    singular = lower.removesuffix("s") if len(lower) >= _LONGEST_SYMBOL else lower
    known = sorted(names.get(lower, frozenset()) or names.get(singular, frozenset()))
    if not loose and not word.isupper():
        known = [name for name in known if name[0] == word[0]] or known
    yield from (name + power for name in known)
    yield from (f"({symbols}{power})" for symbols in _products(word, names, _MOST_PARTS))


def _products(word: str, names: Mapping[str, frozenset[str]], most: int) -> Iterator[str]:
    """A word as a product of symbols in their own capitals."""
    for end in range(1, len(word)):
        first, rest = word[:end], word[end:]
        if not _is_symbol(first, names):
            continue
        if _is_symbol(rest, names):
            yield f"{first} {rest}"
        if most > 2:
            yield from (f"{first} {others}" for others in _products(rest, names, most - 1))


def _is_symbol(word: str, names: Mapping[str, frozenset[str]]) -> bool:
    return len(word) <= _LONGEST_SYMBOL and word in names.get(word.lower(), ())
