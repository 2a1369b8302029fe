"""OpenCV, which comes with an extra, imported when it is first used: that takes a tenth of a second."""

from __future__ import annotations

from typing import Any

from spirillum.optional_dependencies import import_optional


def __getattr__(name: str) -> Any:
    """A function or constant of OpenCV."""
    if name.startswith("__"):
        raise AttributeError(name)
    value = globals()[name] = getattr(import_optional("cv2", "measuring a video", "video"), name)
    return value
