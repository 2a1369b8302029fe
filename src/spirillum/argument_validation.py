"""Arguments of public functions against their annotations: a wrong kind is named in one sentence before any work.

An annotation is read as it stands in the source, so that nothing has to be imported for it: ``str | Path | None``,
``Sequence[str]``, ``Robot``. What it does not tell, such as the range of a number, the function itself looks at.
"""

from __future__ import annotations

import ast
import inspect
import math
import os
import re
import sys
import types
from collections.abc import Callable, Collection, Iterable, Mapping, Set
from functools import cache, wraps
from typing import TYPE_CHECKING, Any, NamedTuple, ParamSpec, TypeVar, get_args, get_origin

from spirillum.errors import ArgumentError, InputError, check_memory, clipped, did_you_mean
from spirillum.scalars import is_number, is_true_or_false, is_whole

if TYPE_CHECKING:
    import numpy as np

    from spirillum.arrays import Samples, Whole

P = ParamSpec("P")
R = TypeVar("R")


class _Kind(NamedTuple):
    """One kind of values."""

    words: str  # for the sentence of an error
    holds: Callable[[Any], bool]  # whether a value is of it; of a list, whether it is a list at all
    items: tuple[_Kind, ...] = ()  # kinds of the items of a list; empty: any


def _is_list(value: Any) -> bool:
    """Several values whose number is known, but no text, no mapping, and no array of one value without a length."""
    return (
        isinstance(value, Collection) and not isinstance(value, (str, bytes, Mapping)) and getattr(value, "ndim", 1) > 0
    )


def _is_named(value: Any) -> bool:
    return isinstance(value, Mapping) and all(isinstance(key, str) for key in value)


_BASIC = {
    "str": _Kind("text", lambda value: isinstance(value, str)),
    "Path": _Kind("a path", lambda value: isinstance(value, os.PathLike)),
    "int": _Kind("a whole number", is_whole),
    "float": _Kind("a number", is_number),
    "bool": _Kind("True or False", is_true_or_false),
    "None": _Kind("None", lambda value: value is None),
    "Mapping": _Kind("a mapping of names", _is_named),
    "Callable": _Kind("a function", callable),
    "Samples": _Kind("an array", lambda value: hasattr(value, "ndim")),
    "PerRobot": _Kind("an array", lambda value: hasattr(value, "ndim")),
}
_ANY = _Kind("anything", lambda _value: True)
_LISTS = ("Sequence", "tuple", "list")


def validate_arguments(function: Callable[P, R]) -> Callable[P, R]:
    """Return a function that raises `InputError` for an argument of a wrong kind or one that it does not have."""
    signature = inspect.signature(function)
    names = [name for name, item in signature.parameters.items() if item.kind is not item.VAR_KEYWORD]
    open_ended = len(names) < len(signature.parameters)
    own = names[1:] if names[:1] in (["self"], ["cls"]) else names
    called = function.__qualname__.removesuffix(".__init__").rpartition(".")[2]

    @cache
    def kinds_of(name: str) -> tuple[_Kind, ...]:
        annotation = signature.parameters[name].annotation
        if not isinstance(annotation, str):
            return (_ANY,)
        return _kinds(ast.parse(annotation, mode="eval").body, vars(sys.modules[function.__module__]))

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        for name in kwargs:
            if name not in names and not open_ended:
                raise ArgumentError(
                    f"{name} is no argument of {called}(){did_you_mean(name, own)}; allowed: {', '.join(own)}"
                )
        for name, value in {**dict(zip(names, args, strict=False)), **kwargs}.items():
            if name in own:
                _check(name, value, kinds_of(name))
        return function(*args, **kwargs)

    return call


def check_kind(name: str, value: Any, annotation: str) -> None:
    """Refuse a value of a wrong kind."""
    _check(name, value, _kinds(ast.parse(annotation, mode="eval").body, {}))


def as_number(value: Any) -> float:
    """A value as a number; NaN, which is in no range, for what is none, and for one too large to be a float."""
    if not is_number(value):
        return math.nan
    try:
        return float(value)
    except OverflowError:
        return math.nan


def as_duty(duty: Any) -> float:
    """A duty of the drive as a number; refused outside 0 to 1."""
    number = as_number(duty)
    if not 0.0 <= number <= 1.0:
        raise InputError(f"duty = {clipped(duty)}; allowed: a number from 0 to 1")
    return number


def as_step(dt: Any, longest: float) -> float:
    """A time to step by as a number, s; refused from 0 down and beyond the longest."""
    number = as_number(dt)
    if not 0.0 < number <= longest:
        raise InputError(f"dt = {clipped(dt)}; allowed: above 0, at most {longest:g} s")
    return number


def as_pixels(size: Any, low: int = 1, high: int = 99_999, *, even: bool = False) -> tuple[int, int]:
    """Width and height in pixels from ``1600x900`` or a pair."""
    which = "even numbers from " if even else ""
    allowed = f"WIDTHxHEIGHT in pixels, {which}{low} to {high} each, for example 1600x900"
    listed = isinstance(size, Collection) and not isinstance(size, (str, Set, Mapping))
    words = [str(part).strip() for part in (size if listed else re.split("[xX×]", str(size)))]
    if len(words) != 2 or not all(word.isdecimal() and len(word) <= 6 for word in words):
        raise InputError(f"size = {clipped(size)}; allowed: {allowed}")
    width, height = map(int, words)
    if not all(low <= length <= high and (length % 2 == 0 or not even) for length in (width, height)):
        raise InputError(f"size = {width}x{height}; allowed: {allowed}")
    return width, height


def number_array(name: str, value: Any, allowed: str = "numbers") -> Samples:
    """A number, or numbers of any shape, as an array of floats."""
    found = _array_of(name, value, "iuf", allowed)
    return found.astype(float, copy=False)


def whole_array(name: str, value: Any, allowed: str = "whole numbers") -> Whole:
    """A whole number, or whole numbers of any shape, as an array of indices."""
    import numpy as np

    found = _array_of(name, value, "iu", allowed)
    return found.astype(np.intp, copy=False)


def _array_of(name: str, value: Any, kinds: str, allowed: str) -> np.ndarray:
    """An array whose items are of one of these kinds, letters of `numpy.dtype.kind`."""
    import numpy as np

    try:
        found = np.asarray(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{name} = {clipped(value)}; allowed: {allowed}") from error
    if found.dtype.kind not in kinds or np.any(np.ma.getmask(value)):
        raise InputError(f"{name} = {clipped(value)}; allowed: {allowed}")
    check_memory(name, found.size, "numbers", _NUMBER, "in several requests")
    return found


_NUMBER = 24.0  # A number as a float, its size, and what is true of it, bytes; a view of one value has taken none yet.


def _check(name: str, value: Any, kinds: Iterable[_Kind]) -> None:
    """Refuse a value of none of these kinds."""
    fitting = [kind for kind in kinds if kind.holds(value)]
    if fitting == [_BASIC["float"]] and is_whole(value) and abs(int(value)) > sys.float_info.max:
        raise InputError(f"{name} = {clipped(value)}; allowed: at most {sys.float_info.max:.2g} in size")
    if not fitting:
        allowed = list(dict.fromkeys(kind.words for kind in kinds))
        words = allowed[0] if len(allowed) == 1 else f"{', '.join(allowed[:-1])} or {allowed[-1]}"
        raise InputError(f"{name} = {clipped(value)}; allowed: {words}")
    if all(kind.items for kind in fitting):
        for number, item in enumerate(value):
            _check(f"{name}[{number}]", item, fitting[0].items)


def _kinds(node: ast.expr, known: Mapping[str, Any]) -> tuple[_Kind, ...]:
    """The kinds that an annotation allows; `known` has the names of its module."""
    match node:
        case ast.BinOp():
            return *_kinds(node.left, known), *_kinds(node.right, known)
        case ast.Constant(value=None):
            return (_BASIC["None"],)
        case ast.Subscript(value=ast.Name(id=name)) if name in _LISTS:
            first = node.slice.elts[0] if isinstance(node.slice, ast.Tuple) else node.slice
            return (_Kind("a list", _is_list, _kinds(first, known)),)
        case ast.Subscript():
            return _kinds(node.value, known)
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return _meant(name, known.get(name))
        case _:
            return (_ANY,)


def _meant(name: str, found: Any) -> tuple[_Kind, ...]:
    """The kinds behind a name: those of an alias, else a class, which may not have been imported."""
    if name in ("Any", "object"):
        return (_ANY,)
    if name in _BASIC:
        return (_BASIC[name],)
    if found is None or (isinstance(found, type) and get_origin(found) is None):
        return (_named(name),)
    if isinstance(found, types.UnionType):
        return tuple(kind for part in get_args(found) for kind in _meant(getattr(part, "__name__", ""), part))
    origin = get_origin(found)
    return (_BASIC.get(getattr(origin, "__name__", ""), _ANY),)


def _named(name: str) -> _Kind:
    """A class by its name, or that of one that it derives from."""
    article = "an" if name[0] in "AEIOU" else "a"
    return _Kind(f"{article} {name}", lambda value: any(one.__name__ == name for one in type(value).__mro__))
