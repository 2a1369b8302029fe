"""The engine of motion in a tube on a stand-in for a robot's table: films and two-dimensional laws of a long capsule.

Along the straight side of the body, stations at offsets e_i and gaps h_i carry per length, over the viscosity:

    R_n (v_n)^2 + R_t (v_t - e_i k Omega)^2 + T Omega^2 + R_x v_x^2,   k = lambda^2/(1 + lambda^2), lambda = a/R

so that a body that is free of force orbits at k Omega, whatever its offset, and one that is driven around and free of
torque turns as if glued to the radius vector. R_n is that of a thin film along a line. The rest is a constant matrix,
turned with the tail's phase.
"""

from __future__ import annotations

import hashlib
import importlib
import math
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from spirillum.arrays import Samples

_LOBATTO = ((-1.0, 1 / 20), (-math.sqrt(3 / 7), 49 / 180), (0.0, 16 / 45), (math.sqrt(3 / 7), 49 / 180), (1.0, 1 / 20))

_SOURCE = """
import math
import numpy as np
from spirillum.kernels.compiled import compiled

@compiled
def resistance_at(table, e, p, psi, phi, out):
    sin, cos = math.sin(phi), math.cos(phi)
    for i in range(8):
        for j in range(8):
            out[i, j] = table[8 * i + j]
    for first in (1, 4):
        for i in range(8):
            a, b = out[i, first], out[i, first + 1]
            out[i, first], out[i, first + 1] = cos * a - sin * b, sin * a + cos * b
    for first in (1, 4):
        for j in range(8):
            a, b = out[first, j], out[first + 1, j]
            out[first, j], out[first + 1, j] = cos * a - sin * b, sin * a + cos * b
    radius, body = table[64], table[65]
    k = body**2 / (radius**2 + body**2)
    d = (math.cos(p) * math.cos(psi), math.cos(p) * math.sin(psi), math.sin(p))
    f = np.empty((3, 3))  # rows: axes of F in the place's
    f[0, 0], f[0, 1], f[0, 2] = d
    f[1, 0], f[1, 1], f[1, 2] = -math.sin(psi), math.cos(psi), 0.0
    f[2, 0] = d[1] * 0.0 - d[2] * math.cos(psi)
    f[2, 1] = -d[2] * math.sin(psi)
    f[2, 2] = d[0] * math.cos(psi) + d[1] * math.sin(psi)
    rows = np.zeros((4, 8))
    weights = np.empty(4)
    for station in range(69, table.size, 2):
        x, length = table[station], table[station + 1]
        side, up = x * d[1], x * d[2] - e
        offset = max(math.hypot(side, up), 1e-9 * radius)
        side, up = side / offset, up / offset
        h = max(radius - body - offset, 1e-9)
        for i in range(3):
            n = f[i, 1] * side + f[i, 2] * up
            t = -f[i, 1] * up + f[i, 2] * side
            rows[0, i], rows[1, i], rows[3, i] = n, t, f[i, 0]
        for row in (0, 1, 3):
            rows[row, 4], rows[row, 5] = -x * rows[row, 2], x * rows[row, 1]
        sliding = table[66] * math.sqrt(body / h)
        rows[1, 3] = -offset * k
        rows[2, 3] = 1.0
        weights[0] = 3.0 * math.sqrt(2.0) * math.pi * (body * radius / ((radius - body) * h)) ** 1.5
        weights[1] = sliding
        weights[2] = sliding * k * offset * (radius - body - k * offset)
        weights[3] = table[67]
        for row in range(4):
            for i in range(6):
                for j in range(6):
                    out[i, j] += length * weights[row] * rows[row, i] * rows[row, j]
    return 1 if abs(p) > table[68] else 0
"""


class StandIn:
    """Makes tables; holds the equations that read them."""

    def __init__(self, motion: ModuleType) -> None:
        self.motion = motion

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


def _modules() -> dict[str, ModuleType]:
    """The compiled equations with the stand-in's resistance, in files of their own so that they are compiled once."""
    kernels = Path(sys.modules["spirillum.kernels"].__path__[0])
    names = (
        "compiled",
        "rigid_links",
        "contacts",
        "dry_friction",
        "rosenbrock",
        "tube_motion",
        "two_links",
        "stiff_steps",
    )
    texts = {name: (kernels / f"{name}.py").read_text() for name in names}
    key = hashlib.sha256((_SOURCE + "".join(texts.values())).encode()).hexdigest()[:16]
    folder = Path(tempfile.gettempdir()) / f"spirillum-stand-in-{key}"
    folder.mkdir(exist_ok=True)
    changes = {
        "spirillum.kernels.tube_table": f"stand_in_{key}_table",
        "spirillum.kernels.tube_motion": f"stand_in_{key}_motion",
    }
    files = {"table": _SOURCE, "motion": texts["tube_motion"], "steps": texts["stiff_steps"]}
    for name, text in files.items():
        changed = text
        for old, new in changes.items():
            changed = changed.replace(f"from {old} import", f"from {new} import")
        target = folder / f"stand_in_{key}_{name}.py"
        if not target.exists():
            target.write_text(changed)
    sys.path.insert(0, str(folder))
    try:
        return {name: importlib.import_module(f"stand_in_{key}_{name}") for name in ("motion", "steps")}
    finally:
        sys.path.remove(str(folder))


@pytest.fixture(scope="module")
def stand_in() -> Iterator[StandIn]:
    """Let the engine run on the stand-in."""
    from spirillum.dynamics import integration, return_map, tube_robot

    modules = _modules()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tube_robot, "kernel", modules["motion"])
        patch.setattr(integration, "stiff_steps", modules["steps"])
        patch.setattr(return_map, "stiff_steps", modules["steps"])
        yield StandIn(modules["motion"])
