"""Answers for an unknown pose in the channel: a band over the possible poses.

Two things decide much of how a robot swims in its channel and are seldom reported: the gap under its body, and how near
its tail comes to the floor. Where a placement leaves one of them open, the motion is computed at a few poses, each a
steady state of its own, and the least and the largest value of every quantity are its band. A band is no interval of
confidence: no pose is likelier than another.

The gaps are the ends of `GAP_BAND` and their geometric mean, capped by what the channel leaves. The pitches are level,
the steepest that gap and tail allow, and half of it. At the steepest one the wire's surface, at its lowest point of a
turn, or the coupling, is still `WIRE_FILM` of the wire's radius away from the glass: a thinner film below the wire is
not resolved.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from spirillum.arrays import PerRobot
from spirillum.display import DisplayMixin
from spirillum.envelope import quantity
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.tube.domain import WIRE_FILM, in_tube
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.notes import Note
from spirillum.progress import Progress, tell
from spirillum.quantities import QUANTITIES
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import broken
from spirillum.robot.model_options import ModelOptions
from spirillum.robot.placement import Placement
from spirillum.robot.tube_pose import GAP_BAND, contact_pitch, largest_gap
from spirillum.swimming.motions import Swimming
from spirillum.swimming.preparation import has_table, preparation_time, why_no_table
from spirillum.swimming.steady import one_after_another
from spirillum.units import show

PLACES_PER_FIELD = 3  #: Gaps, and pitches at each of them.
TOLERANCE = 0.25
"""Tolerance `model.tube.tolerance` of the poses of a band: nominal, since waves to and from the tail are kept as at the
default. At gaps of 0.3, 0.5 and 1 mm the level robot of the paper has its speed within 0.04 %, its body rate within 4 %
of the default's; pitched by 2.5 degrees at 0.5 mm, within 0.2 % and 0.6 %. A band spans several times as much.
"""
_SLACK = 1.0 + 1e-6  # rounding must not carry the steepest pose out of the domain
_SWEPT = 129  # rings of what the tail sweeps in a turn


@dataclass(frozen=True, repr=False)
class Band(DisplayMixin):
    """Steady swimming of one robot at the poses that its placement leaves open, SI."""

    over: tuple[str, ...]  #: Fields of the placement that it goes over: `gap`, `pitch` or both.
    gap: PerRobot
    pitch: PerRobot
    swimming: Swimming  #: The quantities at each pose; NaN where it has no answer.
    reference: Swimming  #: The quantities at the reference pose, which belongs to the band.
    left_out: tuple[Note, ...]  #: Poses without an answer, a sentence each.

    def limits(self, name: str) -> tuple[float, float]:
        """Least and largest value of a quantity over all poses; NaN where it does not apply."""
        values = np.concatenate([getattr(self.swimming, name), getattr(self.reference, name)])
        known = values[np.isfinite(values)]
        return (float(known.min()), float(known.max())) if known.size else (float("nan"), float("nan"))

    def of(self, name: str) -> dict[str, Any]:
        """Entries `low`, `high` and `kind` of a quantity's JSON; none for one that does not apply."""
        low, high = self.limits(name)
        return {"low": low, "high": high, "kind": "band"} if np.isfinite(low) else {}

    def placed(self, placement: dict[str, Any]) -> dict[str, Any]:
        """A model's description of a placement, with the fields over which it has a band."""
        found = dict(placement)
        for name, unit in (("gap", "m"), ("pitch", "rad")):
            if name in self.over:
                values = getattr(self, name)
                ends = {"low": float(values.min()), "high": float(values.max()), "kind": "band"}
                found[name] = {**quantity(None, unit), **found.get(name, {}), **ends}
        return found

    def to_dict(self) -> dict[str, Any]:
        """All poses with their answers, as quantities whose values are lists."""
        found = {"gap": quantity(self.gap, "m"), "pitch": quantity(self.pitch, "rad")}
        return found | {
            name: quantity(column, QUANTITIES[name].unit) for name, column in self.swimming.quantities.items()
        }

    def _display_content(self) -> tuple[dict[str, Any], None]:
        """See `DisplayMixin`: each quantity at the reference pose, with its limits over all poses."""
        content = {"schema": "spirillum.band/1", "over": " and ".join(self.over), "poses": self.gap.size}
        return content | {
            name: quantity(column[0], QUANTITIES[name].unit, **self.of(name))
            for name, column in self.reference.quantities.items()
        }, None


def left_open(placement: Placement, model: SwimmerModel) -> tuple[str, ...]:
    """Fields of a placement over which a model's answer has a band; none where it is not requested."""
    if not model.placed or placement.eccentricity is not None:
        return ()
    return tuple(name for name in ("gap", "pitch") if getattr(placement, name) is None)


def band_poses(batch: RobotBatch, model: SwimmerModel) -> list[Placement]:
    """The poses of a robot's band, from wide gaps to narrow ones and from level to steep."""
    # As many for every robot, so that the poses of several compare: where a robot has no room, some are the same.
    over = left_open(batch.pose, model)
    if not over:
        return []
    g, radius = in_tube(batch)
    known = batch.placement
    gaps = [known.gap]
    if "gap" in over:
        room = largest_gap(g.body, radius, known.pitch or 0.0, known.yaw)
        ends = [min(share * 0.5 * g.width, room) for share in GAP_BAND]
        gaps = np.geomspace(ends[1], ends[0], PLACES_PER_FIELD).tolist()
    places = []
    for gap in gaps:
        assert gap is not None  # noqa: S101 - either open or given
        pitches = [known.pitch]
        if "pitch" in over:
            pitches = np.linspace(0.0, steepest_pitch(batch, gap), PLACES_PER_FIELD).tolist()
        places += [known.model_copy(update={"gap": gap, "pitch": pitch}) for pitch in pitches]
    return places


@lru_cache(maxsize=4096)
def _steepest(g: RobotGeometry, radius: float, gap: float, drop: float, yaw: float) -> float:
    """Pitch at which tail or coupling keep no more than the clearance, rad; 0 where even a level robot does not."""
    # The tail stands for all that it sweeps in a turn: tails which differ in wavelength and hand alone share it.
    wire = 0.5 * g.wire_diameter
    found = contact_pitch(
        g.body,
        g.swept(_SWEPT),
        wire,
        radius,
        gap,
        coupling=g.outlines.get("coupling"),
        tail_drop=drop,
        clearance=_SLACK * WIRE_FILM * wire,
        yaw=yaw,
    )
    return 0.0 if np.isnan(found) else found


def steepest_pitch(batch: RobotBatch, gap: float) -> float:
    """Steepest pitch, nose up, that a gap and the tail allow, rad; 0 where even a level robot has no room."""
    g, radius = in_tube(batch)
    known = batch.placement
    return _steepest(g._replace(wavelength=1.0, hand=1.0), radius, gap, known.tail_drop, known.yaw)


def at_pose(batch: RobotBatch, place: Placement) -> RobotBatch:
    """Robots at a pose of the band, with the resolution of a band."""
    own: ModelOptions = batch.options
    tube = own.tube.model_copy(update={"tolerance": TOLERANCE})
    return replace(batch, placement=place, options=own.model_copy(update={"tube": tube}))


def band_of(
    batch: RobotBatch,
    model: SwimmerModel,
    reference: Swimming,
    answer: Callable[[RobotBatch], Swimming],
    progress: Progress | None,
) -> Band | None:
    """The band of one robot; None where its placement leaves nothing open."""
    places = band_poses(batch, model)
    if not places:
        return None
    found, left_out = [], []
    for done, place in enumerate(places):
        assert place.gap is not None  # noqa: S101 - every pose has both
        assert place.pitch is not None  # noqa: S101
        where = f"gap {show(place.gap, 'mm')}, pitch {show(place.pitch, 'deg')}"
        tell(progress, f"{model.name}, {where}", done + 1, len(places) + 1)
        there = at_pose(batch, place)
        found.append(answer(there))
        if not found[-1].valid[0]:
            outside = broken(model.requirements(there))
            why = outside[0].sentence() if outside else "the robot finds no steady motion there"
            left_out.append(Note.named("pose-left-out", where=where, why=why))
    tell(progress, model.name, len(places) + 1, len(places) + 1)
    return Band(
        left_open(batch.pose, model),
        np.array([place.gap for place in places], dtype=float),
        np.array([place.pitch for place in places], dtype=float),
        one_after_another(found),
        reference,
        tuple(left_out),
    )


def no_band_warnings(batch: RobotBatch, model: SwimmerModel) -> list[Note]:
    """Limits of an answer at one pose of several, with the remedy; nothing where the pose is known."""
    over = left_open(batch.pose, model)
    if not over:
        return []
    named = f"{' and '.join(over)} {'is' if len(over) == 1 else 'are'}"
    more = "--band gives the band over them, in minutes"
    if not has_table(batch) and not why_no_table(*in_tube(batch)):
        whole, band = (preparation_time(batch, stage) for stage in ("yaw", "straight"))
        band = band.partition(" on ")[0]
        more = f"`spirillum prepare ROBOT` adds band, trial, steady in {whole} (--stage straight: band, {band})"
    return [Note.named("pose-open", open=named, more=more, fields=over)]
