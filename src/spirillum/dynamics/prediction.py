"""`spirillum.predict`: steady swimming by any model, with trial and steady motion of a released robot beside it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from spirillum.dynamics.release import InTube, without_resolution
from spirillum.dynamics.trial import TrialRequest
from spirillum.errors import InputError
from spirillum.fitted.fit import FITTED_HELD, FITTED_TRIAL, read_fit
from spirillum.fluid.registry import find_swimmer_model
from spirillum.progress import Progress
from spirillum.robot.load import load
from spirillum.robot.model_options import Resolution
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot, without_reynolds_bound
from spirillum.swimming.intervals import posterior_for_of
from spirillum.swimming.prediction import Prediction, interval_statement, predict_steady, with_posterior_medians
from spirillum.swimming.preparation import AUTO, WALLED, choose_model
from spirillum.units import KINDS, as_given, parse_option


def predict(  # noqa: PLR0913 - the options of the command
    robot: str | Path | Mapping[str, Any] | Robot,
    *,
    model: str = AUTO,
    tail_rate: str | float | None = None,
    friction: str | None = None,
    calibrated: bool = True,
    calibration: str | Path | None = None,
    posterior: str | Path | None = None,
    posterior_for: str = "new",
    resolution: Resolution | Mapping[str, Any] | None = None,
    placement: Placement | Mapping[str, Any] | None = None,
    band: bool | None = None,
    motion: str | None = None,
    roughness: str | float | None = None,
    in_tube: InTube | Mapping[str, Any] | None = None,
    duration: str | float | None = None,
    interval: bool = False,
    beyond_stokes: bool = False,
    progress: Progress | None = None,
) -> Prediction:
    """Predict the steady swimming of one robot; floats are in SI units, rates in rad/s.

    Of a robot in a tube the answer has three columns: held at its pose (the headline), `trial` (released after a
    waiting time, motor on, mean over 20 s, as `spirillum.measure` would give it) and `steady` (what it approaches);
    the last two are computed where they are read. With `motion="held"` it has the first alone.

    With `motion="free"` and the model `tube` the robot is followed in its tube from the placement to its steady motion,
    with weight, film and contact (`spirillum.settle` returns the path). If it reaches none, `steady_state.statement`
    states why. With a DC motor the current follows from (17) at the drive's duty, the effective friction from (18).

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot.
        model: hydrodynamic model, `sbt`, `rft`, `slender`, `tube`; or `auto`: that of the posterior or calibration,
            else `tube` in a channel and `slender` without.
        tail_rate: lab rotation rate of the tail, with its unit (``"1.2 Hz"``) or a float in rad/s; None: the robot's
            drive decides.
        friction: friction model, `none`, `rotor`, `body` or `paper`; None: the robot's own.
        calibrated: apply the robot's calibration factors for this model.
        calibration: calibration file whose values replace the robot's.
        posterior: file of a calibration's posterior, for intervals.
        posterior_for: with a posterior, intervals of a `new` tail, or of this `measured` one.
        resolution: of `slender` and `tube`: `accuracy`, `tolerance`, `phases`; not of free motion in the tube.
        placement: where in the channel the robot lies, or is released.
        band: of `tube`, with the band over unknown gap and pitch, or the reference pose alone; None: with it
            where the robot has a table, without which it takes minutes; not of free motion in the tube.
        motion: `held` (lateral motion and tilt constrained) or `free`; None: `held`, in the tube
            with the columns `trial` and `steady` beside it.
        roughness: of released motion in the tube: height of the asperities, with its unit or a float in m; None: 1e-4
            of the body's radius.
        in_tube: of released motion in the tube: `azimuth` of the start, `friction_coefficient`, and the trial's `wait`,
            see `InTube`.
        duration: of the trial: time with the motor on, over which its values are means, with its unit or a float in s;
            None: 20 s.
        interval: of the trial, the 90 % interval over its unknowns, from 64 runs.
        beyond_stokes: answer at Reynolds numbers above 10 too, where these models are wrong, as the robot's option
            `model.beyond_stokes`.
        progress: called with stage, number done, and total.

    Raises:
        InputError: for wrong input, a robot outside the model's domain, or a free motion that cannot be followed for a
            turn.
    """
    fit = read_fit(calibration, posterior, *([] if model == AUTO else [model]), calibrated=calibrated, answer=None)
    own = load(robot)
    if beyond_stokes:
        own = without_reynolds_bound(own)
    choice = choose_model(model, own, placement=Placement.of(placement), fit=fit)
    whose = posterior_for_of(posterior_for, fit.posterior, own)
    fit, idle = fit.acting_on(fit.central(own), find_swimmer_model(choice.model))
    if motion != "free" or choice.model != WALLED:
        request = TrialRequest(
            own,
            friction=friction,
            calibrated=calibrated,
            fit=fit,
            posterior_for=whose,
            resolution=resolution,
            placement=placement,
            roughness=roughness,
            in_tube=InTube.of(in_tube),
            duration=None if duration is None else parse_option("duration", duration, KINDS["time"]),
            interval=interval,
            progress=progress,
        )
        request.check(choice.model, tail_rate, wanted=motion is None)
        of_trials = fit.posterior is not None and fit.of_trials
        held = predict_steady(
            fit.central(own) if of_trials else own,
            model=choice,
            tail_rate=tail_rate,
            friction=friction,
            calibrated=calibrated,
            fit=replace(fit, posterior=None) if of_trials else fit,
            posterior_for="new" if of_trials else whose,
            resolution=resolution,
            placement=placement,
            band=band,
            motion="held" if motion is None else motion,
            progress=progress,
        )
        held = replace(held, warnings=(*held.warnings, *([FITTED_TRIAL] if of_trials else idle)))
        return request.add_released_motions(held, wanted=motion is None)
    for name, value in (("interval", interval or None), ("duration", duration)):
        if value is not None:
            raise InputError(
                f"{name} = {as_given(value, 's')} with motion 'free'; allowed: without a motion, of the trial"
            )
    own = without_resolution(own, resolution)
    if band:
        raise InputError(
            "band = True with motion 'free' in the tube, where the robot finds its own pose; allowed: motion 'held'"
        )
    from spirillum.dynamics.free_motion import free_motion

    found = free_motion(
        own,
        tail_rate=tail_rate,
        friction=friction,
        fit=fit,
        placement=placement,
        roughness=roughness,
        in_tube=in_tube,
        progress=progress,
    )
    answer = replace(found.prediction, choice=choice)
    if fit.posterior is None:
        return replace(answer, warnings=(*answer.warnings, *idle))
    from spirillum.dynamics.fitted_runs import intervals_of_free_motion

    notes = [FITTED_HELD] if fit.posterior.answer == "held" else []
    intervals = intervals_of_free_motion(found, fit.posterior, posterior_for=whose, progress=progress)
    return replace(
        answer,
        swimming=with_posterior_medians(answer.swimming, intervals) if whose == "measured" else answer.swimming,
        intervals=intervals,
        interval_of=interval_statement(fit.posterior, answer.robot, whose),
        warnings=(*answer.warnings, *notes, *fit.run_warnings(answer.robot, answer.model, answer.friction)),
    )
