"""Trials after release in the tube: the request, what a trial measures, its unknowns and their interval.

A trial: the robot is laid down, waits with its motor off while its film drains, and swims with the motor on. Its values
are means over the time with the motor on, as `spirillum.measure` gives them of a video: those of `spirillum.simulate`
by its defaults (`mean_..._on`). The steady motion is that of `spirillum.settle`.

The same space-filling sample (Sobol' points with a fixed seed) serves all robots, so that differences between robots
are not those of their samples. What a robot, a calibration or a request states is not varied.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from spirillum.answer_entries import content_of
from spirillum.arrays import Samples
from spirillum.data_tables import rows_of
from spirillum.dynamics.integration import INTERRUPTED
from spirillum.dynamics.release import InTube, Release, check_roughness
from spirillum.dynamics.rotating_field import Field
from spirillum.dynamics.run_summary import is_held, state_of
from spirillum.dynamics.timing import TRIAL_DURATION, Timing, duration_of
from spirillum.envelope import quantity
from spirillum.errors import InputError
from spirillum.fitted.fit import NO_FIT, Fit
from spirillum.fitted.posterior_file import PosteriorFile
from spirillum.fluid.tube.domain import in_tube
from spirillum.kernels.native import thread_count
from spirillum.notes import Note, notes_in
from spirillum.progress import Progress, tell
from spirillum.quantities import QUANTITIES
from spirillum.robot.batch import RobotBatch
from spirillum.robot.fields import field_values
from spirillum.robot.geometry import CenterOfMass
from spirillum.robot.links import links_of
from spirillum.robot.load import with_resolution
from spirillum.robot.model_options import Resolution
from spirillum.robot.placement import Placement
from spirillum.robot.robot import STANDARD_GRAVITY, Robot, with_numbers, without_reynolds_bound
from spirillum.robot.tube_pose import gap_of
from spirillum.swimming.intervals import PosteriorFor
from spirillum.swimming.motions import ASSUMPTION, HELD, SPEED_OF, STEADY, ReleasedMotion, TrialInterval
from spirillum.swimming.prediction import Prediction, interval_statement, predict_steady
from spirillum.swimming.preparation import WALLED, has_table, preparation_time, table_for, why_no_table
from spirillum.units import as_given, show, speed_unit

if TYPE_CHECKING:
    import xarray as xr

    from spirillum.fluid.tube.table import TubeTable


_POSE = {"gap": "wall_gap", "pitch": "wall_pitch", "yaw": "wall_yaw", "azimuth": "azimuth"}
"""The pose of an answer, and where a run has it."""
_OF_ONE_POSE = ("hydrodynamic_efficiency", "propulsive_power", "overall_efficiency")
"""Quantities that a trial does not have."""
_MANY_POSES = "they follow from the body's drag at one pose, and a trial passes through many"
_MOST_TURNS = 2000  # Turns of the tail that a trial may take beside an answer.


def why_not_released(robot: Robot, model: str, tail_rate: str | float | None, batch: RobotBatch) -> str:
    """Return why there is no released motion beside a held answer, in a sentence; empty where there is one."""
    if robot.channel is None:
        return "the robot has no channel in which it could be released"
    if model != WALLED:
        return f"model '{model}' has no walls on which a robot could rest; use model '{WALLED}'"
    if tail_rate is not None:
        return "a tail rate is prescribed, and trials follow from the drive; use drive.kind = 'rate', or motion 'free'"
    if has_table(batch, "yaw"):
        return ""
    return why_no_table(*in_tube(batch)) or (
        "its tube has no table with yawed poses yet; `spirillum prepare` makes it in "
        f"{preparation_time(batch, 'yaw')}, `simulate` and `settle` too"
    )


def trial_of(held: Prediction, run: Callable[[], xr.Dataset], duration: float) -> ReleasedMotion:
    """Return the means of a trial of a robot from where it is held."""
    turns = abs(held.tail_rotation_rate) * duration / (2.0 * np.pi)
    if turns > _MOST_TURNS:
        return ReleasedMotion(reason=f"its tail turns {turns:.4g} times in {duration:g} s; use `simulate`")
    try:
        dataset = run()
    except InputError as error:
        return ReleasedMotion(reason=str(error))
    if INTERRUPTED in str(dataset.attrs["events"]):
        raise KeyboardInterrupt
    return trial_means(dataset)


def trial_means(run: xr.Dataset) -> ReleasedMotion:
    """Return the means of a run in a tube over the time with its drive on, and its mean pose."""
    names = [item.name for item in STEADY if item.name in run and run[item.name].dims == ("time",)]
    columns = {name: name for name in names} | _POSE | {"contact_force": "contact_force"}
    time = run["time"].values
    length = float(time[-1] - time[0])
    values = {name: float(np.trapezoid(run[of].values, time)) / length for name, of in columns.items()}
    exact = {name: f"mean_{name}_on" for name in names}
    values |= {name: float(run[of]) for name, of in exact.items() if of in run}
    notes = notes_in(run.attrs)
    basis = {
        **{name: quantity(None, QUANTITIES[name].unit, reason=_MANY_POSES) for name in _OF_ONE_POSE},
        "assumption": ASSUMPTION,
        "state": "standing" if is_held(notes) else "swimming",
        "wait": quantity(float(run.attrs["wait"]), QUANTITIES["wait"].unit),
        "duration": quantity(length, "s"),
        "warnings": [str(note) for note in notes],
    }
    return ReleasedMotion(values, basis, error=float(run.attrs.get("error_estimate", np.nan)))


RUNS = 64  #: Runs over the unknowns: a power of two, at which Sobol' points fill space evenly.
_SEED = 36  # Of the scrambling: with it the unknowns of 64 points correlate by less than 0.04.
LEVEL = 0.9  #: Level of the interval over the unknowns.
_AXIAL, _RADIAL = "body.center_of_mass.x", "body.center_of_mass.radial"
_FEWEST = 0.5  # Share of the runs that have to swim.


class TrialUnknown(NamedTuple):
    """An unknown of a trial, with an assumed distribution between two bounds."""

    name: str  #: `wait`, or the field that it replaces, or is added to.
    kind: Literal["uniform", "log-uniform"]  #: Shape of the distribution.
    low: float
    high: float
    of: str  #: What the ends are multiples of, or their unit.
    source: str

    def at(self, shares: Samples) -> Samples:
        """Values at shares of the distribution, between 0 and 1."""
        if self.kind == "uniform":
            return self.low + (self.high - self.low) * shares
        return self.low * (self.high / self.low) ** shares


UNKNOWNS = tuple(
    TrialUnknown(**{**row, "low": float(row["low"]), "high": float(row["high"])})
    for row in map(dict[str, Any], rows_of("dynamics/trial_unknowns.csv"))
)
"""What the interval of a trial is over, in the order of the columns of its sample."""


class TrialSample(NamedTuple):
    """Settings of one run in place of unknown ones; None where the request states them."""

    robot: Robot
    wait: float | None
    roughness: float | None
    friction_coefficient: float | None
    draw: int | None = None  #: Number of the draw of a posterior whose values the robot has; None without one.


def open_unknowns(robot: Robot, weight: float, stated: Mapping[str, object]) -> tuple[TrialUnknown, ...]:
    """Return the unknowns of which none is requested or fitted."""
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
    """Return the runs over the unknowns of a robot with that weight in the fluid, N."""
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
        one = with_numbers(robot, fields)
        if _AXIAL in own:
            x = float(links_of(one).body.centre[0]) + own[_AXIAL] * one.body.length
            radial = 0.5 * one.body.diameter * own[_RADIAL]
            center = CenterOfMass().model_copy(update={"x": x, "radial": radial})
            one = one.model_copy(update={"body": one.body.model_copy(update={"center_of_mass": center})})
        height = 0.5 * robot.body.diameter * own["roughness"] if "roughness" in own else None
        found.append(TrialSample(one, own.get("wait"), height, own.get("friction_coefficient")))
    return found


def samples_of_draws(
    robot: Robot, weight: float, unknowns: Sequence[TrialUnknown], posterior: PosteriorFile
) -> list[TrialSample]:
    """Return the runs over draws of a posterior and over the unknowns that it leaves open."""
    kept = posterior.places(RUNS)
    drawn = posterior.sampled_robots(without_reynolds_bound(robot), RUNS, np.random.default_rng(1))
    return [
        samples_of(drawn[number % len(kept)], weight, unknowns, own[None])[0]._replace(draw=kept[number % len(kept)])
        for number, own in enumerate(_shares(unknowns))
    ]


def with_interval(
    nominal: ReleasedMotion,
    samples: Sequence[TrialSample],
    unknowns: Sequence[TrialUnknown],
    run: Callable[[TrialSample], ReleasedMotion],
    progress: Progress | None = None,
    discrepancy: Callable[[Sequence[TrialSample], Sequence[ReleasedMotion]], Mapping[str, Samples]] | None = None,
) -> ReleasedMotion:
    """Add the interval of the trial over its unknowns, of a discrepancy only for what it knows, and their shares."""
    if nominal.reason or not (unknowns or discrepancy):
        return nominal
    runs: list[ReleasedMotion] = []
    with ThreadPoolExecutor(thread_count()) as pool:  # the compiled loops release the GIL
        try:
            for found in pool.map(run, samples):
                runs.append(found)
                tell(progress, "trial over its unknowns", len(runs), len(samples))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    swims = np.array(
        [(not one.reason and one.basis["state"] != "standing" and one.values["forward_velocity"] > 0.0) for one in runs]
    )
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
    basis["unknowns"] = [content_of(one, share=share) for one, share in zip(unknowns, shares, strict=True)]
    edge = 0.5 * (1.0 - LEVEL)
    values = {name: np.array([one.values[name] for one in moving]) for name in nominal.values}
    if discrepancy is not None:
        factors = discrepancy([one for one, there in zip(samples, swims, strict=True) if there], moving)
        values = {name: values[name] * factor for name, factor in factors.items()}
    quantiles = {name: np.quantile(column, [0.5, edge, 1.0 - edge]) for name, column in values.items()}
    intervals = {
        name: TrialInterval(float(middle), float(low), float(high), LEVEL)
        for name, (middle, low, high) in quantiles.items()
    }
    return replace(nominal, basis={**nominal.basis, **basis}, intervals=intervals)


def variance_shares(shares: Samples, values: Samples) -> Samples:
    """Return the share of the variance of values that each unknown explains by itself, as a parabola over its share."""
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


_TOLERANCE = 1e-4  # Error of a time step of the runs over the unknowns: their speeds are accurate to a thousandth.
_SAMPLES_PER_TURN = 12  # Samples over which their means are taken.


def quick_run(
    robot: Robot,
    table: TubeTable,
    release: Release,
    duration: float = TRIAL_DURATION,
    **settings: Any,
) -> xr.Dataset:
    """Return the run of one of many trials, with a waiting time, in larger steps than `simulate`."""
    from spirillum.dynamics.tube_simulation import run_in_tube  # for a trial alone

    steady = predict_steady(robot, model=WALLED, placement=release.placement, band=False, **settings)
    times = Timing.of({"duration": duration, "samples_per_turn": _SAMPLES_PER_TURN})
    return run_in_tube(steady, table, times, release, Field(), progress=None, tolerance=_TOLERANCE)


@dataclass(frozen=True)
class TrialRequest:
    """Arguments of `spirillum.predict` that decide the released motions of a robot."""

    robot: Robot
    friction: str | None
    calibrated: bool
    fit: Fit
    placement: Placement | Mapping[str, Any] | None
    progress: Progress | None
    resolution: Resolution | Mapping[str, Any] | None = None
    roughness: str | float | None = None
    in_tube: InTube = field(default_factory=InTube)
    duration: float | None = None  #: Of the trial, s; None: that of a run by its defaults.
    interval: bool = False
    posterior_for: PosteriorFor = "new"  #: Whose discrepancy the interval holds, with a posterior.

    def check(self, model: str, tail_rate: str | float | None, *, wanted: bool) -> None:
        """Refuse what no trial can have, before the held answer is computed."""
        if self._given:
            robot = self.fit.central(self.robot)
            reason = why_not_released(robot, model, tail_rate, RobotBatch.of(robot))
            if not wanted or reason:
                self._check_unused(reason)
        if self.duration is not None and self.duration <= 0.0:
            raise InputError(f"duration = {self.duration:g} s; allowed: more than 0 s")
        release, channel = self._release, self.robot.channel
        if release.roughness is not None and channel is not None:
            diameter = self.robot.body.diameter
            gap = gap_of(release.placement, diameter, 0.5 * channel.diameter)
            check_roughness(release.roughness, gap, diameter)

    def _check_length(self, held: Prediction) -> None:
        """Refuse a requested duration of less than a millionth of a turn of the tail, or of more than a trial's."""
        rate = abs(held.tail_rotation_rate)
        if self.duration is None or not rate:
            return
        turn = 2.0 * np.pi / rate
        duration_of(1.0, turn, self.duration)
        if self.duration > _MOST_TURNS * turn:
            raise InputError(
                f"duration = {self.duration:g} s is {self.duration / turn:.4g} turns of the tail; allowed: at most "
                f"{np.floor(_MOST_TURNS * turn):.6g} s, {_MOST_TURNS} turns of the tail, or `simulate`"
            )

    @property
    def _release(self) -> Release:
        """Where and how the robot is released, without what is fitted of the contact."""
        return Release.of(self.placement, self.in_tube, self.roughness)

    def add_released_motions(self, held: Prediction, *, wanted: bool) -> Prediction:
        """Return the held answer with what gives its released motions, or with the reason why there are none."""
        reason = why_not_released(held.robot, held.model.name, held.tail_rate, held.batch)
        if reason:
            self._check_unused(reason)
        if not wanted:
            return held
        if reason:
            return replace(held, released=dict.fromkeys(("trial", "steady"), partial(ReleasedMotion, reason=reason)))
        self._check_length(held)
        self._announce("held", held.forward_velocity, held.tail_rotation_rate)
        other = held.fitted_by and self.fit.fitted_motion == HELD
        notes = (*held.warnings, Note.named("fit-beside-trial")) if other else held.warnings
        return replace(held, released={"trial": partial(self.trial, held), "steady": self.steady}, warnings=notes)

    def trial(self, held: Prediction) -> ReleasedMotion:
        """Return the trial, with its interval where that is requested."""
        from spirillum.dynamics.simulation import simulate_fitted  # for a trial alone

        settings: dict[str, Any] = {"in_tube": self.in_tube, "timing": {"duration": self._length}}
        settings |= {"model": WALLED, "progress": self.progress, "calibrated": self.calibrated}
        settings |= {"fit": self.fit, "draws": None if self.fit.posterior is None else 0}
        nominal = trial_of(held, lambda: simulate_fitted(**self._shared(), **settings), self._length)
        self._announce("trial", *(nominal.values.get(name) for name in ("forward_velocity", "tail_rotation_rate")))
        return self._with_interval(held, nominal) if self.interval else nominal

    def steady(self) -> ReleasedMotion:
        """Return the steady motion; it is found in seconds, which no progress is told of."""
        from spirillum.dynamics.free_motion import free_motion  # for a trial alone

        still = self.in_tube.model_copy(update={"wait": None})
        try:
            motion = free_motion(in_tube=still, fit=self.fit, **self._shared()).prediction
        except InputError as error:
            return ReleasedMotion(reason=str(error))
        lying = motion.steady_state
        assert lying is not None  # noqa: S101 - a free motion in the tube has one
        basis: dict[str, Any] = {
            "assumption": ASSUMPTION,
            "state": state_of(lying, motion.warnings),
            "statement": lying.statement,
            "time_constant": quantity(lying.approach_time, "s"),
            "warnings": [str(note) for note in motion.warnings],
        }
        values: dict[str, float] = {}
        if lying.state != "changing":  # its means depend on when they are taken
            values = {item.name: value for item in STEADY if np.isfinite(value := float(getattr(motion, item.name)))}
        self._announce("steady", values.get("forward_velocity"), values.get("tail_rotation_rate"))
        pose = {name: float(getattr(lying, name)) for name in (*_POSE, "contact_force")}
        return ReleasedMotion({**values, **pose}, basis, error=motion.error_estimate)

    @property
    def _length(self) -> float:
        """Time with the motor on, s."""
        return TRIAL_DURATION if self.duration is None else self.duration

    def _shared(self) -> dict[str, Any]:
        """Arguments that both released motions share, and the resolution, with which a run is refused."""
        robot = with_resolution(self.robot, self.resolution, WALLED)
        return {name: getattr(self, name) for name in ("friction", "placement", "roughness")} | {"robot": robot}

    def _with_interval(self, held: Prediction, nominal: ReleasedMotion) -> ReleasedMotion:
        """The trial with its interval over what neither robot, request nor calibration states."""
        known = self.fit.posterior
        robot = self.fit.central(self.robot)
        release = self._release.with_contact(self.fit.contact())
        derived = robot.derived().get("submerged_weight")
        weight = 0.0 if derived is None else derived.value
        stated = {name: getattr(release.in_tube, name) for name in ("wait", "friction_coefficient")}
        stated["roughness"] = release.roughness
        table = table_for(RobotBatch.of(robot))
        unknowns = open_unknowns(robot, weight, stated)

        def run(sample: TrialSample) -> ReleasedMotion:
            own = self._release.with_contact(self.fit.contact(sample.draw))
            values = {"wait": sample.wait, "friction_coefficient": sample.friction_coefficient}
            update = {name: value for name, value in values.items() if value is not None}
            there = self.fit.placed(sample.robot, own.placement, sample.draw)
            asked = own.in_tube.model_copy(update=update).of_trial(there)
            release = Release(there, asked, own.roughness if sample.roughness is None else sample.roughness)
            fit = self.fit if known is None else NO_FIT  # a draw's values stand in its robot
            settings = {"friction": self.friction, "calibrated": self.calibrated, "fit": fit}
            quick = partial(quick_run, sample.robot, table, release, self._length, **settings)
            return trial_of(held, quick, self._length)

        if known is None:
            return with_interval(nominal, samples_of(robot, weight, unknowns), unknowns, run, self.progress)
        drawn = samples_of_draws(robot, weight, unknowns, known)
        found = with_interval(nominal, drawn, unknowns, run, self.progress, self._discrepancy)
        return replace(
            found, basis={**found.basis, "interval_of": interval_statement(known, robot, self.posterior_for)}
        )

    def _discrepancy(self, samples: Sequence[TrialSample], runs: Sequence[ReleasedMotion]) -> Mapping[str, Samples]:
        """Factors of the discrepancy of the posterior's model on runs of its draws."""
        from spirillum.dynamics.fitted_runs import discrepancy_factors  # for a trial alone

        known = self.fit.posterior
        assert known is not None  # noqa: S101 - of a posterior's draws alone
        rates = ("forward_velocity", "body_rotation_rate", "tail_rotation_rate", "motor_rotation_rate")
        speed, body, tail, motor = (np.array([one.values[name] for one in runs]) for name in rates)
        predicted = {"advance": speed / tail, "turning": body / tail, "motor_rate": motor}
        kept = known.at([one.draw for one in samples if one.draw is not None])
        rng = np.random.default_rng(1)
        return discrepancy_factors(kept, self.fit.central(self.robot), predicted, rng, whose=self.posterior_for)

    def _announce(self, column: str, speed: float | None, rate: float | None) -> None:
        """Tell of a column as soon as it is there."""
        if self.progress is not None and speed is not None:
            self.progress(f"{SPEED_OF}{column}: {show(speed, speed_unit(speed, rate))}", 1, 1)

    @property
    def _given(self) -> dict[str, str | bool]:
        """Settings of a released motion, as they were given."""
        stated = (one for one in field_values(self.in_tube) if one.path in self.in_tube.model_fields_set)
        given = {
            "roughness": None if self.roughness is None else as_given(self.roughness, "m"),
            "duration": None if self.duration is None else as_given(self.duration, "s"),
            "interval": self.interval or None,
            **{f"in_tube.{one.path}": one.text for one in stated if one.value is not None},
        }
        return {name: value for name, value in given.items() if value is not None}

    def _check_unused(self, reason: str) -> None:
        """Refuse settings of a released motion for an answer without one, with the reason."""
        for name, value in self._given.items():
            why = f" ({reason})" if reason else ""
            raise InputError(
                f"{name} = {value} is of released motion in the tube, which this request does not "
                f"compute{why}; allowed: with model 'tube', without tail rate and motion 'held'"
            )
