"""Measurement of videos, or calibration, in a separate process; run by `spirillum.pages.job`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from spirillum.pages.job import worker
from spirillum.progress import Progress


def measurement_data(answer: Mapping[str, Any]) -> dict[str, Any]:
    """A measurement as the page shows it: rows of quantities with their interval, as texts and in SI."""
    from spirillum.measurement.trials import MEASURED, RATE_NAMES

    def rows(items: Mapping[str, Any]) -> list[dict[str, Any]]:
        wanted = [name for name in MEASURED if items[name]["value"] is not None or name in RATE_NAMES]
        return [_row(name.replace("_", " "), name, items[name]) for name in wanted]

    trials = [
        {
            "name": trial["name"],
            "rows": rows(trial),
            "flags": [flag["sentence"] for flag in trial["flags"]],
            "markers": trial["scale"]["markers"],
            "film": f"{trial['name']}.annotated.mp4",
        }
        for trial in answer["trials"]
    ]
    failures = [f"{Path(one['video']).name}: {one['sentence']}" for one in answer["failures"]]
    return {
        "robot": answer["robot"],
        "summary": rows(answer["summary"]),
        "trials": trials,
        "warnings": [*failures, *answer.get("warnings", [])],
        "files": [name for name in answer["files"] if "/" not in name],
    }


def _row(label: str, name: str, item: Mapping[str, Any]) -> dict[str, Any]:
    from spirillum.measurement.statistics import rounded_with_ends

    seen = rounded_with_ends(item["value"], item.get("low"), item.get("high"), item["unit"])
    return {
        "name": name,
        "label": label,
        "value": seen.value,
        "low": seen.low,
        "high": seen.high,
        "unit": "" if seen.unit == "1" else seen.unit,
        "si": item["value"],
        "reason": item.get("reason", ""),
    }


def _work(request: dict[str, Any], progress: Progress) -> dict[str, Any]:
    output = Path(request["output"])
    if request["what"] == "calibrate":
        from spirillum.results.calibration import calibrate

        chosen = {name: request[name] for name in ("model", "method")}
        found = calibrate(request["observations"], request["robot"], output, **chosen, progress=progress)
        answer = found.to_dict()
        return {
            "shown": {
                "model": answer["model"],
                "method": answer["method"],
                "rows": [_row(name, name, item) for name, item in answer["parameters"].items()],
                "warnings": list(answer.get("warnings", [])),
                "statement": answer.get("effective_friction_statement", ""),
                "files": [name for name in answer["files"] if "/" not in name],
                "figures": sorted(name for name in answer["files"] if name.endswith(".png")),
            }
        }
    from spirillum.results.measurement import measure

    return {"shown": measurement_data(measure(request["films"], request["setup"], output, progress=progress).to_dict())}


if __name__ == "__main__":
    worker(_work)
