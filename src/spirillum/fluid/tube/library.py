"""Where tables of robots in tubes are found and kept: those of the presets in this package, others in the user's cache.

A table in the cache is filed under its robot, its tube and the source of all that makes it, so that a new version of
the solver asks for a new one. The folder is that of `cache`; it is safe to delete.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from spirillum.errors import InputError
from spirillum.fluid.tube.cache import cache_folder, digest_of
from spirillum.fluid.tube.rest import Progress
from spirillum.fluid.tube.table import TubeTable, key_of
from spirillum.fluid.wire.robot_geometry import RobotGeometry

__all__ = ["find_table", "prepared_table"]

_SHIPPED = Path(__file__).parent / "tables"


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


def _kept(key: str) -> Path | None:
    """File of a table in the user's cache."""
    folder, code = cache_folder(), digest_of("spirillum.fluid.tube.table")
    if folder is None or code is None:
        return None
    return folder / f"{key}-{code[:16]}.table"


def find_table(geometry: RobotGeometry, radius: float) -> TubeTable | None:
    """The table of a robot in a tube, if there is one.

    Args:
        geometry: of the robot.
        radius: R of the tube, m.
    """
    key = key_of(geometry, radius)
    return _found(_SHIPPED / f"{key}.table", key) or _found(_kept(key), key)


def prepared_table(
    geometry: RobotGeometry, radius: float, *, workers: int = 2, progress: Progress | None = None
) -> TubeTable:
    """The table of a robot in a tube, made and kept in the user's cache if there is none.

    Args:
        geometry: of the robot.
        radius: R of the tube, m.
        workers: number of processes.
        progress: told what is being solved, how much is done, and of how much.

    Raises:
        InputError: for a robot without a table.
    """
    found = find_table(geometry, radius)
    if found is not None:
        return found
    made = TubeTable.of(geometry, radius, workers=workers, progress=progress)
    path = _kept(made.key)
    if path is not None:
        try:
            made.write(path)
        except (InputError, OSError):  # a full or read-only disk costs time only
            pass
        else:
            return TubeTable.read(path)  # the numbers that the next call will find
    return made
