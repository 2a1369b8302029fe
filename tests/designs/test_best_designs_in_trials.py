"""Designs are searched by held poses; the best of them are confirmed by trials."""

import numpy as np
import pytest

import spirillum as sp
from spirillum.cli.tables import blocks_of
from spirillum.errors import InputError


@pytest.fixture(scope="module")
def thick() -> sp.Design:
    """Of a fluid: all designs have the table of the preset."""
    return sp.design("biorob2012-wide", {"fluid.viscosity": "2 Pa s:4 Pa s"}, maximise="forward_velocity")


def test_the_best_three_are_confirmed(thick: sp.Design) -> None:
    """The first is the best, they lie a tenth of the range apart, and each trial is that of `predict`."""
    found = thick.to_dict()["confirmed"]
    values = [one["design"]["fluid.viscosity"]["value"] for one in found]
    assert len(found) == 3
    assert values[0] == pytest.approx(thick.values["fluid.viscosity"])
    assert np.min(np.abs(np.diff(values))) > 0.0
    robot = sp.load("biorob2012-wide", **{"fluid.viscosity": f"{values[0]!r} Pa s"})
    alone = sp.predict(robot)
    assert alone.trial is not None
    assert found[0]["held"]["forward_velocity"]["value"] == pytest.approx(alone.forward_velocity, rel=1e-9)
    assert found[0]["trial"]["forward_velocity"]["value"] == pytest.approx(
        alone.trial.values["forward_velocity"], rel=1e-9
    )


def test_they_stand_in_a_table(thick: sp.Design) -> None:
    tables = [block for block in blocks_of(thick.to_dict()) if not isinstance(block, str) and hasattr(block, "columns")]
    headers = [[str(column.header) for column in table.columns] for table in tables]
    assert ["fluid.viscosity, Pa s", "held, mm/s", "trial, mm/s"] in headers


def test_designs_that_nearly_agree_and_lack_a_trial_are_told_apart(thick: sp.Design) -> None:
    answer = thick.to_dict()
    one, two, three = answer["confirmed"]
    two["design"]["fluid.viscosity"]["value"] = (1.0 + 1e-5) * one["design"]["fluid.viscosity"]["value"]
    three |= {"held": {}, "trial": {"reason": "its tube has no table"}}
    blocks = [*blocks_of(answer)]
    (table,) = (block for block in blocks if getattr(block, "row_count", 0) == 3 and len(block.columns) == 3)
    assert len({*table.columns[0].cells}) == 3
    assert "-: no trial of designs: its tube has no table" in [block for block in blocks if type(block) is str]


def test_a_tail_without_a_table_carries_its_reason() -> None:
    """And none where the tail's rate is prescribed or another model searches."""
    vary = {"tail.amplitude": "2.05 mm:2.15 mm"}
    found = sp.design("biorob2012-wide", vary, maximise="forward_velocity", model="sbt", tail_rate="1 Hz")
    assert "confirmed" not in found.to_dict()
    with pytest.raises(InputError, match="confirm = True, but trials follow from the drive"):
        sp.design(
            "biorob2012-wide",
            vary,
            maximise="forward_velocity",
            model="sbt",
            tail_rate="1 Hz",
            judged={"confirm": True},
        )
