"""Swimming in time: six degrees of freedom of the body, the tail's angle and the motor's current; or two of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.dynamics.axial_robot import axial_run
from spirillum.dynamics.fitted_runs import chosen_run, sample_count, with_intervals
from spirillum.dynamics.free_robot import two_links
from spirillum.dynamics.integration import integrate
from spirillum.dynamics.record import dataset_of, free_attributes
from spirillum.dynamics.release import InTube, Release, reach_of, resting_state, turning_rate, without_resolution
from spirillum.dynamics.rotating_field import Field, TurningField, in_tilted_field
from spirillum.dynamics.run_summary import vertical_drift
from spirillum.dynamics.timing import Timing
from spirillum.dynamics.tube_simulation import run_in_tube, table_of_run
from spirillum.errors import InputError
from spirillum.fitted.fit import FITTED_HELD, NO_FIT, Fit, read_fit
from spirillum.fluid.registry import find_swimmer_model
from spirillum.kernels import core
from spirillum.notes import Note, note_attributes, notes_in
from spirillum.progress import Progress
from spirillum.robot.limits import check_stokes_flow, in_stokes_flow, motion_limits
from spirillum.robot.load import load
from spirillum.robot.model_options import Resolution
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot, without_reynolds_bound
from spirillum.swimming.balance import find_friction_model
from spirillum.swimming.motions import check_full, motion_of
from spirillum.swimming.prediction import Prediction, predict_steady
from spirillum.swimming.preparation import AUTO
from spirillum.swimming.scenario import NO_WEIGHT
from spirillum.units import as_given

if TYPE_CHECKING:
    import xarray as xr


def simulate(  # noqa: PLR0913 - the options of the command
    robot: str | Path | Mapping[str, Any] | Robot,
    *,
    model: str = AUTO,
    motion: str | None = None,
    friction: str | None = None,
    calibrated: bool = True,
    calibration: str | Path | None = None,
    posterior: str | Path | None = None,
    draws: int | None = None,
    timing: Timing | Mapping[str, Any] | None = None,
    resolution: Resolution | Mapping[str, Any] | None = None,
    placement: Placement | Mapping[str, Any] | None = None,
    weight: bool = True,
    roughness: str | float | None = None,
    in_tube: InTube | Mapping[str, Any] | None = None,
    field: Field | Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Simulate swimming from rest; floats are in SI units, rates in rad/s.

    A free robot is two rigid links with weight, buoyancy and motor current, in a fluid whose resistance is that of the
    model. With `tube` the walls, film, contact and dry friction are those of the robot's table (`spirillum.prepare`),
    which is made first where there is none; by its defaults such a run is the trial of `spirillum.predict`, whose
    values are the averages while the drive is on. The other models have no walls: films of fluid keep the robot off
    that of its channel.

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot, with a drive.
        model: `rft`, `slender` or `tube`; with `motion="held"` also `sbt`; or `auto`: what the posterior or the
            calibration was fitted with, else `tube` for a robot in a channel and `slender` for one without.
        motion: `free` (six degrees of freedom), or `held`: forward motion and roll alone, for a `dc-motor` or
            `torque-speed` drive. None: `free`, but `held` where a posterior or calibration is of held motion.
        friction: friction model; None: the robot's own.
        calibrated: apply the robot's calibration factors for this model.
        calibration: calibration file whose factors replace the robot's.
        posterior: posterior of a calibration: its median replaces the robot's values, and mean speed and rates
            have 95 % intervals (`..._low`, `..._high`), the model's discrepancy included.
        draws: number of draws of the posterior for the intervals, 20 to 1000, or 0: its median alone; None: 100.
        timing: `turns` or `duration`, `samples_per_turn`, and the remote's `on` or `duty`, see `Timing`; None: three
            turns, of a free robot in a tube 20 s, on throughout.
        resolution: of `slender`, and of `tube` held: `accuracy`, `tolerance`, `phases`; None: the robot's own.
        placement: where the free robot starts: `gap` or `eccentricity`, and `pitch`; a heavy robot whose gap is open
            starts low, at a gap of 1/18 of its radius (0.5 mm for the paper's robot). With `tube`, motion `held`: where
            it is held.
        weight: let weight and buoyancy act on the free robot, if its masses are known.
        roughness: of the wall under the free robot, with its unit or a float in m; None: 1e-4 of the body's radius.
        in_tube: with a free robot and `tube`: `azimuth`, `wait`, `friction_coefficient`, `flow` over time and
            `continued`, see `InTube`; its placement may have yaw, ends and a constant flow, too.
        field: `yaw` and `pitch` of the axis about which the field turns a free robot with a magnet, with their units or
            floats in rad, up to 45 degrees; None: along +x.
        progress: called with stage, number done, and total.

    Returns:
        Dataset over `time`: position, attitude, angles, rates, current, torques, powers, energies; averages over the
        last two thirds of the run, while the drive is on, and while the motion is steady as scalars; settings and
        events in the attributes.

    Raises:
        InputError: for wrong input, a robot outside the model's domain, or a model without all entries.
    """
    fit = read_fit(calibration, posterior, *([] if model == AUTO else [model]), calibrated=calibrated, answer=None)
    return simulate_fitted(
        load(robot),
        fit,
        model=model,
        motion=motion,
        friction=friction,
        calibrated=calibrated,
        draws=draws,
        timing=timing,
        resolution=resolution,
        placement=placement,
        weight=weight,
        roughness=roughness,
        in_tube=in_tube,
        field=field,
        progress=progress,
    )


def simulate_fitted(  # noqa: PLR0913 - the options of `simulate`
    robot: Robot,
    fit: Fit,
    *,
    model: str,
    calibrated: bool,
    motion: str | None = None,
    friction: str | None = None,
    draws: int | None = None,
    timing: Timing | Mapping[str, Any] | None = None,
    resolution: Resolution | Mapping[str, Any] | None = None,
    placement: Placement | Mapping[str, Any] | None = None,
    weight: bool = True,
    roughness: str | float | None = None,
    in_tube: InTube | Mapping[str, Any] | None = None,
    field: Field | Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Simulate a loaded robot with a fit that was read; otherwise as `simulate`."""
    known = fit.posterior
    release, times = Release.of(placement, in_tube, roughness, weight=weight), Timing.of(timing)
    placed, requested = release.placement, release.in_tube
    times.check()
    number = sample_count(draws, known)
    if friction is not None:
        find_friction_model(friction)
    central = robot if known is None else known.central(robot)
    contact = fit.contact()
    choice, motion, notes = chosen_run(model, motion, central, placed, fit)
    model = choice.model
    fit, idle = fit.acting_on(central, find_swimmer_model(model))
    known, notes = fit.posterior, [*notes, *idle]
    held, about = motion_of(motion) == "held", Field.of(field)
    if held and about != Field():
        raise InputError("field with motion 'held', which has no field; allowed: motion 'free'")
    walled = model == "tube" and not held
    fixed = placed if held and find_swimmer_model(model).placed else None
    if held:
        _check_held(placed if fixed is None else Placement(), roughness, fit, weight=weight)
    elif not walled:
        check_full(find_swimmer_model(model))
    _check_in_tube(requested, model, walled=walled, drawn=known is not None)
    if walled:
        without_resolution(robot, resolution)
        release, times = release._replace(in_tube=requested.of_trial(placed)), times.of_trial()

    def run(one: Robot, timing: Timing, tell: Progress | None = None, draw: int | None = None) -> xr.Dataset:
        drawn = known if model == "tube" else None
        there = release.with_contact(contact if drawn is None else drawn.contact(draw))
        there = there if drawn is None else there._replace(placement=drawn.placed(one, placed, draw))
        table = table_of_run(without_resolution(one, resolution), there, tell) if walled else None
        steady = predict_steady(
            one,
            model=model,
            friction=friction,
            calibrated=calibrated,
            fit=fit if known is None else NO_FIT,  # a draw's values stand in its robot
            resolution=resolution,
            placement=there.placement if walled or drawn is not None else fixed,
            band=False,
            progress=tell,
        )
        steady = steady if known is None else replace(steady, fitted_by=fit.name)
        if table is not None:
            return run_in_tube(steady, table, timing, there, about, tell)
        return axial_run(steady, timing) if held else _free_run(steady, timing, release, about, tell)

    dataset = run(central, times, progress)
    if known is not None:
        reading = find_friction_model(central.friction.reading if friction is None else friction)
        notes += [FITTED_HELD] if walled and known.answer == "held" else []
        notes += fit.run_warnings(central, find_swimmer_model(model), reading)
    if known is not None and number:
        same_length = times.model_copy(update={"duration": float(dataset["time"][-1])})
        dataset = with_intervals(
            dataset,
            known,
            central,
            lambda one, draw: run(without_reynolds_bound(one), same_length, draw=draw),
            number,
            progress,
        )
    more = {"model_reason": choice.reason} if choice.reason else {}
    more |= {f"field_{name}": angle for name, angle in about.model_dump(exclude_none=True).items()}
    notes += _along_tilted_axis(dataset, about)
    return dataset.assign_attrs(**note_attributes([*notes, *notes_in(dataset.attrs)]), **more)


def _along_tilted_axis(dataset: xr.Dataset, about: Field) -> list[Note]:
    """A sentence on the speed along the axis of a tilted field; none for one along x."""
    yaw, pitch = about.yaw or 0.0, about.pitch or 0.0
    if not (yaw or pitch):
        return []
    late = dataset.isel(time=slice(dataset.sizes["time"] // 3, None))
    way = late["position"].values[-1] - late["position"].values[0]
    axis = TurningField(rotation_rate=0.0, strength=0.0, yaw=yaw, pitch=pitch).axis
    speed = 1e3 * float(way @ axis) / float(late["time"][-1] - late["time"][0])
    return [Note.named("along-tilted-axis", yaw=np.degrees(yaw), pitch=np.degrees(pitch), speed=speed)]


def _free_run(
    steady: Prediction, times: Timing, release: Release, field: Field, progress: Progress | None
) -> xr.Dataset:
    """A run with six degrees of freedom, without walls."""
    own = steady.robot.drive.duty if steady.robot.drive is not None else 1.0
    _, time, switches, unused = times.timetable(2.0 * np.pi / turning_rate(steady), own)
    links = in_tilted_field(two_links(steady, release.roughness, weight=release.weight), field)
    start = resting_state(steady.robot, links, release.placement)
    reach = reach_of(steady.robot)
    moments = np.union1d(time, [switch.time for switch in switches])
    run = integrate(links, start, moments, switches, reach, progress).require_completion()
    title = f"Free swimming of {steady.robot.name} (six degrees of freedom)"
    notes = [*steady.warnings, *([Note.named("film-alone")] if steady.robot.channel is not None else [])]
    notes += [*([NO_WEIGHT] if release.weight and not links.weight.any() else []), *unused]
    more = {"wall_gap": run.observed[:, core.SEEN_FILM] + links.roughness} if links.is_walled else {}
    attrs = free_attributes(steady, links, run, reach, title, notes)
    dataset = dataset_of(steady, links, run, switches, more, attrs)
    limits = motion_limits(steady.batch, dataset["velocity"].values, dataset["tail_rotation_rate"].values)
    way = [*vertical_drift(dataset), *check_stokes_flow(steady.batch, limits).values()]
    dataset.attrs |= note_attributes([*way, *notes])
    dataset.attrs["error_estimate"] = in_stokes_flow(dataset.attrs["error_estimate"], *limits)
    return dataset.isel(time=np.isin(run.time, time) | (run.time == run.time[-1]))


def _check_in_tube(requested: InTube, model: str, *, walled: bool, drawn: bool) -> None:
    """Refuse settings of a free run in a tube for any other, and to continue one with draws of a posterior."""
    if not walled and requested != InTube():
        name = next(name for name, value in requested.model_dump().items() if value != getattr(InTube(), name))
        given = "motion 'held'" if model == "tube" else f"model '{model}'"
        raise InputError(f"in_tube.{name} is given with {given}; allowed: only with model 'tube', motion 'free'")
    if drawn and requested.continued is not None:
        raise InputError(
            "in_tube.continued is given together with a posterior, each draw of which moves differently; allowed: "
            "one of them"
        )


def _check_held(placement: Placement, roughness: str | float | None, fit: Fit, *, weight: bool) -> None:
    """Refuse options of free runs."""
    if fit.posterior is not None and fit.of_trials:
        raise InputError(f"motion = 'held' with {fit.name}, which was fitted to trials; allowed: motion 'free'")
    if fit.contact().friction_coefficient:
        raise InputError(
            f"{fit.name} has a friction_coefficient, and motion = 'held' has no dry friction; allowed: model "
            "'tube' with motion 'free'"
        )
    given = [
        *(["a placement is given"] if placement.is_set else []),
        *([f"roughness = {as_given(roughness, 'm')}"] if roughness is not None else []),
        *([] if weight else ["weight = False"]),
    ]
    if given:
        or_walls = ", or model 'tube'" if placement.is_set else ""
        raise InputError(f"{given[0]} with motion = 'held'; allowed: only with motion 'free'{or_walls}")
