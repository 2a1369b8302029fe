"""Speeds in the tube against solutions with the finest wires, which were solved for beforehand.

The speeds with accuracy `high` took minutes each; they are what `predict` gave, at 1.2 Hz, in mm/s.
"""

import dataclasses
import re
from pathlib import Path

import pytest

import spirillum as sp
from spirillum.fluid.tube.library import find_table
from spirillum.fluid.tube.stages import LARGEST_WIRE_ERROR, SOLIDS_ERROR
from spirillum.fluid.tube.tube import Tube, finest_wire
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.fluid.wire.slender import FINEST_WIRE_ERROR
from spirillum.robot.batch import RobotBatch

WIDE, NARROW = "biorob2012-wide", "biorob2012-narrow"
SOLVED = [("0.3 mm", "0 deg", 0.37045)]


@pytest.mark.parametrize(("gap", "pitch", "high"), SOLVED)
def test_a_table_is_as_fast_as_high_wires(gap: str, pitch: str, high: float) -> None:
    answer = sp.predict(WIDE, model="tube", tail_rate="1.2 Hz", placement={"gap": gap, "pitch": pitch})
    assert answer.model.form == "table"
    off = abs(1e3 * answer.forward_velocity / high - 1.0)
    assert off < 0.003
    assert off < answer.error_estimate < 0.01
    assert "finer wires" in answer.to_dict()["error_estimate"]["against"]


@pytest.mark.parametrize("tube", [WIDE, NARROW])
@pytest.mark.parametrize("yaw", [0.0, 0.1])
def test_the_sum_holds_each_part(tube: str, yaw: float) -> None:
    batch = RobotBatch.of(sp.load(tube))
    table = find_table(RobotGeometry.of(batch), 0.5 * float(batch.channel_diameter[0]))
    assert table is not None
    assert table.wire is not None
    assert 0.001 <= table.wire < 0.003
    rest = table.error_at(yaw)["forward_velocity"] + FINEST_WIRE_ERROR + SOLIDS_ERROR
    assert table.speed_error_at(yaw) == pytest.approx(rest + table.wire)
    unknown = dataclasses.replace(table, wire=None)
    assert unknown.speed_error_at(yaw) == pytest.approx(rest + LARGEST_WIRE_ERROR)


def test_wires_too_long_for_the_finest_form_state_the_largest_error() -> None:
    batch, thin = (RobotBatch.of(sp.load(WIDE, **{"tail.wire_diameter": size})) for size in ("1 mm", "0.3 mm"))
    assert [finest_wire(RobotGeometry.of(one)) for one in (batch, thin)] == ["high", "standard"]
    assert Tube().unchecked_error(batch) == FINEST_WIRE_ERROR
    assert Tube().unchecked_error(thin) == FINEST_WIRE_ERROR + LARGEST_WIRE_ERROR


def test_a_direct_answer_takes_high_wires() -> None:
    """A short and thick tail, from the same waves and phases."""
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
    assert standard.forward_velocity == high.forward_velocity
    assert FINEST_WIRE_ERROR <= standard.error_estimate == high.error_estimate


def test_the_stated_error_holds_what_the_page_shows() -> None:
    page = (Path(__file__).parents[2] / "docs" / "accuracy.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (?:wide|narrow), \d+ mm \| (.*) \|$", page, re.M)
    shown = [abs(float(cell.replace("−", "-"))) for cells in rows for cell in cells.split(" | ")]
    assert len(shown) == 32
    assert 0.01 * max(shown) < LARGEST_WIRE_ERROR < 0.0115 * max(shown)
