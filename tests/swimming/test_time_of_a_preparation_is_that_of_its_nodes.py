"""The stated time of a preparation rests on the nodes that it solves for."""

from collections.abc import Callable
from typing import Any

import pytest

from spirillum.fluid.tube.building import _nodes
from spirillum.fluid.tube.nodes import Places
from spirillum.fluid.tube.stages import STAGES, StageName
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.swimming.preparation import preparation_minutes


@pytest.mark.parametrize("stage", STAGES)
@pytest.mark.parametrize("overrides", [{}, {"body__diameter": "16 mm", "body__length": "30 mm"}])
def test_time_is_that_of_all_nodes_on_two_processes(
    batch_of: Callable[..., Any], overrides: dict[str, str], stage: StageName
) -> None:
    batch = batch_of(**overrides)
    nodes = len(_nodes(Places(RobotGeometry.of(batch), 0.02, STAGES[stage])))
    found = preparation_minutes(batch, stage)
    assert found == tuple(max(round(0.5 * nodes * each / 60.0), 1) for each in STAGES[stage].seconds)
