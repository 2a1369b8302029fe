"""Stages of a table: which nodes it has, and how finely the flow is resolved there.

`straight` answers a robot without yaw, `yaw` adds yawed nodes, `fine` has all nodes at the finest resolution. Each
stage can be used on its own; its nodes are read from the cache where another stage has solved for them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from spirillum.errors import InputError, did_you_mean
from spirillum.fluid.tube.solids import Fineness

StageName = Literal["straight", "yaw", "fine"]

_NEAR = 0.12
"""Gap over the body's radius below which a node is near the glass."""


@dataclass(frozen=True)
class Stage:
    """Nodes and resolution of a table; see `spirillum.fluid.tube.nodes` for the coordinates t and f."""

    name: StageName
    up: tuple[float, ...]
    """Nodes f nose up."""
    down: tuple[float, ...]
    """Nodes f nose down."""
    upper: tuple[float, ...]
    """Nodes t far from the floor."""
    phases: int
    """Phases of the tail at nodes near the largest pitch or yaw, where all harmonics matter."""
    few_phases: int
    """Phases of the tail at the other nodes without yaw."""
    little_yawed: int
    """Phases of the tail at the least yaw."""
    resolutions: dict[tuple[bool, bool], Fineness]
    """Resolution of the flow for (near the glass, level) nodes."""
    seconds: tuple[float, float]
    """Time that a node takes one process of a fast and of a slow machine, s."""
    held_out: int
    """Poses without yaw, and with it, from which the table's errors are stated."""
    accuracy: float = 2.0
    """Largest relative error that it should have, over that of the finest stage."""
    yawed: bool = True
    """Whether it has yawed nodes."""
    film_yaws: int = 5
    """Polynomials in yaw of the film."""

    def fineness(self, gap: float, *, level: bool) -> Fineness:
        """Return the resolution of a node.

        Args:
            gap: of the level robot at this t, over the body's radius.
            level: whether the robot has neither pitch nor yaw.
        """
        return self.resolutions[gap < _NEAR, level]


_COARSE = {
    (True, True): Fineness("standard", 0.01, 6),
    (True, False): Fineness("standard", 0.03, 4),
    (False, True): Fineness("standard", 0.03, 6),
    (False, False): Fineness("standard", 0.1, 4),
}
"""Against the finest resolution: at most 0.3 % of the forward velocity, 0.8 % of the normal resistance."""

YAW = Stage(
    "yaw",
    up=(0.0, 0.55, 0.92, 1.0),
    down=(0.0, 0.55, 1.0),
    upper=(0.55, 1.0),
    phases=7,
    few_phases=5,
    little_yawed=5,
    resolutions=_COARSE,
    seconds=(6.0, 14.0),
    held_out=3,
)
STRAIGHT = replace(YAW, name="straight", seconds=(3.0, 9.0), held_out=4, yawed=False, film_yaws=1)
FINE = Stage(
    "fine",
    up=(0.0, 0.28, 0.55, 0.78, 0.92, 1.0),
    down=(0.0, 0.28, 0.55, 0.8, 1.0),
    upper=(0.55, 0.78, 1.0),
    phases=9,
    few_phases=5,
    little_yawed=7,
    resolutions={
        (near, level): Fineness("standard", 0.002 if level else 0.01)
        for near in (True, False)
        for level in (True, False)
    },
    seconds=(10.0, 17.0),
    held_out=6,
    accuracy=1.0,
)
STAGES: dict[StageName, Stage] = {stage.name: stage for stage in (STRAIGHT, YAW, FINE)}
"""From the coarsest to the finest: each answers what those before it answer."""


def stage_of(name: str) -> StageName:
    """Return the name of a stage that a user gives.

    Raises:
        InputError: for a name of none.
    """
    for known in STAGES:
        if name == known:
            return known
    raise InputError(f"stage = {name[:40]!r}{did_you_mean(name[:40], STAGES)}; allowed: {', '.join(STAGES)}")
