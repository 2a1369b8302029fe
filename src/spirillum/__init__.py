"""Predict, measure and explain how a robot with a rotating helical tail swims in a fluid-filled channel.

Public names are declared in `__init__.pyi` and loaded at first use, so that importing the package is cheap.
"""

from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:  # `typing` itself takes most of the time that the package has for its import
    from collections.abc import Callable
    from typing import Any

_stub: list[tuple[Callable[[str], Any], list[str]]] = []


def _public() -> tuple[Callable[[str], Any], list[str]]:
    """Return the loader of public names and the names, read from the stub at first use."""
    if not _stub:
        import lazy_loader

        load, _, names = lazy_loader.attach_stub(__name__, __file__)
        _stub.append((load, names))
    return _stub[0]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from spirillum.version import package_version

        return package_version()
    if name.startswith("__") and name != "__all__":  # which Python itself looks for
        raise AttributeError(f"module 'spirillum' has no attribute {name!r}")
    load, names = _public()
    if name == "__all__":
        return names
    from spirillum.deprecated import RENAMED, current_name

    if name in RENAMED:
        return __getattr__(current_name(name))
    if name not in names:
        raise AttributeError(f"module 'spirillum' has no attribute {name!r}")
    value = load(name)
    if not isinstance(value, type):
        from spirillum.argument_validation import validate_arguments

        value = validate_arguments(value)
        value.__module__ = __name__  # where other processes find it again
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted((*_public()[1], "__version__"))
