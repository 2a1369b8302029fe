"""Verdicts on the paper's statements from geometry and method, and from predictions without a fit."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.arrays import Values
from spirillum.display import label_of_model as label
from spirillum.fluid.closed.sbt import EXACT_EPS_CONSTANT, PRINTED_EPS_CONSTANT
from spirillum.papers.biorob2012 import claims_swimming
from spirillum.papers.biorob2012.evidence import (
    BODY_DRAG_FACTORS,
    BODY_ROTATION_ERROR,
    FRAME_RATE,
    GLOBAL_DROP,
    LARGEST_REYNOLDS,
    NARROWER,
    NO_RATES,
    ROBOT_LENGTH,
    Evidence,
    FrictionModelRuns,
    Judgement,
    claim_of,
    verdict_of,
)
from spirillum.papers.biorob2012.published import VELOCITY_DROPS
from spirillum.papers.claim import Claim, PredictedVerdict
from spirillum.robot.load import load
from spirillum.studies.released_robots import INFERRED_BY
from spirillum.units import Hz

if TYPE_CHECKING:
    import xarray as xr


def calibration_factors(evidence: Evidence) -> Iterator[Claim]:
    """Table III."""
    yield claim_of(
        "drag_factors",
        "used as given, as named calibrations of the preset robots",
        "undecidable",
        "they come from inverting (15) with the paper's observations, which are lost"
        + ("; inverting it with others is not part of this version" if evidence.observed else ""),
    )


def robot_and_channel(evidence: Evidence) -> Iterator[Claim]:
    """Lengths, weight, channels."""
    robot, narrow = evidence.robot, load("biorob2012-narrow")
    derived = robot.derived()
    length = derived["robot_length"].value
    found = f"{1e3 * length:.0f} mm (body, coupling and tail)"
    reason = "sum of Table I's lengths"
    yield claim_of("length", found, verdict_of(length > ROBOT_LENGTH), reason, length=1e3 * ROBOT_LENGTH)
    weight = derived["submerged_weight"].value
    yield claim_of(
        "weight",
        f"submerged weight {1e3 * weight:.1f} mN",
        verdict_of(weight > 0),
        "Table I's mass and volumes, copper wire; the clearance of the coupling is assumed",
    )
    if robot.channel is not None and narrow.channel is not None:
        reduction = 1.0 - narrow.channel.diameter / robot.channel.diameter
        holds = verdict_of(bool(np.isclose(reduction, NARROWER)))
        yield claim_of("narrower", f"{100 * reduction:.0f} %", holds, "Table I", narrower=100 * NARROWER)
    if robot.motor is not None:
        friction = robot.motor.rotor_friction
        yield claim_of(
            "rotor_friction",
            f"{friction:.0e} N m s/rad, Table II's value",
            "undecidable",
            "a measurement of the paper; 7e-7 is closer to 1e-6 than to 1e-7",
        )


def method(evidence: Evidence) -> Iterator[Claim]:
    """Camera, numerical method."""
    fastest = max(
        float(np.nanmax(np.abs(evidence.free("tail_rotation_rate", model)))) / Hz for model in evidence.models
    )
    yield claim_of(
        "sampling",
        f"fastest tail at the friction-free bound {fastest:.1f} Hz; Nyquist limit {0.5 * FRAME_RATE:.0f} Hz",
        verdict_of(fastest < 0.5 * FRAME_RATE),
        "an upper bound of the tail's rate lies below half the frame rate",
        rate=FRAME_RATE,
    )
    difference = PRINTED_EPS_CONSTANT / EXACT_EPS_CONSTANT - 1.0
    yield claim_of(
        "eps",
        f"pi sqrt(e)/2 = {EXACT_EPS_CONSTANT:.5f}, {100 * difference:.1f} % less",
        verdict_of(abs(difference) < 0.01),
        "rounded from Lighthill's cut-off; the printed value is the default, the exact one an option",
        eps=PRINTED_EPS_CONSTANT,
    )
    yield claim_of(
        "simulation_time",
        "not timed here; the benchmarks give ratios within one run",
        "undecidable",
        "it depends on the machine",
    )
    yield claim_of(
        "averages",
        "Student t over the trials of the observations file" if evidence.observed else "no observations given",
        "undecidable",
        "a procedure, not a result" if evidence.observed else NO_RATES,
    )


_EQUAL = 0.05  # relative difference within which motor rates count as identical, as for observations


def predicted(evidence: Evidence) -> list[Claim]:
    """Verdicts of a study with released robots; empty for one without."""
    if "forward_velocity_at_run" not in evidence.dataset:
        return []
    readings = FrictionModelRuns(evidence)
    sources: tuple[Callable[[FrictionModelRuns], Iterator[Claim]], ...] = (
        _reynolds_numbers,
        _velocity_drops,
        _global_drop,
        _speeds,
        _body_rotation,
        _motor_rates,
        _effective_friction,
        _models,
        _contact,
    )
    return [claim for source in sources for claim in source(readings)]


def _range(values: Values, unit: str, scale: float = 1.0) -> str:
    """Format the smallest and largest value."""
    known = scale * values[np.isfinite(values)]
    if not known.size:
        return "not computed"
    return f"{known.min():.3g} to {known.max():.3g}{unit}"


def _of_tails(average: Callable[..., Any], values: Values) -> Values:
    """An average over the robots of a reading, (readings,); NaN where it has none."""
    return np.ma.filled(average(np.ma.masked_invalid(values), axis=0), np.nan)


def _reynolds_numbers(readings: FrictionModelRuns) -> Iterator[Claim]:
    speeds = readings.of("forward_velocity")
    for number, (channel, stated) in enumerate(LARGEST_REYNOLDS.items()):
        tail = readings.evidence.tail(stated.wavelength_mm, stated.amplitude_mm)
        if tail is None:
            continue
        seen, wanted = speeds[number][tail], readings.evidence.speed_of(stated.value)
        found = readings.compare(seen, wanted, "mm/s", 1e3)
        yield claim_of(
            "largest_reynolds",
            _range(seen, " mm/s", 1e3),
            found.verdict,
            f"{found.reason}; a longer length in Re means a lower speed",
            channel=channel,
            wavelength=stated.wavelength_mm,
            amplitude=stated.amplitude_mm,
            reynolds=stated.value,
            scale=f" (length scale not stated): {1e3 * wanted:.2f} mm/s on the body's diameter",
        )


def _velocity_drops(readings: FrictionModelRuns) -> Iterator[Claim]:
    speeds = readings.of("forward_velocity")
    for which, (drop, wavelength, amplitude) in VELOCITY_DROPS.items():
        tail = readings.evidence.tail(wavelength, amplitude)
        if tail is None:
            continue
        drops = speeds[0][tail] - speeds[1][tail]
        found = readings.compare(drops, 1e-3 * drop, "mm/s", 1e3)
        numbers: dict[str, Any] = {"wavelength": wavelength, "amplitude": amplitude, "drop": drop}
        yield claim_of("decrease", _range(drops, " mm/s", 1e3), *found, which=which, **numbers)


def _global_drop(readings: FrictionModelRuns) -> Iterator[Claim]:
    wide, narrow = readings.of("forward_velocity")[:, readings.both]
    if not wide.size:
        return
    loss = 1.0 - narrow.sum(axis=0) / wide.sum(axis=0)
    found = readings.compare(loss, GLOBAL_DROP, "%", 100.0)
    if readings.missing:
        found = Judgement("depends", f"no table: {readings.missing}, and it speaks of the mean of all")
    computed = f"{_range(loss, ' %', 100.0)} over {len(wide)} of {readings.both.size} tails"
    yield claim_of("global_drop", computed, *found, by="", drop=100 * GLOBAL_DROP)
    words = f"the narrow channel takes {_range(1.0 - narrow / wide, ' %', 100.0)} of the speed"
    yield readings.claim("slower", words, wide - narrow)


def _speeds(readings: FrictionModelRuns) -> Iterator[Claim]:
    speeds = readings.of("forward_velocity")
    rising, falling = np.diff(speeds, axis=1), -np.diff(speeds[:, :-1], axis=2)
    for key, steps in (("speed_wavelength", rising), ("speed_amplitude", falling)):
        yield readings.claim(key, _steps(steps), steps)


def _steps(steps: Values) -> str:
    known = steps[np.isfinite(steps)]
    if not known.size:
        return "not computed"
    return f"in {np.count_nonzero(known > 0)} of {known.size} steps of the grid and the readings"


def _body_rotation(readings: FrictionModelRuns) -> Iterator[Claim]:
    rates = np.abs(readings.of("body_rotation_rate"))
    inside = np.minimum(rates - 10**-2.5 * Hz, 10**-0.5 * Hz - rates)
    yield readings.claim("body_rates", _range(rates, " Hz", 1.0 / Hz), inside)
    errors = {
        name: np.abs(readings.of("modelled_body_rotation_rate", name) / readings.of("body_rotation_rate") - 1.0)
        for name in INFERRED_BY
    }
    within = np.minimum(*(BODY_ROTATION_ERROR - error for error in errors.values()))
    words = ", ".join(f"{label(name)} misses by {_range(error, ' %', 100.0)}" for name, error in errors.items())
    yield readings.claim("body_rate_errors", words, within)


def _motor_rates(readings: FrictionModelRuns) -> Iterator[Claim]:
    rates = np.abs(readings.of("motor_rotation_rate"))
    apart = np.abs(rates[1] / rates[0] - 1.0)
    words = f"{_range(rates, ' Hz', 1.0 / Hz)}; they differ by {_range(apart, ' %', 100.0)}"
    yield readings.claim("motor_equal", words, _EQUAL - apart)
    rising = np.diff(rates, axis=1)
    falling, saturating = -np.diff(rates, axis=2), -np.diff(rising, axis=1)
    for name, steps in (("amplitude", falling), ("wavelength", rising), ("saturates", saturating)):
        yield readings.claim(f"motor_{name}", _steps(steps), steps)


def _effective_friction(readings: FrictionModelRuns) -> Iterator[Claim]:
    found = readings.of("effective_friction", "rft")
    motor = readings.evidence.robot.motor
    if min(found.shape[1:3]) == 1:
        computed, judgement = "not computed", Judgement("depends", "a grid of several wavelengths and amplitudes")
    elif readings.known.all():
        by_wavelength = np.std(found.mean(axis=2), axis=1).mean(axis=0)
        by_amplitude = np.std(found.mean(axis=1), axis=1).mean(axis=0)
        spreads = f"over amplitudes {_range(by_amplitude, '')}, over wavelengths {_range(by_wavelength, '')}"
        computed = f"spread {spreads} N m s/rad (RFT)"
        judgement = readings.verdict_on(readings.holds((by_amplitude - by_wavelength)[None]))
    else:
        computed, judgement = "not computed", Judgement("depends", f"no table: {readings.missing}")
    yield claim_of("friction_amplitude", computed, *judgement)
    if motor is None:
        return
    rotor = motor.joint_rotor_friction
    words = f"B_eff {_range(found, ' N m s/rad')} by (18), {_range(found / rotor, ' times B_m')}"
    yield readings.claim("friction_beyond_rotor", words, found - 3.0 * rotor)
    with np.errstate(invalid="ignore"):
        spread = np.fmax.reduce(found, axis=-1) / np.fmin.reduce(found, axis=-1) - 1.0
    known = spread[np.isfinite(spread)]
    if known.size:
        moves = known > 0.5
        verdict: PredictedVerdict = "depends"
        if moves.all() or not moves.any():
            verdict = "predicted-agrees" if moves.all() else "predicted-disagrees"
        yield claim_of(
            "friction_interaction",
            f"over all gaps, films and contacts of a robot its B_eff changes by {_range(spread, ' %', 100.0)}",
            verdict,
            "(18) balances the rotor, film and contact act on the body: B_eff is the load of coupling and tail in "
            "the tube that RFT's tail in unbounded fluid does not have",
        )


def _models(readings: FrictionModelRuns) -> Iterator[Claim]:
    seen = readings.of("forward_velocity")
    missed = {name: (readings.of("modelled_forward_velocity", name) - seen)[readings.known] for name in INFERRED_BY}
    errors: dict[str, Values] = {name: np.sqrt(_of_tails(np.ma.mean, miss**2)) for name, miss in missed.items()}
    words = ", ".join(f"{label(name)} {_range(error, ' mm/s', 1e3)}" for name, error in errors.items())
    yield readings.claim("sbt_better", f"{words} root mean square", (errors["rft"] - errors["sbt"])[None])
    factors = readings.of("body_drag_factor", "sbt")
    for number, (channel, stated) in enumerate(BODY_DRAG_FACTORS.items()):
        of_tails = factors[number][readings.known[number]]
        if of_tails.size:
            found = f"{_range(of_tails, '')} by inverting (15) with SBT's tail at the speeds and rates of the readings"
            judgement = readings.compare(_of_tails(np.ma.median, of_tails), stated, "", 1.0)
            yield claim_of("wall_factor", found, *judgement, channel=channel, factor=stated)


def _contact(readings: FrictionModelRuns) -> Iterator[Claim]:
    share = readings.of("contact_share")
    words = f"asperities touch for {_range(share, ' %', 100.0)} of the time"
    yield readings.claim("contact", words, np.minimum(share, 1.0 - share))


def claims_of_study(dataset: xr.Dataset) -> list[Claim]:
    """Compare a study that names this paper with its statements; empty for one of other channels."""
    if not _of_this_paper(dataset):
        return []
    evidence = Evidence(dataset)
    sources: tuple[Callable[[Evidence], Iterator[Claim]], ...] = (
        claims_swimming.reynolds_numbers,
        claims_swimming.velocity_drops,
        claims_swimming.global_drop,
        claims_swimming.trends,
        claims_swimming.body_rotation,
        claims_swimming.motor_rates,
        claims_swimming.effective_friction,
        claims_swimming.model_comparison,
        calibration_factors,
        robot_and_channel,
        method,
    )
    return [claim for source in sources for claim in source(evidence)]


def predictions_of_study(dataset: xr.Dataset) -> list[Claim]:
    """Evaluate the statements for released robots, verdicts of a third kind; empty without such robots."""
    return predicted(Evidence(dataset)) if _of_this_paper(dataset) else []


def _of_this_paper(dataset: xr.Dataset) -> bool:
    """Whether a study has the paper's channels."""
    if "channel" not in dataset.dims:
        return False
    return {"wide", "narrow"} <= {str(name) for name in dataset["channel"].values}
