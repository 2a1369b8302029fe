"""Unknowns of a trial, and the interval of its values over them: docs/unknowns.md.

The same space-filling sample (Sobol' points with a fixed seed) serves all robots, so that differences between robots
are not those of their samples. What a robot, a calibration or a request states is not varied.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any, Literal, NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.envelope import quantity
from spirillum.kernels.native import thread_count
from spirillum.robot.geometry import CenterOfMass
from spirillum.robot.links import links_of
from spirillum.robot.robot import STANDARD_GRAVITY, Robot
from spirillum.robot.toml_writer import with_numbers
from spirillum.swimming.released_motion import ReleasedMotion, TrialInterval

RUNS = 64
"""Runs over the unknowns: a power of two, at which Sobol' points fill space evenly."""
_SEED = 36
"""Of the scrambling: with it the unknowns of 64 points correlate by less than 0.04."""
LEVEL = 0.9
"""Level of the interval over the unknowns."""
_AXIAL, _RADIAL = "body.center_of_mass.x", "body.center_of_mass.radial"
_FEWEST = 0.5
"""Share of the runs that have to swim."""


class TrialUnknown(NamedTuple):
    """An unknown of a trial, with an assumed distribution between two bounds."""

    name: str
    """`wait`, or the field that it replaces, or is added to."""
    kind: Literal["uniform", "log-uniform"]
    """Shape of the distribution."""
    low: float
    high: float
    of: str
    """What the ends are multiples of, or their unit."""
    source: str
    """Why these ends."""

    def at(self, shares: Samples) -> Samples:
        """Values at shares of the distribution, between 0 and 1."""
        if self.kind == "uniform":
            return self.low + (self.high - self.low) * shares
        found: Samples = self.low * (self.high / self.low) ** shares
        return found

    def to_dict(self, share: float) -> dict[str, Any]:
        """Its entry in `unknowns` of an answer, with its share of the variance."""
        ends = {"low": self.low, "high": self.high, "of": self.of, "source": self.source}
        return {"name": self.name, "distribution": self.kind, **ends, "share": quantity(share, "1")}


UNKNOWNS = (
    TrialUnknown("wait", "log-uniform", 10.0, 600.0, "s", "nobody states it: from a quick hand to ten minutes"),
    TrialUnknown(
        "roughness", "log-uniform", 1e-4, 1e-2, "body's radius", "from a smooth hull to glued and printed stripes"
    ),
    TrialUnknown(
        "friction_coefficient", "uniform", 0.0, 0.3, "1", "lubricated surfaces 0.05 to 0.15; from none to dry plastics"
    ),
    TrialUnknown(
        "weight",
        "uniform",
        0.9,
        1.1,
        "weight in the fluid",
        "the difference of mass and displaced mass, each to 1 or 2 %",
    ),
    TrialUnknown(
        "friction.effective",
        "log-uniform",
        1.0,
        20.0,
        "the rotor's own B_m",
        "no seal has less than the bearings alone; B_eff inferred from trials is 10 to 16 times that",
    ),
    TrialUnknown(
        "fluid.cavitation_pressure",
        "log-uniform",
        1e4,
        1e5,
        "Pa",
        "one atmosphere for a liquid without gas; one with dissolved air may cavitate at a tenth of it",
    ),
    TrialUnknown(
        "body.center_of_mass.x",
        "uniform",
        -0.05,
        0.05,
        "body's length",
        "battery and motor fill the body unevenly; about the centre of a body of uniform density",
    ),
    TrialUnknown(
        "body.center_of_mass.radial",
        "uniform",
        0.0,
        0.05,
        "body's radius",
        "from a body that is balanced on its axis to parts that lie off it by their clearance",
    ),
)
"""What the interval of a trial is over, in the order of the columns of its sample."""


class TrialSample(NamedTuple):
    """Settings of one run in place of unknown ones; None where the request states them."""

    robot: Robot
    wait: float | None
    roughness: float | None
    friction_coefficient: float | None


def open_unknowns(robot: Robot, weight: float, stated: Mapping[str, object]) -> tuple[TrialUnknown, ...]:
    """Return the unknowns that are open.

    Args:
        robot: the robot.
        weight: its weight in the fluid, N; 0 where its masses are not known.
        stated: `wait`, `roughness` and `friction_coefficient` as they are requested or fitted; None where they are not.
    """
    free = {name for name, value in stated.items() if value is None}
    free |= {"weight"} if weight and robot.body.mass is not None else set()
    free |= {"friction.effective"} if robot.motor is not None and robot.friction.effective is None else set()
    free |= {"fluid.cavitation_pressure"} - {f"fluid.{name}" for name in robot.fluid.model_fields_set}
    if robot.has_body and robot.body.mass is not None and robot.body.center_of_mass is None:
        free |= {_AXIAL, _RADIAL}
    return tuple(one for one in UNKNOWNS if one.name in free)


def samples_of(
    robot: Robot, weight: float, unknowns: Sequence[TrialUnknown], shares: Samples | None = None
) -> list[TrialSample]:
    """Return the runs over the unknowns of a robot with that weight in the fluid, N.

    Args:
        robot: the robot.
        weight: its weight in the fluid, N.
        unknowns: what is open.
        shares: of the distributions, (runs, unknowns), 0 to 1; None: the space-filling sample that serves all robots.
    """
    points = _shares(unknowns) if shares is None else shares
    values = {one.name: one.at(column) for one, column in zip(unknowns, points.T, strict=True)}
    found = []
    for number in range(len(points)):
        own = {name: float(column[number]) for name, column in values.items()}
        fields = {name: value for name, value in own.items() if name == "fluid.cavitation_pressure"}
        if "weight" in own and robot.body.mass is not None:
            fields["body.mass"] = robot.body.mass + (own["weight"] - 1.0) * weight / STANDARD_GRAVITY
        if "friction.effective" in own and robot.motor is not None:
            fields["friction.effective"] = own["friction.effective"] * robot.motor.rotor_friction
        one = _with_center(with_numbers(robot, fields), own)
        height = 0.5 * robot.body.diameter * own["roughness"] if "roughness" in own else None
        found.append(TrialSample(one, own.get("wait"), height, own.get("friction_coefficient")))
    return found


def _with_center(robot: Robot, own: Mapping[str, float]) -> Robot:
    """The robot with the centre of mass of a sample, where that is open."""
    if _AXIAL not in own:
        return robot
    body = robot.body
    x = float(links_of(robot).body.centre[0]) + own[_AXIAL] * body.length
    center = CenterOfMass().model_copy(update={"x": x, "radial": 0.5 * body.diameter * own[_RADIAL]})
    return robot.model_copy(update={"body": body.model_copy(update={"center_of_mass": center})})


def with_interval(
    nominal: ReleasedMotion,
    samples: Sequence[TrialSample],
    unknowns: Sequence[TrialUnknown],
    run: Callable[[TrialSample], ReleasedMotion],
    progress: Callable[[str, int, int], None] | None = None,
) -> ReleasedMotion:
    """Return the trial at nominal unknowns with its interval over them, and what each of them contributes.

    Args:
        nominal: the trial at nominal unknowns.
        samples: the runs, as `samples_of` gives them.
        unknowns: what they differ in.
        run: makes one of them.
        progress: told how many runs are done, and of how many.
    """
    if nominal.reason or not unknowns:
        return nominal
    runs: list[ReleasedMotion] = []
    with ThreadPoolExecutor(thread_count()) as pool:  # the compiled loops release the GIL
        try:
            for found in pool.map(run, samples):
                runs.append(found)
                if progress is not None:
                    progress("trial over its unknowns", len(runs), len(samples))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    swims = np.array([_swims(one) for one in runs])
    basis: dict[str, Any] = {
        "runs": len(runs),
        "standing": sum(not one.reason for one in runs) - int(swims.sum()),
        "without_answer": sum(bool(one.reason) for one in runs),
    }
    if swims.mean() < _FEWEST:
        return replace(nominal, basis={**nominal.basis, **basis})
    moving = [one for one, there in zip(runs, swims, strict=True) if there]
    speeds = np.log([one.values["forward_velocity"] for one in moving])
    shares = variance_shares(_shares(unknowns)[swims], speeds)
    basis["unknowns"] = [one.to_dict(share) for one, share in zip(unknowns, shares, strict=True)]
    edge = 0.5 * (1.0 - LEVEL)
    values = {name: np.array([one.values[name] for one in moving]) for name in nominal.values}
    quantiles = {name: np.quantile(column, [0.5, edge, 1.0 - edge]) for name, column in values.items()}
    intervals = {
        name: TrialInterval(float(middle), float(low), float(high), LEVEL)
        for name, (middle, low, high) in quantiles.items()
    }
    return replace(nominal, basis={**nominal.basis, **basis}, intervals=intervals)


def _swims(run: ReleasedMotion) -> bool:
    """Whether a robot moves forward, and dry friction does not hold it."""
    return not run.reason and run.basis["state"] != "standing" and run.values["forward_velocity"] > 0.0


def variance_shares(shares: Samples, values: Samples) -> Samples:
    """Return the share of the variance of values that each unknown explains by itself, as a parabola over its share.

    Args:
        shares: of the distributions, (runs, unknowns), 0 to 1.
        values: (runs,).
    """
    x = 2.0 * shares - 1.0
    terms = np.stack([x, x**2], axis=-1)
    design = np.column_stack([np.ones(len(x)), terms.reshape(len(x), -1)])
    factors = np.linalg.lstsq(design, values, rcond=None)[0][1:].reshape(-1, 2)
    found: Samples = np.var(np.einsum("rud,ud->ru", terms, factors), axis=0) / np.var(values)
    return found


def _shares(unknowns: Sequence[TrialUnknown]) -> Samples:
    """Shares of the distributions, (runs, unknowns): those of an unknown are the same whichever others are open."""
    from scipy.stats import qmc

    points: Samples = qmc.Sobol(len(UNKNOWNS), rng=np.random.default_rng(_SEED)).random(RUNS)
    return points[:, [UNKNOWNS.index(one) for one in unknowns]]
