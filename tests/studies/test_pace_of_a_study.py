"""The time that a large study is said to take, against studies whose pace is known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import spirillum as sp
from spirillum.results.study_store import _spread
from spirillum.studies.regions import Pace, RobotBlock
from spirillum.worker_pool import ESTIMATE


def _said(workers: int, regions: int, seconds: float, loading: float, change: float = 0.0) -> tuple[float, float]:
    """What a study takes, and what is said of it, where each process first loads what it needs.

    Args:
        workers: number of processes.
        regions: number of regions.
        seconds: time of a region, s.
        loading: time before the first one, s.
        change: relative change of a region's time from the first to the last.
    """
    now = [0.0]
    places = [RobotBlock(number, (10 * number,), (10 * number + 10,)) for number in range(regions)]
    pace = Pace(10 * regions, workers, lambda: now[0])
    free = np.full(workers, loading)
    ends = []
    for region in _spread(places):
        which = int(np.argmin(free))
        free[which] += seconds * (1.0 + change * region.number / regions)
        ends.append(float(free[which]))
    said = []
    for end in sorted(ends):
        now[0] = end
        found = pace.seconds(10)
        said += [] if found is None else [found]
    return max(ends), said[0]


@pytest.mark.parametrize("change", [0.0, 2.0, -0.8])
@pytest.mark.parametrize("seconds", [0.5, 3.0, 60.0, 900.0])
@pytest.mark.parametrize("workers", [1, 2, 4, 8])
def test_estimate_holds_within_30_percent(workers: int, seconds: float, change: float) -> None:
    true, said = _said(workers, 40 * workers, seconds, 4.0, change)
    assert said == pytest.approx(true, rel=0.3)


def test_regions_are_spread_and_none_is_lost() -> None:
    for count in (1, 2, 3, 7, 10, 64, 999):
        places = [RobotBlock(number, (number,), (number + 1,)) for number in range(count)]
        order = [region.number for region in _spread(places)]
        assert sorted(order) == list(range(count))
    assert 400.0 < np.mean(order[:20]) < 600.0


def test_work_without_tables_is_told_before_it_begins(tmp_path: Path) -> None:
    """The flow around robots without a table is solved for in blocks, and nothing ends for minutes."""

    class Told(Exception):  # noqa: N818 - ends the study before its work
        pass

    def tell(what: str, _done: int, _total: int) -> None:
        said.append(what)
        if what.startswith("tube"):
            raise Told

    said: list[str] = []
    path = tmp_path / "study.toml"
    path.write_text(
        'robots = ["biorob2012-wide"]\nmodels = ["tube"]\n[vary]\n"tail.wavelength" = ["21.3 mm", "25 mm"]\n'
    )
    with pytest.raises(Told):
        sp.study(path, progress=tell)
    assert "without a table of its tube (1 of them)" in said[-2]
    assert said[-2].startswith(ESTIMATE)
