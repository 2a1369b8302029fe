"""Studies that the tests of figures share; the observations are synthetic and say so."""

from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure

import spirillum as sp

SYNTHETIC = """\
# synthetic numbers for tests, not measured
channel_diameter_mm,wavelength_mm,amplitude_mm,trial,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz,motor_rate_Hz
40,25,2.5,1,1.10,1.20,-0.05,1.25
40,25,2.5,2,1.20,1.30,-0.05,1.35
40,25,2.5,3,1.15,1.22,-0.05,1.27
40,25,1.5,1,0.60,1.40,-0.03,
40,25,1.5,2,0.64,1.44,-0.03,
40,10,1.5,1,0.50,1.30,,
40,10,1.5,2,0.52,1.32,,
30,25,2.5,1,0.70,1.20,-0.05,1.25
"""


@pytest.fixture(scope="session")
def paper_study() -> Any:
    """The paper's study without observations."""
    return sp.study()


@pytest.fixture(scope="session")
def observed_study(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The paper's study with synthetic observations of a few tails."""
    path = Path(tmp_path_factory.mktemp("observed")) / "synthetic.csv"
    path.write_text(SYNTHETIC)
    return sp.study(observations=path)


@pytest.fixture(autouse=True)
def journal_width(monkeypatch: pytest.MonkeyPatch) -> None:
    """No figure is wider than 170 mm."""

    class Checked(Figure):
        def __init__(self, figsize: tuple[float, float]) -> None:
            assert figsize[0] <= 170.0 / 25.4
            super().__init__(figsize=figsize)

    monkeypatch.setattr("spirillum.view.figures.style.Figure", Checked)
