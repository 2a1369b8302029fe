"""Statements of the paper about speeds, rates and friction."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from spirillum.arrays import Values
from spirillum.papers.biorob2012.evidence import (
    BODY_ROTATION_ERROR,
    GLOBAL_DROP,
    LARGEST_REYNOLDS,
    LOW_REYNOLDS,
    NO_RATES,
    Evidence,
    fraction_between,
    in_hertz,
)
from spirillum.papers.biorob2012.published import VELOCITY_DROPS
from spirillum.papers.claim import Claim, Verdict
from spirillum.units import Hz
from spirillum.view.figures.style import label_of_model as label

_EQUAL_RATES = (
    "the paper observed equal motor rates in both channels; with them a tail's loss follows without knowing the rate"
)
_FITTED = "consistency rather than prediction: Table III's factors were fitted to the same data"
_NO_WALLS = "no model of this study has the channel's walls"
_PAPER_DROP = f"{100 * GLOBAL_DROP:.1f} %"


def _no_tail(claim: str, paper: str) -> Claim:
    return Claim(claim, paper, "this study has no such tail", "undecidable", "the tail is not in the study's grid")


def reynolds_numbers(evidence: Evidence) -> Iterator[Claim]:
    """Re_max of the captions of Figs 5 and 6, and the low-Reynolds statement."""
    for channel, (reynolds, wavelength, amplitude, _) in LARGEST_REYNOLDS.items():
        claim = f"Largest Reynolds number, {channel} channel, at lambda = {wavelength:g} mm, B_o = {amplitude:g} mm"
        tail = evidence.tail(wavelength, amplitude)
        if tail is None:
            yield _no_tail(claim, f"{reynolds:g}")
            continue
        if evidence.observed and np.isfinite(evidence.seen("forward_velocity", channel)[tail]):
            yield _observed_reynolds(evidence, claim, channel, tail)
            continue
        speed = evidence.speed_of(reynolds)
        needed, bounds = [], []
        for model in evidence.models:
            advance = evidence.free("advance_per_radian", model, channel)[tail]
            needed.append(f"{label(model)} {in_hertz(speed / advance)}")
            bound = evidence.free("reynolds_number", model, channel)[tail]
            bounds.append(f"{label(model)} {bound / reynolds:.1f}")
        yield Claim(
            claim,
            f"{reynolds:g} (length scale not stated)",
            f"with D_b as length, {1e3 * speed:.2f} mm/s: a tail rate of {', '.join(needed)}; "
            f"the friction-free bound is that times a factor of {', '.join(bounds)}",
            "undecidable",
            f"{NO_RATES}; the length in Re is not stated",
        )
    largest = max(float(np.nanmax(evidence.free("reynolds_number", model))) for model in evidence.models)
    yield Claim(
        "Low Reynolds number conditions",
        f"Re < {LOW_REYNOLDS:g}",
        f"at most {largest:.3f} on the body's diameter, at the friction-free upper bound",
        "agrees" if largest < LOW_REYNOLDS else "undecidable",
        "holds for any rate up to the bound" if largest < LOW_REYNOLDS else NO_RATES,
    )


def _observed_reynolds(evidence: Evidence, claim: str, channel: str, tail: tuple[int, int]) -> Claim:
    reynolds = LARGEST_REYNOLDS[channel].value
    speeds = evidence.seen("forward_velocity", channel)
    found = speeds[tail] / evidence.speed_of(1.0)
    fastest = _place(speeds, int(np.nanargmax(speeds))) == tail
    close = abs(found / reynolds - 1.0) < 0.05
    seen = f"{np.count_nonzero(np.isfinite(speeds))} of {speeds.size}"
    holds = close and fastest
    return Claim(
        claim,
        f"{reynolds:g} (length scale not stated)",
        f"observed {found:.4f} on the body's diameter; {'the' if fastest else 'not the'} fastest of {seen} tails",
        "undecidable" if holds and not np.all(np.isfinite(speeds)) else "agrees" if holds else "disagrees",
        "observed speed and Table I, within 5 %; a largest value needs all tails of the channel",
    )


def velocity_drops(evidence: Evidence) -> Iterator[Claim]:
    """Smallest and largest loss of speed from the wide to the narrow channel."""
    for which, (drop, wavelength, amplitude) in VELOCITY_DROPS.items():
        claim = f"The {which} velocity decrease, wide to narrow, at lambda = {wavelength:g} mm, B_o = {amplitude:g} mm"
        paper = f"{drop:g} mm/s"
        tail = evidence.tail(wavelength, amplitude)
        if tail is None:
            yield _no_tail(claim, paper)
            continue
        if evidence.complete("forward_velocity"):
            drops = evidence.seen("forward_velocity", "wide") - evidence.seen("forward_velocity", "narrow")
            extreme = np.argmin(drops) if which == "lowest" else np.argmax(drops)
            there = _place(drops, int(extreme)) == tail
            found = 1e3 * float(drops[tail])
            yield Claim(
                claim,
                paper,
                f"observed {found:.3f} mm/s; {'the' if there else 'not the'} {which} of all tails",
                "agrees" if there and abs(found / drop - 1.0) < 0.05 else "disagrees",
                "observed speeds, within 5 %",
            )
            continue
        losses = {model: evidence.drop_per_motor_turn(model)[tail] for model in evidence.confined}
        if not losses:
            yield Claim(claim, paper, "not computed", "undecidable", _NO_WALLS)
            continue
        words = ", ".join(
            f"{label(model)} {100 * loss:.1f} % (then {drop / loss:.2f} mm/s wide)" for model, loss in losses.items()
        )
        open_reason = evidence.lacking("forward_velocity")
        yield Claim(claim, paper, f"loss at equal motor rates {words}", "undecidable", open_reason)


def global_drop(evidence: Evidence) -> Iterator[Claim]:
    """Loss of the global mean velocity, bounded for any rates."""
    claim = "Decrease of the global average velocity of all body-tail assemblies, wide to narrow"
    if evidence.complete("forward_velocity"):
        wide, narrow = evidence.seen("forward_velocity")
        loss = 1.0 - narrow.sum() / wide.sum()
        yield Claim(
            claim,
            _PAPER_DROP,
            f"observed {100 * loss:.1f} % over {wide.size} tails",
            "agrees" if abs(loss - GLOBAL_DROP) < 0.005 else "disagrees",
            "observed speeds, within 0.5 points",
        )
    for model in evidence.confined:
        yield _computed_drop(evidence, model, f"{claim}, by {label(model)}")
    if evidence.complete("forward_velocity"):
        wide, narrow = evidence.seen("forward_velocity")
        slower = f"observed of {np.count_nonzero(narrow < wide)} of {wide.size} tails"
        yield Claim(
            "Robots travel slower in the narrow channel", "all tails", slower, _always(wide - narrow), "observed"
        )
        return
    claim = "Robots travel slower in the narrow channel"
    if not evidence.confined:
        yield Claim(claim, "all tails", "not computed", "undecidable", _NO_WALLS)
        return
    drops = {model: _widest_drops(evidence, model) for model in evidence.confined}
    fitted = [label(model) for model in evidence.confined if model not in evidence.computed]
    yield Claim(
        claim,
        "all tails",
        ", ".join(f"{label(model)} {fraction_between(found)} slower" for model, found in drops.items()),
        "agrees" if all(np.nanmin(found) > 0 for found in drops.values()) else "disagrees",
        f"{_EQUAL_RATES}; {', '.join(fitted)}: {_FITTED}" if fitted else _EQUAL_RATES,
    )


def _widest_drops(evidence: Evidence, model: str) -> Values:
    """Losses at equal motor rates, over the band where there is one."""
    band = evidence.drops_of_the_band(model)
    return evidence.drop_per_motor_turn(model) if band is None else band


def _computed_drop(evidence: Evidence, model: str, claim: str) -> Claim:
    """The loss of the global mean as a model has it: a weighted mean of the losses of single tails."""
    losses = evidence.drop_per_motor_turn(model)
    words = f"{fraction_between(losses)} for single tails, so any weighted mean of them"
    if model not in evidence.computed:
        verdict = _holds_for_any_weights(losses)
        return Claim(claim, _PAPER_DROP, words, verdict, f"{_EQUAL_RATES}; {_FITTED}")
    band = evidence.drops_of_the_band(model)
    words = f"{words} ({evidence.pose})"
    nothing = "no factor is fitted: the walls are computed"
    if band is None:
        why = f"{nothing}, at one assumed pose of many: the paper does not report gap and pitch"
        return Claim(claim, _PAPER_DROP, words, "undecidable", f"{_EQUAL_RATES}; {why}")
    words = f"{words}; over the band, at the same gap and pitch in both channels, {fraction_between(band)}"
    why = f"{nothing}, over a band, for the paper does not report gap and pitch"
    return Claim(claim, _PAPER_DROP, words, _holds_for_any_weights(band), f"{_EQUAL_RATES}; {why}")


def _holds_for_any_weights(losses: Values) -> Verdict:
    """Whether the paper's loss is a weighted mean of these: never, or so nearly that the weights do not matter."""
    low, high = float(np.nanmin(losses)), float(np.nanmax(losses))
    if not low <= GLOBAL_DROP <= high:
        return "disagrees"
    return "agrees" if max(GLOBAL_DROP - low, high - GLOBAL_DROP) < 0.02 else "undecidable"


def trends(evidence: Evidence) -> Iterator[Claim]:
    """Dependence of speed and load on wavelength and amplitude."""
    for claim, axis, sign, variable in (
        ("Forward velocity increases with wavelength", 1, 1.0, "wavelength"),
        ("Forward velocity decreases with amplitude, except at lambda = 25 mm", 2, -1.0, "amplitude"),
    ):
        if evidence.complete("forward_velocity"):
            speeds = evidence.seen("forward_velocity")
            kept = speeds[:, :-1] if variable == "amplitude" else speeds
            steps = sign * np.diff(kept, axis=axis)
            share = f"{np.count_nonzero(steps > 0)} of {steps.size} steps"
            yield Claim(claim, "trend", f"observed in {share}", _always(steps), "observed speeds")
            continue
        words = ", ".join(
            f"{label(model)} {_share(sign * np.diff(evidence.free('forward_velocity', model), axis=axis))}"
            for model in evidence.models
        )
        yield Claim(
            claim,
            "trend",
            f"at the friction-free bound in {words} steps of the grid",
            "undecidable",
            f"speed is advance per turn times a rate that fell with the load; {evidence.lacking('forward_velocity')}",
        )
    loads = {
        m: evidence.free("tail_torque", m) / np.abs(evidence.free("tail_rotation_rate", m)) for m in evidence.models
    }
    rising = [np.diff(load, axis=2) for load in loads.values()]
    yield Claim(
        "The hydrodynamic torque increases with amplitude",
        "trend",
        ", ".join(
            f"{label(m)}: torque per rate rises in {_share(np.diff(load, axis=2))} steps" for m, load in loads.items()
        ),
        _always(np.concatenate([steps.ravel() for steps in rising])),
        "torque per rate does not depend on the rate",
    )


def _place(values: Values, flat: int) -> tuple[int, int]:
    row, column = divmod(flat, values.shape[1])
    return row, column


def _share(steps: Values) -> str:
    return f"{np.count_nonzero(steps > 0)} of {steps.size}"


def _always(steps: Values) -> Verdict:
    """Whether a trend is satisfied in every step of the grid; undecided for a grid without steps."""
    if steps.size == 0:
        return "undecidable"
    return "agrees" if bool(np.all(steps > 0)) else "disagrees"


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
    claim = "Body rotation rates are of the order of 1e-2 to 1e-1"
    if evidence.complete("body_rate"):
        seen = np.abs(evidence.seen("body_rate")) / Hz
        inside = np.nanmin(seen) > 10**-2.5 and np.nanmax(seen) < 10**-0.5
        words = f"observed {np.nanmin(seen):.3f} to {np.nanmax(seen):.3f} Hz"
        yield Claim(
            claim, "1e-2 to 1e-1 (unit not stated)", words, "agrees" if inside else "disagrees", "observed rates"
        )
    elif rates:
        yield Claim(
            claim,
            "1e-2 to 1e-1 (unit not stated)",
            f"{min(rates):.3f} to {max(rates):.3f} Hz for the two tails of Re_max at the speed that Re_max implies",
            "undecidable",
            f"unit and the length in Re are not stated; {evidence.lacking('body_rate')}",
        )
    yield _rotation_errors(evidence)


def _rotation_errors(evidence: Evidence) -> Claim:
    claim, paper = "SBT and RFT predict body rotation rates within 1 to 50 %, RFT with the large errors", "1 to 50 %"
    if not evidence.complete("body_rate", "tail_rate"):
        return Claim(claim, paper, "not computed", "undecidable", evidence.lacking("body_rate", "tail_rate"))
    seen = evidence.seen("body_rate")
    worst = {}
    for model in evidence.models:
        found = _at_observed(evidence, "body_rotation_rate", model)
        worst[model] = float(np.nanmax(np.abs(found / seen - 1.0)))
    words = ", ".join(f"{label(model)} up to {100 * error:.0f} %" for model, error in worst.items())
    verdict: Verdict = "agrees" if max(worst.values()) <= BODY_ROTATION_ERROR else "disagrees"
    return Claim(claim, paper, words, verdict, "models at the observed tail rates, friction model 'rotor' or the first")


def _at_observed(evidence: Evidence, name: str, model: str) -> Values:
    readings = [str(reading) for reading in evidence.dataset["friction"].values]
    reading = "rotor" if "rotor" in readings else readings[0]
    chosen = evidence.dataset[f"{name}_at_observed_rate"].sel(model=model, friction=reading, channel=["wide", "narrow"])
    values: Values = chosen.values
    return values


def motor_rates(evidence: Evidence) -> Iterator[Claim]:
    """Motor rates: equal in both channels, falling with amplitude, rising with wavelength."""
    observed = evidence.complete("motor_rate")
    rates = (
        {"observed": evidence.seen("motor_rate")}
        if observed
        else {label(model): evidence.free("motor_rotation_rate", model) for model in evidence.models}
    )
    how = "" if observed else "at equal friction "
    reason = (
        "observed rates"
        if observed
        else f"the paper found other friction for other amplitudes and channels; {evidence.lacking('motor_rate')}"
    )

    def verdict(holds: bool) -> Verdict:  # noqa: FBT001 - a truth value is what it turns into words
        return ("agrees" if holds else "disagrees") if observed else "undecidable"

    apart = {name: float(np.nanmax(np.abs(found[1] / found[0] - 1.0))) for name, found in rates.items()}
    yield Claim(
        "Motor rates are identical in wide and narrow channel",
        "identical",
        f"{how}they differ by at most {', '.join(f'{name} {100 * value:.1f} %' for name, value in apart.items())}",
        verdict(max(apart.values()) < 0.05),
        f"{reason}, within 5 %" if observed else reason,
    )
    for claim, axis, sign in (
        ("The motor's rate decreases with amplitude", 2, -1.0),
        ("The motor's rate increases with wavelength", 1, 1.0),
    ):
        steps = {name: sign * np.diff(found, axis=axis) for name, found in rates.items()}
        shares = ", ".join(f"{name} {_share(step)}" for name, step in steps.items())
        always = all(bool(np.all(step > 0)) for step in steps.values())
        yield Claim(claim, "trend", f"{how}in {shares} steps of the grid", verdict(always), reason)
    rises = [np.diff(found, axis=1) for found in rates.values()]
    if rises[0].shape[1] > 1:
        saturates = all(bool(np.all(np.diff(rise, axis=1) < 0)) for rise in rises)
        words = "each further wavelength adds less" if saturates else "some steps add more than the one before"
        yield Claim(
            "The motor's rate saturates as the wavelength increases", "trend", how + words, verdict(saturates), reason
        )


def effective_friction(evidence: Evidence) -> Iterator[Claim]:
    """B_eff depends on the amplitude, and exceeds the rotor's own friction."""
    claim = "B_eff depends mostly on the amplitude instead of the wavelength"
    if not evidence.complete("tail_rate"):
        curve = "a curve against the assumed motor rate only"
        yield Claim(claim, "trend", curve, "undecidable", evidence.lacking("tail_rate"))
        return
    model = "rft" if "rft" in evidence.models else evidence.models[0]
    found = _at_observed(evidence, "effective_friction", model)
    by_wavelength = float(np.nanstd(np.nanmean(found, axis=2), axis=1).mean())
    by_amplitude = float(np.nanstd(np.nanmean(found, axis=1), axis=1).mean())
    yield Claim(
        claim,
        "trend",
        f"spread over amplitudes {by_amplitude:.2g}, over wavelengths {by_wavelength:.2g} N m s/rad ({label(model)})",
        "agrees" if by_amplitude > by_wavelength else "disagrees",
        "(18) at the observed rates",
    )
    smallest = float(np.nanmin(found))
    rotor = evidence.robot.motor.joint_rotor_friction if evidence.robot.motor else np.nan
    yield Claim(
        "Friction is dominated by the body-channel interaction, not by the rotor",
        "B_eff well above B_m",
        f"smallest B_eff {smallest:.2g} N m s/rad, {smallest / rotor:.0f} times B_m",
        "agrees" if smallest > 3.0 * rotor else "disagrees",
        "(18) at the observed rates",
    )


def model_comparison(evidence: Evidence) -> Iterator[Claim]:
    """SBT or RFT."""
    claim = "SBT predicts forward velocities better than RFT"
    if not {"sbt", "rft"} <= set(evidence.models) or not evidence.complete("forward_velocity", "tail_rate"):
        missing = evidence.lacking("forward_velocity", "tail_rate")
        yield Claim(claim, "SBT in better agreement", "not computed", "undecidable", missing)
        return
    seen = evidence.seen("forward_velocity")
    errors = {
        model: float(np.sqrt(np.nanmean((_at_observed(evidence, "forward_velocity", model) - seen) ** 2)))
        for model in ("sbt", "rft")
    }
    yield Claim(
        claim,
        "SBT in better agreement",
        ", ".join(f"{label(model)} {1e3 * error:.3g} mm/s" for model, error in errors.items()) + " root mean square",
        "agrees" if errors["sbt"] < errors["rft"] else "disagrees",
        "models at the observed tail rates",
    )
