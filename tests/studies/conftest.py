"""Small studies, and observations that the model itself has made (synthetic, and labelled so)."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import spirillum as sp

SMALL = {
    "title": "Four tails",
    "models": ["sbt", "rft"],
    "friction": ["none", "rotor", "paper"],
    "assumed_motor_rates": ["0.5 Hz", "1 Hz"],
    "grid": {
        "channels": {"wide": "biorob2012-wide", "narrow": "biorob2012-narrow"},
        "wavelengths": ["20 mm", "25 mm"],
        "amplitudes": ["1.5 mm", "2.5 mm"],
    },
}


@pytest.fixture
def small() -> dict[str, object]:
    """A study of two wavelengths, two amplitudes and two channels."""
    return {**SMALL}


@pytest.fixture(scope="session")
def planted(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Write what a model with a planted friction does as if observed: five trials a robot, equal to 1e-9."""

    def write(
        study: dict[str, object] | None, model: str, friction: str, effective: float, spread: float = 1e-9
    ) -> Path:
        made = sp.study(study, models=[model], overrides={"friction.effective": f"{effective} N m s/rad"})
        chosen = made.sel(model=model, friction=friction)
        rows = ["# synthetic: made by a model with a planted friction, nothing here is measured"]
        rows.append(
            "robot,channel_diameter_mm,wavelength_mm,amplitude_mm,trial,"
            "forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz,motor_rate_Hz"
        )
        for channel in chosen["channel"].values:
            for wavelength in chosen["wavelength"].values:
                for amplitude in chosen["amplitude"].values:
                    one = chosen.sel(channel=channel, wavelength=wavelength, amplitude=amplitude)
                    values = [
                        float(one["forward_velocity"]) * 1e3,
                        *(float(one[f"{part}_rotation_rate"]) / (2 * np.pi) for part in ("tail", "body", "motor")),
                    ]
                    geometry = [float(one["channel_diameter"]) * 1e3, wavelength * 1e3, amplitude * 1e3]
                    for trial in range(5):
                        scaled = [repr(float(v * (1 + (spread or 1e-12) * (trial - 2)))) for v in values]
                        rows.append(",".join(["synthetic", *(f"{g:.6g}" for g in geometry), str(trial + 1), *scaled]))
        path = tmp_path_factory.mktemp("observations") / "observations.csv"
        path.write_text("\n".join(rows) + "\n", encoding="utf-8")
        return path

    return write
