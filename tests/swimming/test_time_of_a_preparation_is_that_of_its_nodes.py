"""The stated time of a preparation rests on the nodes that it solves for."""

from collections.abc import Callable
from typing import Any

import pytest

from spirillum.fluid.tube.building import _Request
from spirillum.fluid.tube.nodes import Places
from spirillum.fluid.tube.progress_messages import time_span
from spirillum.fluid.tube.stages import STAGES, StageName
from spirillum.fluid.wire.robot_geometry import RobotGeometry


@pytest.mark.parametrize("stage", STAGES)
@pytest.mark.parametrize("overrides", [{}, {"body__diameter": "16 mm", "body__length": "30 mm"}])
def test_time_is_that_of_all_poses_on_two_processes(
    batch_of: Callable[..., Any], overrides: dict[str, str], stage: StageName
) -> None:
    places = Places(RobotGeometry.of(batch_of(**overrides)), 0.02, STAGES[stage])
    assert places.solutions == len(_Request.of(places).poses)
    span = time_span(*(0.5 * places.solutions * each for each in STAGES[stage].seconds))
    assert places.time_to_solve() == f"{span} on 2 free cores"


def test_spans_of_time_in_words() -> None:
    assert time_span(24.0, 61.0) == "20 to 60 s"
    assert time_span(31.0, 29.0) == "about 30 s"
    assert time_span(70.0, 150.0) == "70 s to 2 min"
    assert time_span(130.0, 590.0) == "2 to 10 min"
