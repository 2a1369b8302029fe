"""Matplotlib figures, with the settings of `style` whatever the user's are."""

from __future__ import annotations

import logging

from spirillum.errors import InputError

__all__: list[str] = []

_log = logging.getLogger("matplotlib")
_level = _log.level
_log.setLevel(logging.CRITICAL)  # of settings that do not count here
try:
    import matplotlib as mpl  # noqa: F401 - reads the user's settings once
except (ValueError, OSError) as _error:
    raise InputError(
        "the settings of matplotlib cannot be read (matplotlibrc, MPLBACKEND); allowed: valid ones, or none"
    ) from _error
finally:
    _log.setLevel(_level)
