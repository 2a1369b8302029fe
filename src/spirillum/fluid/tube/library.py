"""Tables of robots in tubes: where they are found and kept, and the model `tube` from them, in microseconds.

A table in the cache is filed under its robot, its tube and the source of all that makes it, so that a new version of
the solver asks for a new one. The folder is that of `cache`; it is safe to delete.

What a motion along and about the axis needs is averaged over the phases of the tail. A table knows the robot with its
turning tail, not the forces that its two parts exert on each other across their joint: the force on the whole stands
with the body here, and nothing that follows from a force balance of the whole is changed by that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from spirillum.arrays import Samples
from spirillum.errors import InputError
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.tube.building import built_tables
from spirillum.fluid.tube.cache import cache_folder, digest_of
from spirillum.fluid.tube.domain import in_tube, pose_limits, pose_of, seated
from spirillum.fluid.tube.stages import STAGES, StageName
from spirillum.fluid.tube.table import BELOW, TubeTable, key_of, least_checked_gap
from spirillum.fluid.tube.tube import Tube
from spirillum.fluid.wire.robot_geometry import RobotGeometry, number_of
from spirillum.fluid.wire.slender import Slender
from spirillum.kernels.core import INSIDE, MOTIONS, largest_yaw, mean_resistance_at, mean_resistances
from spirillum.kernels.tube_table import PHASES
from spirillum.progress import Progress
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import Limit, within
from spirillum.robot.tube_pose import TubePose

_SHIPPED = Path(__file__).parent / "tables"
_OF_PAPERS = tuple(sorted(Path(__file__).parents[2].glob("papers/*/tables")))


@lru_cache(maxsize=256)
def _read(path: Path, _changed: int) -> TubeTable | None:
    """The table in a file as it was when it was changed last; None where it is damaged or of another version."""
    try:
        return TubeTable.read(path)
    except InputError:
        return None


def _read_table(path: Path | None, key: str) -> TubeTable | None:
    try:
        table = None if path is None else _read(path, path.stat().st_mtime_ns)
    except OSError:
        return None
    return table if table is not None and table.key == key else None


def _cache_path(key: str, stage: StageName) -> Path | None:
    """File of a stage of a table in the user's cache."""
    folder, code = cache_folder(), digest_of(built_tables.__module__)
    if folder is None or code is None:
        return None
    return folder / f"{key}-{stage}-{code[:16]}.table"


def find_table(geometry: RobotGeometry, radius: float, least: StageName = "straight") -> TubeTable | None:
    """Return the finest table of a robot in a tube, of itself or of its mirror image; None without one."""
    key, image_key = key_of(geometry, radius), key_of(geometry._replace(hand=-geometry.hand), radius)
    stages = tuple(STAGES)
    for stage in reversed(stages[stages.index(least) :]):
        if (own := _of_key(key, stage)) is not None:
            return own
        if (image := _of_key(image_key, stage)) is not None:
            return _mirrored(image_key, image)
    return None


def prepared_tables(
    robots: Sequence[tuple[RobotGeometry, float]],
    *,
    stage: StageName = "fine",
    workers: int = 2,
    progress: Progress | None = None,
) -> list[TubeTable]:
    """Return the tables of robots in their tubes, of a stage at least; missing ones are made and kept in the cache."""
    missing = [robot for robot in dict.fromkeys(robots) if find_table(*robot, stage) is None]
    made = built_tables(missing, stage=STAGES[stage], workers=workers, progress=progress) if missing else []
    fresh = {(table.geometry, table.radius): _save(table) for table in made}
    tables = [fresh.get(robot) or find_table(*robot, stage) for robot in robots]
    return [table for table in tables if table is not None]


def has_table_cache() -> bool:
    """Whether tables that are made are there again the next time."""
    return _cache_path("", "fine") is not None


def _of_key(key: str, stage: StageName) -> TubeTable | None:
    shipped = (_read_table(folder / f"{key}.table", key) for folder in (_SHIPPED, *_OF_PAPERS))
    of_stage = (table for table in shipped if table is not None and table.stage == stage)
    return next(of_stage, None) or _read_table(_cache_path(key, stage), key)


_mirrors: dict[str, tuple[TubeTable, TubeTable]] = {}


def _mirrored(key: str, table: TubeTable) -> TubeTable:
    """The mirror image of a table, made once for each."""
    known = _mirrors.get(key)
    if known is None or known[0] is not table:
        known = _mirrors[key] = (table, table.mirrored())
    return known[1]


def _save(table: TubeTable) -> TubeTable:
    """Keep a table; as the next call will find it."""
    path = _cache_path(table.key, table.stage)
    if path is not None:
        try:
            table.write(path)
        except (InputError, OSError):  # a full or read-only disk costs time only
            pass
        else:
            return TubeTable.read(path)
    return table


THINNEST_GAP = 1e-5  #: Smallest gap over the body's diameter of the tabulated lubrication films.
_HELD = [0, 1, 3, 4]  # Indices of U, Omega, omega and the mean flow in the axial form of both parts and the flow.


def along_the_tube(pitch: Samples, yaw: Samples) -> Samples:
    """Rates of a table per U along the tube, body and rotor rates and mean flow, (..., 8, 4)."""
    found = np.zeros((*np.shape(pitch), MOTIONS, len(_HELD)))
    found[..., 0, 0] = np.cos(pitch) * np.cos(yaw)
    found[..., 1, 0] = -np.sin(yaw)
    found[..., 2, 0] = -np.sin(pitch) * np.cos(yaw)
    found[..., 3, 1], found[..., 6, 1] = 1.0, -1.0  # the body turns, the rotor does not
    found[..., 6, 2] = found[..., 7, 3] = 1.0
    return found


def mean_resistances_along(tables: Samples, gap: Samples, pitch: Samples, yaw: Samples) -> Samples:
    """Resistance along the tube at poses, averaged over the tail's phase, viscosity 1, (..., robots, 4, 4)."""
    # Against U, Omega, omega and the mean flow, closed ends; NaN where a place is outside the robot's table.
    found = np.empty((gap.size, MOTIONS, MOTIONS))
    which = np.broadcast_to(np.arange(len(tables)), gap.shape)
    mean_resistances(tables, which.ravel(), gap.ravel(), pitch.ravel(), yaw.ravel(), PHASES, found)
    axes = along_the_tube(pitch, yaw)
    return np.swapaxes(axes, -1, -2) @ found.reshape(*gap.shape, MOTIONS, MOTIONS) @ axes


class TabledTube(Tube):
    """The model `tube` for robots that have tables."""

    form = "table"

    def __init__(self, tables: Mapping[str, TubeTable]) -> None:
        """Evaluate from tables."""
        super().__init__()
        self._tables = tables
        self._asked: tuple[RobotBatch, list[Limit]] | None = None
        coarsest = min(tables.values(), key=lambda table: list(STAGES).index(table.stage), default=None)
        self.error_against = None if coarsest is None else coarsest.error_against

    def table_of(self, batch: RobotBatch, index: int = 0) -> TubeTable:
        """The table of one robot."""
        return self._table(batch, index, *in_tube(batch, index))

    def _table(self, batch: RobotBatch, index: int, geometry: RobotGeometry, radius: float) -> TubeTable:
        found = self._tables.get(key_of(geometry, radius))
        if found is None:
            tail = f"{1e3 * number_of(batch.wavelength, index):g} x {1e3 * number_of(batch.amplitude, index):g} mm"
            raise InputError(
                f"robot {index} (tail {tail}) is not the one whose table answers; allowed: robots of its size in its "
                "tube, or model 'tube' by name, which solves for each"
            )
        return found

    def checked_by(self, batch: RobotBatch) -> tuple[SwimmerModel, ...]:
        """None: the error of a table is stored, see `stated_speed_error`."""
        return ()

    def stated_speed_error(self, batch: RobotBatch) -> float:
        """See `SwimmerModel.stated_speed_error`; none beyond the yaws at which the table was checked."""
        pose, table = pose_of(batch, 0), self.table_of(batch)
        known = abs(pose.yaw) <= largest_yaw(table.packed, pose.offset, pose.pitch)
        return table.speed_error_at(pose.yaw) if known else float("nan")

    def cautions(self, batch: RobotBatch) -> list[Limit]:
        """Limits of the poses for which the table's errors were estimated."""
        found = np.full((4, batch.size), np.nan)
        known: dict[tuple[RobotGeometry, TubePose], tuple[float, ...]] = {}
        for index in within(batch, self.domain(batch)):
            seat = geometry, pose = seated(batch, index)
            if seat not in known:
                packed = self._table(batch, index, geometry, pose.radius).packed
                gaps = pose.clearance(geometry.body), least_checked_gap(packed)
                known[seat] = (*gaps, abs(pose.yaw), largest_yaw(packed, pose.offset, pose.pitch))
            found[:, index] = known[seat]
        gap, least, yaw, most = found
        return [
            *super().cautions(batch),
            Limit.named("checked-gap", gap, least, below=BELOW),
            Limit.named("checked-yaw", yaw, most),
        ]

    def domain(self, batch: RobotBatch) -> list[Limit]:
        """Asked for before the resistance, which takes it again: that of the last batch is kept."""
        asked = self._asked
        if asked is None or asked[0] is not batch:
            self._asked = asked = batch, super().domain(batch)
        return asked[1]

    def part_domain(self, batch: RobotBatch, part: str) -> list[Limit]:
        """See `ResistanceModel.part_domain`."""
        unbounded = Slender().part_domain(batch, part)
        return pose_limits(batch, part, unbounded, thinnest_gap=THINNEST_GAP, wire_film=0.0)

    def _axial(self, batch: RobotBatch) -> tuple[Samples, Samples]:
        """See `Tube`; from the tables' means over a turn."""
        found = np.full((batch.size, 5, 5), np.nan)
        for index in within(batch, self.domain(batch)):
            (geometry, pose), mean = seated(batch, index), np.empty((MOTIONS, MOTIONS))
            table = self._table(batch, index, geometry, pose.radius)
            mean_resistance_at(table.packed, pose.offset, pose.pitch, pose.yaw, PHASES, mean)
            axes = along_the_tube(np.array(pose.pitch), np.array(pose.yaw))
            found[index] = 0.0
            found[index][np.ix_(_HELD, _HELD)] = number_of(batch.viscosity, index) * axes.T @ mean @ axes
        return self._with_ends(batch, found)


def tables_of(batch: RobotBatch) -> list[TubeTable | None]:
    """The table of each robot of a batch; None where it has none, or no tube."""
    placed = (in_tube(batch, index) for index in range(batch.size))
    return [find_table(geometry, radius) if np.isfinite(radius) else None for geometry, radius in placed]


def tabled(batch: RobotBatch) -> TabledTube | None:
    """The model `tube` from the tables of a batch; None unless every robot has a valid one at its pose."""
    if batch.placement.tail_drop:
        return None
    found: dict[str, TubeTable] = {}
    for index, table in enumerate(tables_of(batch)):
        if table is None:
            return None
        geometry, pose = seated(batch, index)
        if np.isfinite(pose.offset) and table.at(pose.offset, pose.pitch, pose.yaw)[1] != INSIDE:
            return None
        found[key_of(geometry, pose.radius)] = table
    return TabledTube(found)
