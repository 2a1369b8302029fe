"""Attributes that the datasets of all runs carry."""

from __future__ import annotations

import json
from typing import Any

from spirillum.swimming.prediction import Prediction
from spirillum.version import versions


def run_attributes(prediction: Prediction) -> dict[str, Any]:
    """Robot, model, friction, calibration, errors, settings, references and versions of a run."""
    return {
        "robot": prediction.robot.name,
        "model": prediction.model.name,
        "friction": prediction.friction,
        "effective_friction": prediction.effective_friction,
        "calibrated": int(prediction.calibrated),
        **({"fitted_by": prediction.fitted_by} if prediction.fitted_by else {}),
        "error_estimate": prediction.error_estimate,
        "known_error": prediction.known_error,
        **({} if prediction.model.error_against is None else {"error_against": prediction.model.error_against}),
        "settings": json.dumps(prediction.robot.model_dump(), sort_keys=True),
        "references": " ".join(prediction.references),
        "versions": versions(),
    }
