"""Predict, measure and explain how a robot with a rotating helical tail swims in a fluid-filled channel.

Public names are declared in `__init__.pyi` and loaded at first use, so that importing the package is cheap.
"""

from typing import Any

import lazy_loader

from spirillum.deprecated import RENAMED, current_name

_load, _, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from spirillum.version import package_version

        return package_version()
    if name in RENAMED:
        return __getattr__(current_name(name))
    if name not in __all__:
        raise AttributeError(f"module 'spirillum' has no attribute {name!r}")
    value = _load(name)
    if not isinstance(value, type):
        from spirillum.argument_validation import validate_arguments

        value = validate_arguments(value)
        value.__module__ = __name__  # where other processes find it again
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted((*__all__, "__version__"))
