"""Where tables of robots in tubes are found and kept: in this package those of presets and papers, others in the cache.

A table in the cache is filed under its robot, its tube and the source of all that makes it, so that a new version of
the solver asks for a new one. The folder is that of `cache`; it is safe to delete.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

from spirillum.errors import InputError
from spirillum.fluid.tube.building import built_tables
from spirillum.fluid.tube.cache import cache_folder, digest_of
from spirillum.fluid.tube.outer_resistance import Progress
from spirillum.fluid.tube.stages import STAGES, StageName
from spirillum.fluid.tube.table import TubeTable, key_of
from spirillum.fluid.wire.robot_geometry import RobotGeometry

_SHIPPED = Path(__file__).parent / "tables"
_OF_PAPERS = tuple(sorted(Path(__file__).parents[2].glob("papers/*/tables")))


@lru_cache(maxsize=256)
def _read(path: Path, _changed: int) -> TubeTable | None:
    """The table in a file as it was when it was changed last; None where it is damaged or of another version."""
    try:
        return TubeTable.read(path)
    except InputError:
        return None


def _found(path: Path | None, key: str) -> TubeTable | None:
    try:
        table = None if path is None else _read(path, path.stat().st_mtime_ns)
    except OSError:
        return None
    return table if table is not None and table.key == key else None


def _kept(key: str, stage: StageName) -> Path | None:
    """File of a stage of a table in the user's cache."""
    folder, code = cache_folder(), digest_of(built_tables.__module__)
    if folder is None or code is None:
        return None
    return folder / f"{key}-{stage}-{code[:16]}.table"


def find_table(geometry: RobotGeometry, radius: float, least: StageName = "straight") -> TubeTable | None:
    """Return the finest table of a robot in a tube, of itself or of its mirror image; None without one.

    Args:
        geometry: of the robot.
        radius: of the tube, m.
        least: coarsest stage that will do.
    """
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
    fresh = {(table.geometry, table.radius): _put(table) for table in made}
    tables = [fresh.get(robot) or find_table(*robot, stage) for robot in robots]
    return [table for table in tables if table is not None]


def tables_are_kept() -> bool:
    """Whether tables that are made are there again the next time."""
    return _kept("", "fine") is not None


def _of_key(key: str, stage: StageName) -> TubeTable | None:
    shipped = (_found(folder / f"{key}.table", key) for folder in (_SHIPPED, *_OF_PAPERS))
    of_stage = (table for table in shipped if table is not None and table.stage == stage)
    return next(of_stage, None) or _found(_kept(key, stage), key)


_mirrors: dict[str, tuple[TubeTable, TubeTable]] = {}


def _mirrored(key: str, table: TubeTable) -> TubeTable:
    """The mirror image of a table, made once for each."""
    known = _mirrors.get(key)
    if known is None or known[0] is not table:
        known = _mirrors[key] = (table, table.mirrored())
    return known[1]


def _put(table: TubeTable) -> TubeTable:
    """Keep a table; as the next call will find it."""
    path = _kept(table.key, table.stage)
    if path is not None:
        try:
            table.write(path)
        except (InputError, OSError):  # a full or read-only disk costs time only
            pass
        else:
            return TubeTable.read(path)
    return table
