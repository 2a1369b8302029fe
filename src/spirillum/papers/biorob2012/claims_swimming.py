"""Statements of the paper about speeds, rates and friction."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from spirillum.arrays import Values
from spirillum.display import label_of_model as label
from spirillum.papers.biorob2012.evidence import (
    BODY_ROTATION_ERROR,
    GLOBAL_DROP,
    LARGEST_REYNOLDS,
    LOW_REYNOLDS,
    NO_RATES,
    Evidence,
    claim_of,
    fraction_between,
    verdict_of,
)
from spirillum.papers.biorob2012.published import VELOCITY_DROPS
from spirillum.papers.claim import Claim, Verdict
from spirillum.units import Hz

_EQUAL_RATES = (
    "the paper observed equal motor rates in both channels; with them a tail's loss follows without knowing the rate"
)
_FITTED = "consistency rather than prediction: Table III's factors were fitted to the same data"
_NO_SCALE = " (length scale not stated)"
_NO_WALLS = "no model of this study has the channel's walls"
_NO_TAIL: tuple[str, Verdict, str] = (
    "this study has no such tail",
    "undecidable",
    "the tail is not in the study's grid",
)


def reynolds_numbers(evidence: Evidence) -> Iterator[Claim]:
    """Re_max of the captions of Figs 5 and 6, and the low-Reynolds statement."""
    for channel, (reynolds, wavelength, amplitude, _) in LARGEST_REYNOLDS.items():
        numbers: dict[str, Any] = {"wavelength": wavelength, "amplitude": amplitude, "reynolds": reynolds}
        tail = evidence.tail(wavelength, amplitude)
        if tail is None:
            yield claim_of("largest_reynolds", *_NO_TAIL, **numbers, channel=channel, scale="")
            continue
        if evidence.observed and np.isfinite(evidence.observation("forward_velocity", channel)[tail]):
            observed = _observed_reynolds(evidence, channel, tail)
            yield claim_of("largest_reynolds", *observed, **numbers, channel=channel, scale=_NO_SCALE)
            continue
        speed = evidence.speed_of(reynolds)
        needed, bounds = [], []
        for model in evidence.models:
            advance = evidence.free("advance_per_radian", model, channel)[tail]
            needed.append(f"{label(model)} {speed / advance / Hz:.3g} Hz")
            bound = evidence.free("reynolds_number", model, channel)[tail]
            bounds.append(f"{label(model)} {bound / reynolds:.1f}")
        yield claim_of(
            "largest_reynolds",
            f"with D_b as length, {1e3 * speed:.2f} mm/s: a tail rate of {', '.join(needed)}; "
            f"the friction-free bound is that times a factor of {', '.join(bounds)}",
            "undecidable",
            f"{NO_RATES}; the length in Re is not stated",
            **numbers,
            channel=channel,
            scale=_NO_SCALE,
        )
    largest = max(float(np.nanmax(evidence.free("reynolds_number", model))) for model in evidence.models)
    yield claim_of(
        "low_reynolds",
        f"at most {largest:.3f} on the body's diameter, at the friction-free upper bound",
        "agrees" if largest < LOW_REYNOLDS else "undecidable",
        "holds for any rate up to the bound" if largest < LOW_REYNOLDS else NO_RATES,
        limit=LOW_REYNOLDS,
    )


def _observed_reynolds(evidence: Evidence, channel: str, tail: tuple[int, int]) -> tuple[str, Verdict, str]:
    reynolds = LARGEST_REYNOLDS[channel].value
    speeds = evidence.observation("forward_velocity", channel)
    found = speeds[tail] / evidence.speed_of(1.0)
    fastest = int(np.nanargmax(speeds)) == np.ravel_multi_index(tail, speeds.shape)
    close = abs(found / reynolds - 1.0) < 0.05
    seen = f"{np.count_nonzero(np.isfinite(speeds))} of {speeds.size}"
    holds = close and fastest
    return (
        f"observed {found:.4f} on the body's diameter; {'the' if fastest else 'not the'} fastest of {seen} tails",
        "undecidable" if holds and not np.all(np.isfinite(speeds)) else "agrees" if holds else "disagrees",
        "observed speed and Table I, within 5 %; a largest value needs all tails of the channel",
    )


def velocity_drops(evidence: Evidence) -> Iterator[Claim]:
    """Smallest and largest loss of speed from the wide to the narrow channel."""
    for which, (drop, wavelength, amplitude) in VELOCITY_DROPS.items():
        numbers: dict[str, Any] = {"wavelength": wavelength, "amplitude": amplitude, "drop": drop}
        tail = evidence.tail(wavelength, amplitude)
        if tail is None:
            yield claim_of("decrease", *_NO_TAIL, which=which, **numbers)
            continue
        if evidence.complete("forward_velocity"):
            wide, narrow = (evidence.observation("forward_velocity", channel) for channel in ("wide", "narrow"))
            drops = wide - narrow
            extreme = np.argmin(drops) if which == "lowest" else np.argmax(drops)
            there = int(extreme) == np.ravel_multi_index(tail, drops.shape)
            found = 1e3 * float(drops[tail])
            words = f"observed {found:.3f} mm/s; {'the' if there else 'not the'} {which} of all tails"
            verdict = verdict_of(there and abs(found / drop - 1.0) < 0.05)
            yield claim_of("decrease", words, verdict, "observed speeds, within 5 %", which=which, **numbers)
            continue
        losses = {model: evidence.drop_per_motor_turn(model)[tail] for model in evidence.confined}
        words = ", ".join(
            f"{label(model)} {100 * loss:.1f} % (then {drop / loss:.2f} mm/s wide)" for model, loss in losses.items()
        )
        words, why = f"loss at equal motor rates {words}", evidence.lacking("forward_velocity")
        words, why = (words, why) if losses else ("not computed", _NO_WALLS)
        yield claim_of("decrease", words, "undecidable", why, which=which, **numbers)


def global_drop(evidence: Evidence) -> Iterator[Claim]:
    """Loss of the global mean velocity, bounded for any rates."""
    drop = 100 * GLOBAL_DROP
    if evidence.complete("forward_velocity"):
        wide, narrow = evidence.observation("forward_velocity")
        loss = 1.0 - narrow.sum() / wide.sum()
        words = f"observed {100 * loss:.1f} % over {wide.size} tails"
        verdict = verdict_of(abs(loss - GLOBAL_DROP) < 0.005)
        yield claim_of("global_drop", words, verdict, "observed speeds, within 0.5 points", by="", drop=drop)
    for model in evidence.confined:
        yield claim_of("global_drop", *_computed_drop(evidence, model), by=f", by {label(model)}", drop=drop)
    if evidence.complete("forward_velocity"):
        wide, narrow = evidence.observation("forward_velocity")
        slower = f"observed of {np.count_nonzero(narrow < wide)} of {wide.size} tails"
        yield claim_of("slower", slower, _always(wide - narrow), "observed")
        return
    if not evidence.confined:
        yield claim_of("slower", "not computed", "undecidable", _NO_WALLS)
        return
    # Over the band where there is one.
    bands = {model: evidence.drops_of_the_band(model) for model in evidence.confined}
    drops = {model: evidence.drop_per_motor_turn(model) if band is None else band for model, band in bands.items()}
    fitted = [label(model) for model in evidence.confined if model not in evidence.computed]
    yield claim_of(
        "slower",
        ", ".join(f"{label(model)} {fraction_between(found)} slower" for model, found in drops.items()),
        verdict_of(all(np.nanmin(found) > 0 for found in drops.values())),
        f"{_EQUAL_RATES}; {', '.join(fitted)}: {_FITTED}" if fitted else _EQUAL_RATES,
    )


def _computed_drop(evidence: Evidence, model: str) -> tuple[str, Verdict, str]:
    """The loss of the global mean as a model has it: a weighted mean of the losses of single tails."""
    losses = evidence.drop_per_motor_turn(model)
    words = f"{fraction_between(losses)} for single tails, so any weighted mean of them"
    if model not in evidence.computed:
        return words, _holds_for_any_weights(losses), f"{_EQUAL_RATES}; {_FITTED}"
    band = evidence.drops_of_the_band(model)
    words = f"{words} ({evidence.pose})"
    nothing = "no factor is fitted: the walls are computed"
    if band is None:
        why = f"{nothing}, at one assumed pose of many: the paper does not report gap and pitch"
        return words, "undecidable", f"{_EQUAL_RATES}; {why}"
    words = f"{words}; over the band, at the same gap and pitch in both channels, {fraction_between(band)}"
    why = f"{nothing}, over a band, for the paper does not report gap and pitch"
    return words, _holds_for_any_weights(band), f"{_EQUAL_RATES}; {why}"


def _holds_for_any_weights(losses: Values) -> Verdict:
    """Whether the paper's loss is a weighted mean of these: never, or so nearly that the weights do not matter."""
    low, high = float(np.nanmin(losses)), float(np.nanmax(losses))
    if not low <= GLOBAL_DROP <= high:
        return "disagrees"
    return "agrees" if max(GLOBAL_DROP - low, high - GLOBAL_DROP) < 0.02 else "undecidable"


def trends(evidence: Evidence) -> Iterator[Claim]:
    """Dependence of speed and load on wavelength and amplitude."""
    for variable, axis, sign in (("wavelength", 1, 1.0), ("amplitude", 2, -1.0)):
        if evidence.complete("forward_velocity"):
            speeds = evidence.observation("forward_velocity")
            kept = speeds[:, :-1] if variable == "amplitude" else speeds
            steps = sign * np.diff(kept, axis=axis)
            share = f"{np.count_nonzero(steps > 0)} of {steps.size} steps"
            yield claim_of(f"speed_{variable}", f"observed in {share}", _always(steps), "observed speeds")
            continue
        words = ", ".join(
            f"{label(model)} {_share(sign * np.diff(evidence.free('forward_velocity', model), axis=axis))}"
            for model in evidence.models
        )
        yield claim_of(
            f"speed_{variable}",
            f"at the friction-free bound in {words} steps of the grid",
            "undecidable",
            f"speed is advance per turn times a rate that fell with the load; {evidence.lacking('forward_velocity')}",
        )
    loads = {
        m: evidence.free("tail_torque", m) / np.abs(evidence.free("tail_rotation_rate", m)) for m in evidence.models
    }
    rising = {m: np.diff(load, axis=2) for m, load in loads.items()}
    words = ", ".join(f"{label(m)}: torque per rate rises in {_share(steps)} steps" for m, steps in rising.items())
    always = _always(np.concatenate([steps.ravel() for steps in rising.values()]))
    yield claim_of("torque_amplitude", words, always, "torque per rate does not depend on the rate")


def _share(steps: Values) -> str:
    return f"{np.count_nonzero(steps > 0)} of {steps.size}"


def _always(steps: Values) -> Verdict:
    """Whether a trend is satisfied in every step of the grid; undecided for a grid without steps."""
    if steps.size == 0:
        return "undecidable"
    return verdict_of(bool(np.all(steps > 0)))


def body_rotation(evidence: Evidence) -> Iterator[Claim]:
    """Order of the body's rate, and how well the models predict it."""
    rates = []
    for channel, (reynolds, wavelength, amplitude, _) in LARGEST_REYNOLDS.items():
        tail = evidence.tail(wavelength, amplitude)
        if tail is None:
            continue
        for model in evidence.models:
            body = evidence.free("body_rotation_rate", model, channel)[tail]
            speed = evidence.free("forward_velocity", model, channel)[tail]
            rates.append(abs(body / speed * evidence.speed_of(reynolds)) / Hz)
    if evidence.complete("body_rate"):
        seen = np.abs(evidence.observation("body_rate")) / Hz
        inside = np.nanmin(seen) > 10**-2.5 and np.nanmax(seen) < 10**-0.5
        words = f"observed {np.nanmin(seen):.3f} to {np.nanmax(seen):.3f} Hz"
        yield claim_of("body_rates", words, verdict_of(bool(inside)), "observed rates")
    elif rates:
        yield claim_of(
            "body_rates",
            f"{min(rates):.3f} to {max(rates):.3f} Hz for the two tails of Re_max at the speed that Re_max implies",
            "undecidable",
            f"unit and the length in Re are not stated; {evidence.lacking('body_rate')}",
        )
    yield _rotation_errors(evidence)


def _rotation_errors(evidence: Evidence) -> Claim:
    if not evidence.complete("body_rate", "tail_rate"):
        missing = evidence.lacking("body_rate", "tail_rate")
        return claim_of("body_rate_errors", "not computed", "undecidable", missing)
    seen = evidence.observation("body_rate")
    worst = {}
    for model in evidence.models:
        found = _at_observed(evidence, "body_rotation_rate", model)
        worst[model] = float(np.nanmax(np.abs(found / seen - 1.0)))
    words = ", ".join(f"{label(model)} up to {100 * error:.0f} %" for model, error in worst.items())
    how = "models at the observed tail rates, friction model 'rotor' or the first"
    return claim_of("body_rate_errors", words, verdict_of(max(worst.values()) <= BODY_ROTATION_ERROR), how)


def _at_observed(evidence: Evidence, name: str, model: str) -> Values:
    readings = [str(reading) for reading in evidence.dataset["friction"].values]
    reading = "rotor" if "rotor" in readings else readings[0]
    chosen = evidence.dataset[f"{name}_at_observed_rate"].sel(model=model, friction=reading, channel=["wide", "narrow"])
    return chosen.values


def motor_rates(evidence: Evidence) -> Iterator[Claim]:
    """Motor rates: equal in both channels, falling with amplitude, rising with wavelength."""
    if observed := evidence.complete("motor_rate"):
        rates, how, reason = {"observed": evidence.observation("motor_rate")}, "", "observed rates"
    else:
        rates, how = {label(m): evidence.free("motor_rotation_rate", m) for m in evidence.models}, "at equal friction "
        other = "the paper found other friction for other amplitudes and channels"
        reason = f"{other}; {evidence.lacking('motor_rate')}"

    def verdict(holds: bool) -> Verdict:  # noqa: FBT001 - a truth value is what it turns into words
        return verdict_of(holds) if observed else "undecidable"

    apart = {name: float(np.nanmax(np.abs(found[1] / found[0] - 1.0))) for name, found in rates.items()}
    yield claim_of(
        "motor_equal",
        f"{how}they differ by at most {', '.join(f'{name} {100 * value:.1f} %' for name, value in apart.items())}",
        verdict(max(apart.values()) < 0.05),
        f"{reason}, within 5 %" if observed else reason,
    )
    for variable, axis, sign in (("amplitude", 2, -1.0), ("wavelength", 1, 1.0)):
        steps = {name: sign * np.diff(found, axis=axis) for name, found in rates.items()}
        shares = ", ".join(f"{name} {_share(step)}" for name, step in steps.items())
        always = all(bool(np.all(step > 0)) for step in steps.values())
        yield claim_of(f"motor_{variable}", f"{how}in {shares} steps of the grid", verdict(always), reason)
    rises = [np.diff(found, axis=1) for found in rates.values()]
    if rises[0].shape[1] > 1:
        saturates = all(bool(np.all(np.diff(rise, axis=1) < 0)) for rise in rises)
        words = "each further wavelength adds less" if saturates else "some steps add more than the one before"
        yield claim_of("motor_saturates", how + words, verdict(saturates), reason)


def effective_friction(evidence: Evidence) -> Iterator[Claim]:
    """B_eff depends on the amplitude, and exceeds the rotor's own friction."""
    if not evidence.complete("tail_rate"):
        curve = "a curve against the assumed motor rate only"
        yield claim_of("friction_amplitude", curve, "undecidable", evidence.lacking("tail_rate"))
        return
    model = "rft" if "rft" in evidence.models else evidence.models[0]
    found = _at_observed(evidence, "effective_friction", model)
    by_wavelength = float(np.nanstd(np.nanmean(found, axis=2), axis=1).mean())
    by_amplitude = float(np.nanstd(np.nanmean(found, axis=1), axis=1).mean())
    yield claim_of(
        "friction_amplitude",
        f"spread over amplitudes {by_amplitude:.2g}, over wavelengths {by_wavelength:.2g} N m s/rad ({label(model)})",
        verdict_of(by_amplitude > by_wavelength),
        "(18) at the observed rates",
    )
    smallest = float(np.nanmin(found))
    rotor = evidence.robot.motor.joint_rotor_friction if evidence.robot.motor else np.nan
    yield claim_of(
        "friction_body",
        f"smallest B_eff {smallest:.2g} N m s/rad, {smallest / rotor:.0f} times B_m",
        verdict_of(smallest > 3.0 * rotor),
        "(18) at the observed rates",
    )


def model_comparison(evidence: Evidence) -> Iterator[Claim]:
    """SBT or RFT."""
    if not {"sbt", "rft"} <= set(evidence.models) or not evidence.complete("forward_velocity", "tail_rate"):
        missing = evidence.lacking("forward_velocity", "tail_rate")
        yield claim_of("sbt_better", "not computed", "undecidable", missing)
        return
    seen = evidence.observation("forward_velocity")
    errors = {
        model: float(np.sqrt(np.nanmean((_at_observed(evidence, "forward_velocity", model) - seen) ** 2)))
        for model in ("sbt", "rft")
    }
    words = ", ".join(f"{label(model)} {1e3 * error:.3g} mm/s" for model, error in errors.items())
    better = verdict_of(errors["sbt"] < errors["rft"])
    yield claim_of("sbt_better", f"{words} root mean square", better, "models at the observed tail rates")
