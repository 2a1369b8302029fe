"""The engine of motion in a tube on a stand-in for a robot's table: films and two-dimensional laws of a long capsule.

Along the straight side of the body, stations at offsets e_i and gaps h_i carry per length, over the viscosity:

    R_n (v_n)^2 + R_t (v_t - e_i k Omega)^2 + T Omega^2 + R_x v_x^2,   k = lambda^2/(1 + lambda^2), lambda = a/R

so that a body that is free of force orbits at k Omega, whatever its offset, and one that is driven around and free of
torque turns as if glued to the radius vector. R_n is that of a thin film along a line. The rest is a constant matrix,
turned with the tail's phase.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import math
import runpy
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from spirillum.arrays import Samples
from spirillum.kernels.native import Array, Float64, native, sources_digest

_LOBATTO = ((-1.0, 1 / 20), (-math.sqrt(3 / 7), 49 / 180), (0.0, 16 / 45), (math.sqrt(3 / 7), 49 / 180), (1.0, 1 / 20))


class StandIn:
    """Makes tables; holds the engine that reads them."""

    def __init__(self, steps: SimpleNamespace) -> None:
        self.steps = steps

    @staticmethod
    def level_resistance(table: Samples, offset: float) -> Samples:
        """The 8x8 of a table at an offset, level and at phase 0."""
        out = np.empty((8, 8))
        stand_in_at(table, offset, out)
        return out

    @staticmethod
    def table(matrix: Samples, radius: float, body: float, length: float, middle: float, **more: float) -> Samples:
        """A table.

        Args:
            matrix: the rest at phase 0, 8x8, over the viscosity.
            radius: R.
            body: a.
            length: of the straight side.
            middle: x of its middle.
            more: `sliding` (R_t at h = a, per length), `axial` (R_x per length), `largest` (largest pitch).
        """
        sliding, axial, largest = more.get("sliding", 20.0), more.get("axial", 5.0), more.get("largest", 0.5)
        stations = [(middle + 0.5 * length * place, length * share) for place, share in _LOBATTO]
        return np.concatenate([np.ravel(matrix), [radius, body, sliding, axial, largest], np.ravel(stations)])


@native("out")
def stand_in_at(table: Float64[Array, "size"], offset: float, out: Float64[Array, "8 8"]) -> None:  # noqa: F821
    """Fill the 8x8 of the stand-in, level and at phase 0."""


def _library() -> Path:
    """The compiled equations with the stand-in's resistance, compiled once."""
    sources, stand_in = Path(__file__).parents[2] / "csrc", Path(__file__).with_name("stand_in.c")
    key = hashlib.sha256((sources_digest() + stand_in.read_text()).encode()).hexdigest()[:16]
    folder = Path(tempfile.gettempdir()) / f"spirillum-stand-in-{key}"
    if not folder.exists():
        with tempfile.TemporaryDirectory(dir=tempfile.gettempdir()) as name:
            made = Path(name) / "made"
            shutil.copytree(sources, made / "csrc")
            shutil.copy(stand_in, made / "csrc")
            (made / "csrc/tube_motion.c").rename(made / "csrc/tube_motion.inc")  # which the stand-in includes
            runpy.run_path(str(made / "csrc/build.py"))["compile_all"](made, ("-O1",), wide=False)
            with contextlib.suppress(OSError):  # another process was faster
                made.rename(folder)
    return next(folder.glob("_core.*"))


@pytest.fixture(scope="module")
def stand_in() -> Iterator[StandIn]:
    """Let the engine run on the stand-in."""
    from spirillum.dynamics import free_robot, integration, return_map
    from spirillum.kernels import core
    from spirillum.kernels import native as calls

    library = ctypes.CDLL(str(_library()))
    steps = SimpleNamespace(**runpy.run_path(core.__file__))  # whose calls have not found their library yet
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(calls, "library", lambda: library)
        for module in (free_robot, integration, return_map):
            patch.setattr(module, "core", steps)
        yield StandIn(steps)
