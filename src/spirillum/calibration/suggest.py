"""Which tail or channel to measure next: the expected information gain of each candidate.

Given the draws of a posterior, a new robot's means would be seen with the model's discrepancy and the errors of its
trials. Their information about the fitted numbers is the mutual information. Where draws of the predictions are
close to normal, as they are once some robots have been observed, it is

    I = 1/2 log det(C + N) - 1/2 log det(N)

with the covariance C of the predicted means over the draws and N of discrepancy and errors (a linear-Gaussian design;
Chaloner and Verdinelli, Stat. Sci. 10:273, 1995). It is given in bits: one bit halves the volume of what is uncertain.
A discrepancy caps it: a model that misses every tail by 10 % learns little from one more.

Draws are finite. How far a candidate is behind the best one is known to a standard error, from leaving out one block of
consecutive draws after another (a jackknife, whose blocks are longer than the draws remember; Kuensch, Ann. Stat.
17:1217, 1989). Both candidates have the same draws, so that most of the error of each cancels.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.answer_entries import answer_of
from spirillum.arrays import Samples
from spirillum.calibration.experiment import channel_of, robots_by_channel, tail_words, with_tail
from spirillum.calibration.fit import RobotSource, load_robots
from spirillum.calibration.fit_warnings import synthetic_warning
from spirillum.display import DisplayMixin, counted
from spirillum.errors import InputError, check_choice, check_range
from spirillum.fitted.fit import fit_of_posterior
from spirillum.fitted.posterior_file import PosteriorFile, read_posterior
from spirillum.fluid.registry import find_swimmer_model
from spirillum.fluid.tube.library import TabledTube, tabled
from spirillum.formats.tables import check_present, read_table
from spirillum.notes import Note
from spirillum.progress import Progress, tell
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import broken
from spirillum.robot.load import PAPER_ROBOTS, PAPER_ROBOTS_TAKEN
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.swimming.cautions import calibration_warnings
from spirillum.swimming.intervals import sampled_kinematics
from spirillum.swimming.motions import HELD, RELEASED
from spirillum.swimming.preparation import fitted_with, has_table

_WHAT = "a file of candidates (CSV with channel_diameter_mm, wavelength_mm, amplitude_mm)"
_COLUMNS = ("channel_diameter_mm", "wavelength_mm", "amplitude_mm")
_DEFAULT_WAVELENGTHS = (10.0, 15.0, 20.0, 25.0, 30.0)
_DEFAULT_AMPLITUDES = (1.5, 2.0, 2.5, 3.0, 3.5)
_MOST = 2000
_BLOCKS = 20  # blocks of draws, each of which is left out once
_TIED = 2.0  # standard errors within which a candidate is tied with the best one
_NO_YAWED_TABLE = "it has no table with yawed poses; `spirillum prepare` makes one"
_SAID = 5  # candidates that are left out by name


@dataclass(frozen=True)
class CandidateRobot:
    """A robot that might be measured."""

    channel_diameter: float
    wavelength: float
    amplitude: float
    gain: float  #: Expected information about the fitted numbers, bits.
    narrowing: Mapping[str, float]
    """Expected standard deviation of each number after the measurement over that before."""
    behind: float = 0.0  #: Information of the best candidate less that of this one, bits; 0 for the best.
    behind_error: float = 0.0  #: Standard error of that difference, from the finite number of draws, bits.

    @property
    def tied(self) -> bool:
        """Whether it is tied with the best candidate; true of the best itself."""
        return self.behind <= _TIED * self.behind_error


@dataclass(frozen=True, repr=False)
class Suggestion(DisplayMixin):
    """Candidates from the most to the least informative."""

    posterior: PosteriorFile
    trials: int
    answer: str  #: Motion of the robots in these trials: `held` or `trial`.
    candidates: tuple[CandidateRobot, ...]
    warnings: tuple[Note, ...]

    def to_dict(self) -> dict[str, Any]:
        """The answer of `spirillum suggest --json`."""
        motion = "" if self.answer == HELD else self.answer
        return answer_of(self, motion=motion, model_reason=fitted_with(self.posterior.source))


def suggest(
    posterior: str | Path,
    robots: RobotSource | Sequence[RobotSource] | None = None,
    *,
    candidates: str | Path | None = None,
    trials: int = 5,
    answer: str = HELD,
    progress: Progress | None = None,
) -> Suggestion:
    """Rank candidate robots by the expected information of measuring them.

    Args:
        posterior: file of a calibration's posterior.
        robots: a robot for each channel that might be used; None: the paper's two, if the posterior is of their
            channels and body.
        candidates: channels and tails to choose from (CSV); None: tails of 10 to 30 mm wavelength and 1.5 to 3.5 mm
            amplitude in every robot's channel.
        trials: trials of each candidate.
        answer: motion of which the posterior is: `held`, or `trial`, with some dozens of runs of each candidate.
        progress: called with stage, number done, and total.

    Raises:
        InputError: for wrong input.
    """
    check_range("trials", trials, 1, 10**6)
    check_choice("answer", answer, (HELD, RELEASED))
    known = read_posterior(posterior, answer=answer)
    given = _papers_robots(known) if robots is None else load_robots(robots)
    allowed = "robots with a channel, in which one more tail may be measured"
    robots_by_channel(given, allowed, "by which candidates are named")
    loaded = [known.central(robot) for robot in given]
    tails = product(_DEFAULT_WAVELENGTHS, _DEFAULT_AMPLITUDES)
    listed = [with_tail(robot, 1e-3 * length, 1e-3 * size) for (length, size), robot in product(tails, loaded)]
    if candidates is not None:
        listed = _listed(Path(candidates), loaded)
    found: list[tuple[CandidateRobot, Samples]] = []
    left_out = []
    numbers, names = _numbers(known)
    model = find_swimmer_model(known.model)
    for place, robot in enumerate(listed):
        tell(progress, "candidates", place, len(listed))
        outside = _outside(known, robot, answer)
        if outside:
            left_out.append(Note.named("candidate-left-out", robot=tail_words(robot), outside=outside))
            continue
        seen = sampled_kinematics(robot, model, known) if answer == HELD else _trial_kinematics(known, robot)
        if isinstance(seen, str):
            left_out.append(Note.named("candidate-left-out", robot=tail_words(robot), outside=seen))
            continue
        found.append(_candidate(known, robot, trials, seen, numbers, names))
    if not found:
        raise InputError(f"no candidate can be built and answered: {left_out[0]}")
    if len(left_out) > _SAID:
        left_out[_SAID:] = [Note.named("candidates-left-out", count=len(left_out) - _SAID)]
    ordered = sorted(found, key=lambda pair: -pair[0].gain)
    best, of_best = ordered[0]
    return Suggestion(
        known,
        trials,
        answer,
        tuple(
            replace(
                item,
                behind=best.gain - item.gain,
                behind_error=float(np.sqrt((gains.size - 1.0) * np.var(of_best - gains))),  # the jackknife's
            )
            for item, gains in ordered
        ),
        (
            *((PAPER_ROBOTS_TAKEN,) if robots is None else ()),
            *_cautions(known, loaded),
            *_inaccurate(known, listed),
            *left_out,
        ),
    )


def _papers_robots(known: PosteriorFile) -> list[Robot]:
    """The paper's robots, for a posterior of these."""
    robots = load_robots(PAPER_ROBOTS)
    channels = [robot.channel.diameter for robot in robots if robot.channel]
    body = (robots[0].body.diameter, robots[0].body.length)
    strange = [c for c in known.channels if not np.any(np.isclose(c, channels, rtol=1e-6, atol=0.0))]
    if strange or not np.allclose(body, known.body, rtol=1e-6, atol=0.0):
        sizes = ", ".join(f"{1e3 * channel:g} mm" for channel in known.channels)
        diameter, length = (1e3 * size for size in known.body)
        raise InputError(
            f"{known.source} is of channels of {sizes} and a body of {diameter:g} x {length:g} mm, which are not the "
            "paper's; allowed: ROBOT, one for each channel that might be used"
        )
    return robots


def _trial_kinematics(known: PosteriorFile, robot: Robot) -> Mapping[str, Samples] | str:
    """Advance and turning of a robot's trial at every draw; a sentence where too few trials have an answer."""
    from spirillum.calibration.forward_models import FREE, surfaces_of  # its equations are compiled

    ends = {name: (float(draws.min()), float(draws.max())) for name, draws in known.draws.items() if name in FREE}
    try:
        surfaces = surfaces_of([robot], ends, None)
    except InputError as error:
        return str(error)
    advance, turning, _ = surfaces.at(known.draws)
    return {"advance": advance[:, 0], "turning": turning[:, 0]}


def _outside(known: PosteriorFile, robot: Robot, answer: str) -> str:
    """Why the posterior's model has no answer for a robot; empty where it has."""
    if answer == RELEASED:
        return "" if has_table(RobotBatch.of(robot), "yaw") else _NO_YAWED_TABLE
    model = find_swimmer_model(known.model)
    batch = RobotBatch.of(robot, known.placed(robot, Placement()) if model.placed else None)
    if model.placed:
        model = tabled(batch) or model
        if not isinstance(model, TabledTube):
            return "it has no table of its tube that covers the robots' poses; `spirillum prepare` makes one"
    outside = broken(model.requirements(batch))
    return outside[0].sentence() if outside else ""


def _cautions(known: PosteriorFile, robots: Sequence[Robot]) -> list[Note]:
    fit, model = fit_of_posterior(known), find_swimmer_model(known.model)
    said = [
        note.prefixed(f"{robot.name}: ")
        for robot in robots
        for note in (*calibration_warnings(robot, known.model), *fit.geometry_warnings([robot], [model]))
    ]
    if known.synthetic:
        said.append(synthetic_warning(known.observations))
    return said


def _inaccurate(known: PosteriorFile, listed: Sequence[Robot]) -> list[Note]:
    """A note for each limit within which the model is accurate that candidates break, with the first of them."""
    broken_by: dict[str, list[Note]] = {}
    for robot in listed:
        for limit in broken(find_swimmer_model(known.model).cautions(RobotBatch.of(robot))):
            broken_by.setdefault(limit.flag, []).append(limit.caution().prefixed(f"{tail_words(robot)}: "))
    whole = counted(len(listed), "candidate")
    return [said[0].prefixed(f"{len(said)} of {whole}, the first ") for said in broken_by.values()]


def _numbers(known: PosteriorFile) -> tuple[Samples, list[str]]:
    """Logarithms of all fitted numbers, (draws, numbers), with their names."""
    columns, names = [], []
    for name, values in known.draws.items():
        for place in range(values.shape[1]):
            columns.append(np.log(np.maximum(values[:, place], 1e-300)))
            several = values.shape[1] > 1
            names.append(f"{name}[{known.channels[place] * 1e3:g} mm]" if several else name)
    return np.stack(columns, axis=1), names


def _information(seen: Samples, noise: Samples) -> tuple[float, Samples, Samples]:
    """Expected information, bits, with the covariances of the predicted means and of their observations."""
    spread = np.cov(seen).reshape(len(seen), len(seen))
    errors = np.diag(noise.mean(axis=1))
    gain = 0.5 * (np.linalg.slogdet(spread + errors)[1] - np.linalg.slogdet(errors)[1]) / np.log(2.0)
    return float(gain), spread, errors


def _candidate(
    known: PosteriorFile,
    robot: Robot,
    trials: int,
    predicted: Mapping[str, Samples],
    numbers: Samples,
    names: list[str],
) -> tuple[CandidateRobot, Samples]:
    """A candidate, and its information where one block of draws after another is left out."""
    rows, noise = [], []
    for quantity_name, values in predicted.items():
        tau = known.discrepancy.get(quantity_name)
        sigma = known.error.get(quantity_name)
        if tau is None or sigma is None:
            continue
        middle = float(np.median(values))
        rows.append(values / middle - 1.0)
        noise.append(np.broadcast_to(tau**2 + sigma**2 / trials, values.shape))
    seen, variances = np.stack(rows), np.stack(noise)
    gain, spread, errors = _information(seen, variances)
    blocks = np.array_split(np.arange(seen.shape[1]), min(_BLOCKS, seen.shape[1] // 2))
    rest = [(np.delete(seen, block, axis=1), np.delete(variances, block, axis=1)) for block in blocks]
    left_out = np.array([_information(*some)[0] for some in rest])
    deviations = numbers - numbers.mean(axis=0)
    shared = deviations.T @ (seen - seen.mean(axis=1, keepdims=True)).T / (numbers.shape[0] - 1.0)
    variance = deviations.var(axis=0, ddof=1)
    told = np.einsum("ij,jk,ik->i", shared, np.linalg.inv(spread + errors), shared)
    narrowing = np.sqrt(np.clip(1.0 - told / np.maximum(variance, 1e-300), 0.0, 1.0))
    narrower = dict(zip(names, narrowing.tolist(), strict=True))
    return CandidateRobot(channel_of(robot), robot.tail.wavelength, robot.tail.amplitude, gain, narrower), left_out


def _listed(path: Path, robots: Sequence[Robot]) -> list[Robot]:
    """Candidates of a file; comments and empty lines are skipped."""
    table = read_table(path, _WHAT)
    check_present(table, _COLUMNS)
    if not 1 <= len(table.below) <= _MOST:
        raise InputError(f"{path} holds {len(table.below)} candidates; allowed: 1 to {_MOST}")
    by_channel = {round(robot.channel.diameter, 9): robot for robot in robots if robot.channel}
    found: dict[tuple[float, ...], Robot] = {}
    for row in table.rows():
        channel, wavelength, amplitude = (
            1e-3 * row.number(name, name, low=1e-6, high=1e6, blank=(), allowed="a length of 1e-06 to 1e+06 mm")
            for name in _COLUMNS
        )
        robot = by_channel.get(round(channel, 9))
        if robot is None:
            allowed = ", ".join(f"{diameter * 1e3:g} mm" for diameter in sorted(by_channel))
            raise InputError(f"{row.place}, column channel_diameter_mm: {row.text(_COLUMNS[0])}; allowed: {allowed}")
        if (channel, wavelength, amplitude) in found:
            tail = ", ".join(f"{name} = {row.text(name)}" for name in _COLUMNS)
            raise InputError(f"{row.place}: {tail} is a duplicate; allowed: each candidate once")
        found[channel, wavelength, amplitude] = with_tail(robot, wavelength, amplitude)
    return list(found.values())
