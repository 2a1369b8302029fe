"""The table of a tail along points in a tube: made, and answering as direct solutions do."""

from pathlib import Path

import numpy as np
import pytest

import spirillum as sp

PLACES = ({"gap": "2.2 mm"}, {"gap": "1.3 mm", "pitch": "1 deg"})
"""Between the nodes of the table."""


def wave(count: int = 121) -> list[list[float]]:
    """Points of a tail that is no helix: its turns and its radius vary, mm."""
    x = np.linspace(0.0, 60.0, count)
    angle = 2.0 * np.pi * x / 22.0 + 0.3 * np.sin(2.0 * np.pi * x / 60.0)
    radius = 2.6 * (1.0 - np.exp(-((x / 8.0) ** 2))) + 0.2 * np.cos(x / 9.0)
    return np.stack([x, radius * np.cos(angle), radius * np.sin(angle)], axis=1).tolist()  # type: ignore[no-any-return]


@pytest.mark.slow
def test_a_table_of_a_curve_agrees_with_direct_solutions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SPIRILLUM_CACHE", str(tmp_path))
    robot = sp.load("biorob2012-wide", tail={"curve": wave()})
    sp.prepare(robot, stage="straight")
    for place in PLACES:
        tabled, direct = (
            sp.predict(robot, model="tube", placement=place, motion="held", band=False, resolution={"form": form})
            for form in ("table", "direct")
        )
        assert (tabled.to_dict()["form"], direct.to_dict()["form"]) == ("table", "direct")
        assert tabled.error_estimate is not None
        assert tabled.forward_velocity == pytest.approx(direct.forward_velocity, rel=tabled.error_estimate)
    run = sp.simulate(robot, motion="held", placement=PLACES[-1], timing={"duration": "20 s"})
    assert float(run["forward_velocity"][-1]) == pytest.approx(tabled.forward_velocity, rel=1e-4)
