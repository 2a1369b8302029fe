"""The numbers beside the picture: quantities with unit and meaning, and a prediction with band and stated error."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from spirillum.quantities import QUANTITIES
from spirillum.units import display_unit, shown_in

if TYPE_CHECKING:
    from spirillum.swimming.prediction import Prediction

TABLE = (
    "forward_velocity",
    "advance_per_radian",
    "tail_rotation_rate",
    "body_rotation_rate",
    "drive_torque",
    "motor_current",
    "battery_voltage",
    "electrical_power",
    "effective_friction",
    "hydrodynamic_efficiency",
    "overall_efficiency",
    "cost_of_transport",
)
"""Quantities of the table, in its order."""
SERIES = (
    "forward_velocity",
    "tail_rotation_rate",
    "body_rotation_rate",
    "motor_current",
    "battery_voltage",
    "drive_torque",
    "electrical_power",
    "wall_gap",
    "tail_gap",
    "azimuth",
    "pitch",
    "yaw",
    "contact_force",
    "mean_flow",
)
"""Quantities of a run that are shown or drawn over time."""

_LABELS = {
    "forward_velocity": "velocity",
    "drive_torque": "torque",
    "motor_current": "current",
    "battery_voltage": "voltage",
    "electrical_power": "power",
    "hydrodynamic_efficiency": "efficiency, fluid",
    "overall_efficiency": "efficiency, overall",
    "wall_gap": "film under the body",
    "tail_gap": "gap of the tail",
    "contact_force": "load on asperities",
    "tail_rotation_rate": "tail rate",
    "body_rotation_rate": "body rate",
    "effective_friction": "B_eff",
    "advance_per_radian": "advance",
}


def quantity_list(rows: Mapping[str, Any] | None = None) -> dict[str, dict[str, Any]]:
    """Label, unit, factor from SI, and meaning of all that is shown, from the registry.

    Args:
        rows: values of a prediction, by whose size the units go: a bacterium's speed is read in um/s.
    """
    found = {}
    for name in dict.fromkeys((*TABLE, *SERIES)):
        item = QUANTITIES[name]
        value = (rows or {}).get(name, {}).get("value")
        unit = display_unit(value, item.unit)
        factor = 1.0 if unit == item.unit else 1.0 / _factor(unit)
        label = _LABELS.get(name, name.replace("_", " "))
        meaning = item.meaning + (f" ({item.source})" if item.source else "")
        found[name] = {"label": label, "unit": "" if unit == "1" else unit, "factor": factor, "meaning": meaning}
    return found


def _factor(unit: str) -> float:
    return 1.0 / shown_in(1.0, unit)


def prediction_answer(prediction: Prediction) -> dict[str, Any]:
    """A prediction as the page shows it; SI, None for what does not apply."""
    answer = prediction.to_dict()
    rows = {
        name: {key: _finite(answer[name].get(key)) for key in ("value", "low", "high")}
        for name in TABLE
        if isinstance(answer.get(name), dict)
    }
    error = answer["error_estimate"]
    return {
        "model": answer["model"],
        "form": answer.get("form", ""),
        "reason": answer.get("model_reason", ""),
        "friction": answer["friction"],
        "calibrated": answer["calibrated"],
        "rows": rows,
        "forces": forces_of(prediction),
        "band": "band" in answer,
        "error": _finite(error.get("value")),
        "against": error.get("against", ""),
        "statement": error.get("statement", ""),
        "others": answer.get("other_models", {}).get("statement", ""),
        "warnings": list(answer.get("warnings", [])),
    }


def forces_of(prediction: Prediction) -> list[dict[str, Any]]:
    """Forces on a robot in steady swimming, N, each with the part of the robot at which it is drawn.

    Weight less buoyancy is vertical, where masses are known.
    """
    found = axial_forces_of(prediction)
    weight = prediction.robot.derived().get("submerged_weight")
    if weight is not None:
        found.append({"name": "weight less buoyancy", "at": "body", "axis": "z", "value": -weight.value})
    return found


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


def _finite(value: Any) -> float | None:
    return float(value) if isinstance(value, (int, float)) and math.isfinite(value) else None
