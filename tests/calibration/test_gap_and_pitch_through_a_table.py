"""Gap and pitch of a model that computes the walls: interpolated, with a stated error that is honest.

The model here is made up, for the true one takes minutes: what the walls add is a closed form of gap and pitch.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum import InputError
from spirillum.fluid.closed.perrin import body_axial
from spirillum.fluid.closed.rft import Rft
from spirillum.fluid.registry import MODELS, SWIMMER_MODELS
from spirillum.results.calibration import write_calibration
from spirillum.robot.batch import RobotBatch
from spirillum.robot.load import load
from spirillum.robot.placement import Placement
from spirillum.swimming.band import TOLERANCE

WIDE = "biorob2012-wide"
TAILS = [(15.0, 1.5), (20.0, 2.0), (25.0, 2.5)]


class MadeUp(Rft):
    """Walls that add to the body's drag what gap and pitch say."""

    name = "tube"
    placed = True
    alike = False
    """Whether gap and pitch act in the same way, so that nothing tells them apart."""
    coarse = 0.0
    """What the resolution of a band gets wrong."""

    def axial(self, batch: Any) -> np.ndarray:
        gap, pitch = batch.placement.gap or 5e-4, batch.placement.pitch or 0.0
        drag, rotation = body_axial(batch)
        off = self.coarse if batch.options.tube.tolerance == TOLERANCE else 0.0
        near = (1e-3 / gap) ** 0.4 * np.exp(-6.0 * pitch) * (1.0 + off)
        found = np.array(np.broadcast_to(super().axial(batch), (batch.size, 4, 4)))
        found[:, 0, 0] += 2.0 * near * drag
        found[:, 1, 1] += (0.8 * near if self.alike else 0.5 * (1e-3 / gap) ** 0.7) * rotation
        return found


@pytest.fixture
def walls(monkeypatch: pytest.MonkeyPatch) -> MadeUp:
    """The made-up model in place of the true one."""
    model = MadeUp()
    monkeypatch.setitem(SWIMMER_MODELS, "tube", model)
    monkeypatch.setitem(MODELS, "tube", model)
    return model


def observed(path: Path, model: MadeUp, gap: float, pitch: float = 0.0, error: float = 0.0) -> Path:
    rng = np.random.default_rng(2)
    lines = [
        "# synthetic",
        "channel_diameter_mm,wavelength_mm,amplitude_mm,trial,forward_velocity_mm_s,tail_rate_Hz,body_rate_Hz",
    ]
    robot = load(WIDE)
    for wavelength, amplitude in TAILS:
        tail = robot.tail.model_copy(update={"wavelength": 1e-3 * wavelength, "amplitude": 1e-3 * amplitude})
        there = Placement(gap=f"{gap} m", pitch=f"{pitch} rad")
        swum = sp.swim(RobotBatch.of(robot.model_copy(update={"tail": tail}), there), model)
        for trial in range(3):
            speed, body = (1.0 + error * rng.normal(size=2)) * [swum.forward_velocity[0], swum.body_rotation_rate[0]]
            rate = swum.tail_rotation_rate[0]
            numbers = (1e3 * speed, rate / 2 / np.pi, body / 2 / np.pi)
            lines.append(f"40,{wavelength},{amplitude},{trial},{','.join(f'{n:.12g}' for n in numbers)}")
    path.write_text("\n".join(lines) + "\n")
    return path


def test_a_planted_gap_comes_back_within_the_stated_error(walls: MadeUp, tmp_path: Path) -> None:
    path = observed(tmp_path / "o.csv", walls, gap=3.1e-4)
    found = sp.calibrate(path, WIDE, model="tube", method="least-squares", free="gap")
    error = found.problem.interpolation_error
    assert 0 < error < 2e-3
    assert found.values["gap"].value == pytest.approx(3.1e-4, rel=10 * error)
    assert any("resistances are interpolated" in warning for warning in found.warnings)
    write_calibration(found, tmp_path / "out", figures=False)
    answer = sp.predict(WIDE, model="tube", calibration=tmp_path / "out" / "calibration.toml", tail_rate="1 Hz")
    assert answer.batch.placement.gap == pytest.approx(found.values["gap"].value)
    assert answer.band is None
    given = sp.predict(
        WIDE,
        model="tube",
        calibration=tmp_path / "out" / "calibration.toml",
        placement={"gap": "1 mm", "pitch": "0 deg"},
        tail_rate="1 Hz",
    )
    assert given.batch.placement.gap == pytest.approx(1e-3)


def test_the_stated_error_holds_the_resolution_of_the_table(walls: MadeUp, tmp_path: Path) -> None:
    path = observed(tmp_path / "o.csv", walls, gap=3.1e-4)
    walls.coarse = 0.05
    found = sp.calibrate(path, WIDE, model="tube", method="least-squares", free="gap")
    error = found.problem.interpolation_error
    said = next(warning for warning in found.warnings if "resistances are interpolated" in warning)
    assert "interpolation" in said
    assert "coarse resolution of the table" in said
    for place, robot in enumerate(found.experiment.robots):
        there = Placement(gap=f"{found.values['gap'].value} m", pitch="0 rad")
        exact = sp.swim(RobotBatch.of(robot, there), walls, tail_rate=np.array([6.0]))
        table = found.predicted["advance"][0][place]
        assert abs(table / exact.advance_per_radian[0] - 1.0) <= 1.1 * error
        assert abs(table / exact.advance_per_radian[0] - 1.0) > 0.01


def test_gap_and_pitch_that_act_alike_are_refused_by_name(walls: MadeUp, tmp_path: Path) -> None:
    walls.alike = True
    path = observed(tmp_path / "o.csv", walls, gap=4e-4, pitch=0.02, error=0.01)
    with pytest.raises(InputError, match=r"(gap and pitch|pitch and gap) cannot be told apart"):
        sp.calibrate(path, WIDE, model="tube", method="least-squares", free="gap,pitch")


def test_gap_and_pitch_that_differ_are_both_found(walls: MadeUp, tmp_path: Path) -> None:
    path = observed(tmp_path / "o.csv", walls, gap=4e-4, pitch=0.03)
    found = sp.calibrate(path, WIDE, model="tube", method="least-squares", free="gap,pitch")
    assert found.values["gap"].value == pytest.approx(4e-4, rel=0.01)
    assert found.values["pitch"].value == pytest.approx(0.03, rel=0.05)


def test_a_posterior_of_places_is_not_taken_for_predictions(walls: MadeUp, tmp_path: Path) -> None:
    from spirillum.calibration.posterior import Sampling

    path = observed(tmp_path / "o.csv", walls, gap=4e-4, error=0.02)
    few = Sampling(ensembles=2, walkers=24, warm_up=200, steps=400, doublings=2)
    found = sp.calibrate(path, WIDE, model="tube", free="gap", sampling=few)
    assert found.values["gap"].low < 4e-4 < found.values["gap"].high
    write_calibration(found, tmp_path / "out", figures=False)
    with pytest.raises(InputError, match=r"allowed: its calibration\.toml"):
        sp.predict(WIDE, model="tube", posterior=tmp_path / "out" / "posterior.nc", tail_rate="1 Hz")


def test_factors_are_not_for_a_model_with_walls(walls: MadeUp, tmp_path: Path, made: Callable[..., Path]) -> None:
    path = observed(tmp_path / "o.csv", walls, gap=4e-4)
    with pytest.raises(InputError, match="free = 'body_drag' with model 'tube'"):
        sp.calibrate(path, WIDE, model="tube", free="body_drag")
    with pytest.raises(InputError, match="method = 'paper'"):
        sp.calibrate(path, WIDE, model="tube", free="gap", method="paper")
