"""Every set of free numbers has an answer or one sentence; an interruption is no error of the model."""

import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum import InputError
from spirillum.calibration.posterior import Sampling

WIDE = "biorob2012-wide"
SMALL = {"presets": (WIDE,), "wavelengths": (15.0, 25.0), "amplitudes": (1.5, 2.5), "seed": 4}


@pytest.mark.parametrize(
    "free",
    ["torque_constant", "shared_friction", "back_emf_constant", "viscosity", "shared_friction,wire_diameter"],
)
def test_a_number_of_the_motor_alone_is_fitted(made: Callable[..., Path], free: str) -> None:
    model = "rft" if "wire" in free else "sbt"
    found = sp.calibrate(made(**SMALL), WIDE, model=model, free=free, method="least-squares")
    for name in free.split(","):
        item = found.values[name]
        assert 0 < item.low < item.value < item.high


def test_draws_that_differ_in_the_back_emf_alone_are_predicted(made: Callable[..., Path]) -> None:
    problem = sp.calibrate(made(**SMALL), WIDE, free="back_emf_constant", method="least-squares", model="sbt").problem
    z = np.array([[-1.0], [0.0], [1.0]])
    together = problem.predicted(z)
    for n in range(3):
        for name, values in problem.predicted(z[n : n + 1]).items():
            assert together[name][n] == pytest.approx(values[0], rel=1e-14)


def test_a_negative_seed_is_refused() -> None:
    with pytest.raises(InputError, match="seed = -1; allowed: a whole number from 0"):
        Sampling(seed=-1)


def test_an_interruption_while_sampling_prints_nothing(
    made: Callable[..., Path], capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from spirillum.calibration.likelihood import Density

    calls = []
    whole = Density.__call__

    def interrupted(self: Density, z: Any) -> Any:
        calls.append(1)
        if len(calls) == 20:
            os.kill(os.getpid(), signal.SIGINT)
        return whole(self, z)

    monkeypatch.setattr(Density, "__call__", interrupted)
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)  # a worker of the tests ignores the signal
    try:
        with pytest.raises(KeyboardInterrupt):
            sp.calibrate(made(**SMALL), WIDE, model="sbt")
    finally:
        signal.signal(signal.SIGINT, handler)
    assert capfd.readouterr() == ("", "")


@pytest.mark.usefixtures("unplaced")
def test_figures_name_tails_and_say_synthetic(made: Callable[..., Path]) -> None:
    from spirillum.view.figures.calibration import calibration_figures

    found = sp.calibrate(made(**SMALL), WIDE, model="rft", method="least-squares")
    figures = calibration_figures(found)
    names = [label.get_text() for label in figures["residuals"].axes[-1].get_xticklabels()]
    assert {"15 x 1.5", "25 x 2.5"} <= set(names)
    words = [text.get_text() for text in figures["profiles"].findobj(lambda item: hasattr(item, "get_text"))]
    assert any("(synthetic)" in text for text in words)
    ticks = [tuple(axes.get_xticks()) for axes in figures["observed-40mm"].axes if axes.has_data()]
    assert len(set(ticks)) == 1
