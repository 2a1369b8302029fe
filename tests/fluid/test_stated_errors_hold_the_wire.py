"""Stated errors of speeds in the tube against solutions with finer wires, which were solved for beforehand.

The speeds with accuracy `high` took minutes each; they are what `predict` gave, at 1.2 Hz, in mm/s.
"""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

import spirillum as sp
from spirillum.fluid.tube import table_errors as module
from spirillum.fluid.tube.building import _wire_error
from spirillum.fluid.tube.library import find_table
from spirillum.fluid.tube.nodes import Places
from spirillum.fluid.tube.table_errors import LARGEST_WIRE_ERROR, wire_error
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.fluid.wire.slender import FINEST_WIRE_ERROR
from spirillum.robot.batch import RobotBatch

WIDE, NARROW = "biorob2012-wide", "biorob2012-narrow"
SOLVED = [("0.4 mm", "1.5 deg", 0.4791), ("0.3 mm", "0 deg", 0.3711), ("0.5 mm", "3 deg", 0.5574)]


@pytest.mark.parametrize(("gap", "pitch", "high"), SOLVED)
def test_a_table_states_what_its_wires_cost(gap: str, pitch: str, high: float) -> None:
    answer = sp.predict(WIDE, model="tube", tail_rate="1.2 Hz", placement={"gap": gap, "pitch": pitch})
    assert answer.model.form == "table"
    off = abs(1e3 * answer.forward_velocity / high - 1.0)
    assert 0.01 < off < answer.error_estimate < 2.0 * off
    assert "finer wires" in answer.to_dict()["error_estimate"]["against"]


@pytest.mark.parametrize("tube", [WIDE, NARROW])
@pytest.mark.parametrize("yaw", [0.0, 0.1])
def test_the_sum_holds_each_part(tube: str, yaw: float) -> None:
    batch = RobotBatch.of(sp.load(tube))
    table = find_table(RobotGeometry.of(batch), 0.5 * float(batch.channel_diameter[0]))
    assert table is not None
    parts = table.error_at(yaw)["forward_velocity"], wire_error(table.geometry, table.radius), FINEST_WIRE_ERROR
    assert sum(parts) < table.speed_error_at(yaw) < sum(parts) + 1e-3
    compared = dataclasses.replace(table, wire=0.05)
    assert compared.speed_error_at(yaw) > 0.05


def test_wires_that_nobody_compared_have_the_largest_error() -> None:
    g = RobotGeometry.of(RobotBatch.of(sp.load(WIDE)))
    assert wire_error(g, 0.02) < LARGEST_WIRE_ERROR
    for other in (g._replace(wire_diameter=1.1e-3), g._replace(tail_length=0.05), g._replace(amplitude=2.6e-3)):
        assert wire_error(other, 0.02) == LARGEST_WIRE_ERROR
    assert wire_error(g, 0.021) == LARGEST_WIRE_ERROR


@pytest.mark.slow
def test_a_table_that_is_made_compares_both_wires() -> None:
    """As the numbers of those that come with the package were found."""
    g = RobotGeometry.of(RobotBatch.of(sp.load(WIDE)))
    found = _wire_error(Places(g, 0.02))
    assert found == pytest.approx(0.01 * module._MEASURED[40.0][25.0, 2.5], abs=1e-3)
    assert _wire_error(Places(g._replace(wire_diameter=0.1e-3), 0.02)) is None


def test_a_direct_answer_states_what_its_wires_cost() -> None:
    """A short and thick tail: both forms of the wire from the same waves and phases."""
    robot = sp.load(
        WIDE,
        **{
            "body.shape": "sphere",
            "body.length": "18 mm",
            "body.front": "none",
            "body.rear": "none",
            "coupling.diameter": "0 mm",
            "tail.length": "20 mm",
            "tail.wavelength": "20 mm",
            "tail.wire_diameter": "1.5 mm",
        },
    )

    def answer(accuracy: str) -> sp.Prediction:
        resolution = {"tolerance": 0.04, "phases": 3, "accuracy": accuracy}
        return sp.predict(robot, model="tube", tail_rate="1.2 Hz", placement={"gap": "4 mm"}, resolution=resolution)

    standard, high = answer("standard"), answer("high")
    off = abs(standard.forward_velocity / high.forward_velocity - 1.0)
    assert off < standard.error_estimate
    assert np.isfinite(high.error_estimate)
    assert high.error_estimate >= FINEST_WIRE_ERROR


def test_the_page_shows_what_is_stated() -> None:
    page = (Path(__file__).parents[2] / "docs" / "accuracy.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (wide|narrow), (\d+) mm \| (.*) \|$", page, re.M)
    for tube, diameter in (("wide", 40.0), ("narrow", 30.0)):
        shown = {
            (float(wavelength), amplitude): float(cell.replace("−", "-"))
            for name, wavelength, cells in rows
            for amplitude, cell in zip((1.5, 2.0, 2.5, 3.5), cells.split(" | "), strict=True)
            if name == tube and cell != "–"
        }
        assert shown == module._MEASURED[diameter]
