"""The tracker learns from the same frames once, however often a test measures their film."""

from collections.abc import Iterator
from contextlib import contextmanager
from copy import deepcopy
from hashlib import sha256
from typing import Any

import pytest


@contextmanager
def learnt_once() -> Iterator[None]:
    """While the block runs; what is learnt changes while a robot is followed, so each caller has a copy."""
    from spirillum.live import tracker
    from spirillum.measurement import imported, setup_template
    from spirillum.vision.track import assembly
    from spirillum.vision.track.learning import learnt_from

    known: dict[str, Any] = {}

    def learnt(video: Any, frames: list[Any], *given: Any, **how: Any) -> Any:
        told = sha256(repr((video.name, video.size, given, how)).encode())
        for frame in frames:
            told.update(repr((frame.index, frame.time)).encode() + frame.image.tobytes())
        if (key := told.hexdigest()) not in known:
            known[key] = learnt_from(video, frames, *given, **how)
        return deepcopy(known[key])

    with pytest.MonkeyPatch.context() as patch:
        for module in (assembly, tracker, imported, setup_template):
            patch.setattr(module, "learnt_from", learnt)
        yield
