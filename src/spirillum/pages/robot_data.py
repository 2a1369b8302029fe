"""Data of a simulated robot for the page: meshes, quantities, and the recorded samples of its run."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.data_tables import rows_of
from spirillum.quantities import QUANTITIES
from spirillum.robot.links import outlines_of
from spirillum.robot.mesh import COLOURS, RobotMesh, robot_mesh
from spirillum.robot.outline import Arc, Segment
from spirillum.robot.robot import Robot
from spirillum.robot.surface import corner_normals, linear_light
from spirillum.swimming.preparation import WALLED
from spirillum.units import display_unit, shown_in

if TYPE_CHECKING:
    from spirillum.dynamics.plant import Snapshot
    from spirillum.swimming.motions import ReleasedMotion
    from spirillum.swimming.prediction import Prediction


_CREASE = np.radians(40.0)  # edges sharper than this stay sharp
_FINENESS = 0.75
_ALONG = np.linspace(0.0, 1.0, 7)  # positions along each piece of the body's outline
_ALONG_POINTS = np.linspace(0.0, 1.0, 33)  # along a piece through points
_METALS = ("shaft", "coupling", "stub", "arm", "tail")


def shape_of(robot: Robot) -> dict[str, Any]:
    """Meshes of body and rotor, and the tube; lengths in m."""
    # `body` and `rotor` hold `vertices` (base64 of float32: place, normal, linear colour, metal; ten numbers each) and
    # `triangles` (base64 of uint32). The rotor is at phase 0 and turns about the body's x axis.
    robot.check_body("the page")
    pieces = robot_mesh(robot, fineness=_FINENESS)
    channel, tail = robot.channel, robot.tail
    half = 0.5 * robot.body.length
    return {
        **{part: _packed([piece for piece in pieces if piece.part == part]) for part in ("body", "rotor")},
        "nose": half,
        "tip": -half - robot.coupling.length - tail.length,
        "root": -half - robot.coupling.length,
        "radius": 0.5 * robot.body.diameter,
        "tail_radius": tail.amplitude + 0.5 * tail.wire_diameter,
        "tube_radius": None if channel is None else 0.5 * channel.diameter,
        "tube_length": None if channel is None else channel.length,
        "profile": _profile(robot),
    }


def _profile(robot: Robot) -> list[list[float]]:
    """Points (x, rho) along the body's outline, m: circles about its axis that together are its silhouette."""
    found = []
    for piece in outlines_of(robot)["body"].pieces:
        x, rho = piece.points(_ALONG if isinstance(piece, (Arc, Segment)) else _ALONG_POINTS)
        found += [[float(a), float(b)] for a, b in zip(x, rho, strict=True)]
    return found


def _packed(pieces: list[RobotMesh]) -> dict[str, Any]:
    """Pieces as one list of corners, those that are alike once."""
    corners: list[Samples] = []
    for piece in pieces:
        normals = corner_normals(piece.vertices, piece.faces, float(_CREASE)).reshape(-1, 3)
        metal = np.full((len(normals), 1), float(piece.name in _METALS and COLOURS[piece.name] != COLOURS["body"]))
        colours = linear_light(np.repeat(piece.colours, 3, axis=0))
        corners.append(np.concatenate([piece.vertices[piece.faces].reshape(-1, 3), normals, colours, metal], axis=1))
    if not corners:
        corners = [np.zeros((0, 10))]
    unique, index = np.unique(np.concatenate(corners).astype("<f4"), axis=0, return_inverse=True)
    return {
        "vertices": base64.b64encode(np.ascontiguousarray(unique, dtype="<f4").tobytes()).decode(),
        "triangles": base64.b64encode(index.ravel().astype("<u4").tobytes()).decode(),
    }


_ROWS = rows_of("pages/quantities.csv")


def _names(column: str) -> tuple[str, ...]:
    """Quantities that have a number in a column, in its order."""
    return tuple(row["name"] for row in sorted(_ROWS, key=lambda row: int(row[column] or 0)) if row[column])


TABLE = _names("table")  #: Quantities of the table, in its order.
SERIES = _names("series")  #: Quantities of a run that are displayed or plotted over time.
_LABELS = {row["name"]: row["label"] for row in _ROWS if row["label"]}


def quantity_list(rows: Mapping[str, Any] | None = None) -> dict[str, dict[str, Any]]:
    """Label, unit, factor from SI, and meaning of all that is shown, from the registry."""
    found = {}
    for name in dict.fromkeys((*TABLE, *SERIES)):
        item = QUANTITIES[name]
        value = (rows or {}).get(name, {}).get("value")
        unit = display_unit(value, item.unit)
        factor = 1.0 if unit == item.unit else shown_in(1.0, unit)
        label = _LABELS.get(name, name.replace("_", " "))
        meaning = item.meaning + (f" ({item.source})" if item.source else "")
        found[name] = {"label": label, "unit": "" if unit == "1" else unit, "factor": factor, "meaning": meaning}
    return found


def prediction_answer(prediction: Prediction) -> dict[str, Any]:
    """A prediction as the page shows it; SI, None for what does not apply."""
    answer = prediction.to_dict()
    rows = {
        name: {key: finite(answer[name].get(key)) for key in ("value", "low", "high")}
        for name in TABLE
        if isinstance(answer.get(name), dict)
    }
    error = answer["error_estimate"]
    found = axial_forces_of(prediction)
    weight = prediction.robot.derived().get("submerged_weight")
    if weight is not None:
        found.append({"name": "weight less buoyancy", "at": "body", "axis": "z", "value": -weight.value})
    return {
        "model": answer["model"],
        "form": answer.get("form", ""),
        "reason": answer.get("model_reason", ""),
        "friction": answer["friction"],
        "calibrated": answer["calibrated"],
        "rows": rows,
        "columns": dict.fromkeys(("trial", "steady")) if answer["model"] == WALLED else {},
        "forces": found,
        "band": "band" in answer,
        "error": finite(error.get("value")),
        "against": error.get("against", ""),
        "statement": error.get("statement", ""),
        "others": answer.get("other_models", {}).get("statement", ""),
        "warnings": list(answer.get("warnings", [])),
    }


def released_answer(motion: ReleasedMotion) -> dict[str, Any]:
    """A trial or steady motion as the page shows it: SI values of the rows, or the reason why there are none."""
    state = motion.basis.get("state", "")
    title = motion.reason or f"{state}; {motion.basis['assumption']}"
    return {"title": title, "rows": {name: finite(motion.values.get(name)) for name in TABLE}}


def axial_forces_of(prediction: Prediction) -> list[dict[str, Any]]:
    """Drag and thrust of the fluid along the axis, N; none for a table, which holds the force-free robot as a whole."""
    from spirillum.swimming.steady import axial_forces

    if prediction.model.form == "table":
        return []
    along = axial_forces(prediction.batch, prediction.model, prediction.swimming, calibrated=prediction.calibrated)[0]
    parts = (("drag of the body", "body", along[0]), ("thrust of the tail", "tail", along[2]))
    return [
        {"name": name, "at": at, "axis": "x", "value": float(value)}
        for name, at, value in parts
        if math.isfinite(value)
    ]


MOST = 12_000  #: Samples that are kept; beyond it every other one is dropped.
_DRAWN = 900  # samples of a plot's past, at most


class SampleRecording:
    """Samples in their order; its memory is bounded."""

    def __init__(self) -> None:
        self._rows: list[Snapshot] = []
        self._duties: list[float] = []
        self._every, self._count = 1, 0

    def __len__(self) -> int:
        return len(self._rows)

    def add(self, moment: Snapshot, duty: float) -> None:
        """Store a snapshot."""
        self._count += 1
        if self._count % self._every:
            return
        self._rows.append(moment)
        self._duties.append(duty)
        if len(self._rows) > MOST:
            del self._rows[1::2], self._duties[1::2]
            self._every *= 2

    def data(self) -> dict[str, Any]:
        """All of it as lists: `time`, `position`, `attitude`, `tail_phase`, `duty`, `values` by name; SI."""
        return {
            "time": [row.time for row in self._rows],
            "position": [row.pose.position.tolist() for row in self._rows],
            "attitude": [row.pose.attitude.tolist() for row in self._rows],
            "tail_phase": [row.pose.tail_phase for row in self._rows],
            "duty": list(self._duties),
            "values": {
                name: [finite(row.values[name]) for row in self._rows]
                for name in SERIES
                if self._rows and name in self._rows[0].values
            },
        }

    def past(self) -> dict[str, Any]:
        """Thinned samples for plots."""
        whole = self.data()
        every = slice(None, None, max(1, math.ceil(len(self) / _DRAWN)))
        path = [place[1:] for place in whole["position"][every]]
        return {
            "time": whole["time"][every],
            "path": path,
            "values": {name: column[every] for name, column in whole["values"].items()},
        }


def finite(value: Any) -> float | None:
    """A number, or None for anything else and for NaN, which JSON does not know."""
    return float(value) if isinstance(value, (int, float)) and math.isfinite(value) else None


def thinned(count: int, most: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Indices of at most so many samples of a run, the first and the last among them."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))
