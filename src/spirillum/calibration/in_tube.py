"""The forward model of robots in their tubes: each robot's own table, evaluated at the pose of every draw.

A table (`spirillum prepare`) answers for any gap and pitch in microseconds, so that a fit takes seconds. Its error at
places that were not used for it stands in it: no prediction is taken to be better.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from spirillum.calibration.experiment import Experiment
from spirillum.calibration.forward import DryContact, Forward
from spirillum.errors import InputError
from spirillum.fluid.model import SwimmerModel
from spirillum.fluid.tube.progress_messages import TABLE_TAKES
from spirillum.fluid.tube.tabled import TabledTube, tables_of
from spirillum.robot.batch import RobotBatch
from spirillum.robot.placement import Placement, gap_on_asperities
from spirillum.swimming.band import band_places
from spirillum.swimming.drawn_resistance import TubeResistance
from spirillum.swimming.dry_friction import weights_in_fluid
from spirillum.swimming.preparation import prepare_all

ROUGHNESS_BAND = (1e-4, 1e-2)
"""Least and largest height of asperities over the body's radius: from polished surfaces (1 um for the paper's robot) to
burrs and seams of moulded parts (0.1 mm)."""
_NAMED = 6

Ranges = dict[str, tuple[float, float]]


def place_ranges(batch: RobotBatch, model: SwimmerModel, names: Sequence[str]) -> Ranges:
    """Gaps, pitches and roughnesses that every robot of a batch allows: ends of their priors, m and rad."""
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in names}
    for _, one in batch.blocks(1):
        radius = 0.5 * float(one.body_diameter[0])
        rough = (ROUGHNESS_BAND[0] * radius, ROUGHNESS_BAND[1] * radius)
        known = {"gap": float(gap_on_asperities(rough[0]))} if "roughness" in names else {}
        places = band_places(one.placed(Placement().model_copy(update=known)), model)
        gaps = [place.gap or 0.0 for place in places]
        # The steepest pitch depends on the gap; what holds at every gap is the least of them.
        steepest = min(max(place.pitch or 0.0 for place in places if place.gap == gap) for gap in gaps)
        own = {"gap": (min(gaps), max(gaps)), "pitch": (0.0, steepest), "roughness": rough}
        for name in names:
            found[name].append(own[name])
    ranges = {name: (max(low for low, _ in ends), min(high for _, high in ends)) for name, ends in found.items()}
    for name, (low, high) in ranges.items():
        if not low < high:
            raise InputError(
                f"free = '{name}': the robots share no range of it; allowed: robots that fit their channels"
            )
    return ranges


def tube_forward(
    experiment: Experiment,
    batch: RobotBatch,
    free: Sequence[str],
    tell: Callable[[str, int, int], None],
    *,
    prepare: bool,
) -> tuple[Forward, float]:
    """The forward model, and the largest relative error of the robots' tables in speed and body rate."""
    model = _tables(experiment, batch, tell, prepare=prepare)
    level = replace(batch, placement=Placement().model_copy(update={"pitch": 0.0}))
    contact = _contact(experiment, batch) if "friction_coefficient" in free else None
    forward = Forward(TubeResistance.of(level, model), batch.electrics, batch.viscosity, contact=contact)
    errors: list[Mapping[str, float]] = [model.table_of(batch, index).error_without_yaw for index in range(batch.size)]
    return forward, max(error[name] for error in errors for name in ("forward_velocity", "body_rotation_rate"))


def _tables(
    experiment: Experiment, batch: RobotBatch, tell: Callable[[str, int, int], None], *, prepare: bool
) -> TabledTube:
    """The robots' tables."""
    found = tables_of(batch)
    lacking = [label for label, table in zip(experiment.labels(), found, strict=True) if table is None]
    if lacking and not prepare:
        otherwise = ", or model 'sbt', which leaves out the walls"
        raise without_tables(experiment, lacking, "model 'tube' asks a table", otherwise)
    made = [one.table for one in prepare_all(experiment.robots, stage="straight", progress=tell)] if lacking else found
    return TabledTube({table.key: table for table in made if table is not None})


def without_tables(experiment: Experiment, lacking: Sequence[str], need: str, otherwise: str = "") -> InputError:
    """The error of a fit some of whose robots lack the table that it needs."""
    more = f" and {len(lacking) - _NAMED} more" if len(lacking) > _NAMED else ""
    return InputError(
        f"{experiment.source}: {need} of every robot, and {len(lacking)} of {len(experiment.robots)} have none "
        f"({'; '.join(lacking[:_NAMED])}{more}); allowed: --prepare, which makes them first, each in "
        f"{TABLE_TAKES}{otherwise}"
    )


def _contact(experiment: Experiment, batch: RobotBatch) -> DryContact:
    """Parameters of dry friction."""
    weight = weights_in_fluid(experiment.robots)
    if not np.all(weight > 0):
        place = int(np.argmin(weight > 0))
        raise InputError(
            f"free = 'friction_coefficient', but robot {experiment.robots[place].name} has no weight in the fluid that "
            "would press it onto the floor; allowed: robots with body.mass and tail.density that sink"
        )
    if not np.all(np.isfinite(experiment.tail_rate)):
        place = int(np.argmin(np.isfinite(experiment.tail_rate)))
        raise InputError(
            f"{experiment.source}, row {experiment.rows[place][0]}, column tail_rate_Hz: empty; allowed: a tail rate, "
            "which dry friction is balanced at (free = 'friction_coefficient')"
        )
    return DryContact(weight, np.broadcast_to(0.5 * batch.body_diameter, (batch.size,)), experiment.tail_rate)
