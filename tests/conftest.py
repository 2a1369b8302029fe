"""Array shapes in annotations are checked while tests run; robots that many tests share."""

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import Phase, settings
from jaxtyping import install_import_hook

# Before anything imports these modules: the hook decorates their functions as they are read.
install_import_hook(["spirillum.hydrodynamics", "spirillum.motion", "spirillum.robot.geometry"], "beartype.beartype")

# Without the phase that explains a failure: it can take a minute.
phases = (Phase.explicit, Phase.generate, Phase.shrink)
settings.register_profile("spirillum", deadline=None, derandomize=True, database=None, phases=phases)
settings.load_profile("spirillum")


@pytest.fixture(scope="session")
def batch_of() -> Callable[..., Any]:
    """One robot as a batch: a preset and overrides, dotted fields with dots or with double underscores."""
    from spirillum.robot import RobotBatch, load

    def make(*, preset: str = "biorob2012-wide", **overrides: Any) -> RobotBatch:
        return RobotBatch.of(load(preset, **{name.replace("__", "."): value for name, value in overrides.items()}))

    return make


@pytest.fixture(scope="session")
def wide(batch_of: Callable[..., Any]) -> Any:
    """The paper's robot in the wide channel, with the tail that Fig. 5 names (25 mm, 2.5 mm)."""
    return batch_of()
