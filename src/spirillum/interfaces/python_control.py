"""The robot in axial motion as a system of python-control with named signals, and linearised at a stated point."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.argument_validation import as_duty
from spirillum.arrays import Samples
from spirillum.display import DisplayMixin
from spirillum.dynamics.axial_robot import INPUTS, STATES, AxialRobot, axial_robot, motion, outputs, rates, slopes
from spirillum.errors import InputError
from spirillum.kernels import core
from spirillum.notes import Note
from spirillum.optional_dependencies import import_optional
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.swimming.preparation import AUTO
from spirillum.units import KINDS, as_given, parse_option

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, repr=False)
class LinearSystem(DisplayMixin):
    """A robot's equations linearised, and where."""

    system: control.StateSpace  #: Of deviations from the point below; signals as in `control_system`.
    inputs: dict[str, float]  #: The point: inputs by name, SI.
    outputs: dict[str, float]
    """The steady rates, current and powers there, by name, SI; path, angles and charge counted from it."""
    time_constant: float  #: Of the motor's current there, s; path, angles and charge only add up.
    warnings: tuple[Note, ...] = ()  #: What to be careful about, a sentence each.


def control_system(
    robot: str | Path | Mapping[str, Any] | Robot,
    *,
    model: str = AUTO,
    friction: str | None = None,
    calibrated: bool = True,
    calibration: str | Path | None = None,
    placement: Placement | Mapping[str, Any] | None = None,
) -> control.NonlinearIOSystem:
    """A robot in axial motion as a system of python-control (extra `control`).

    Inputs are `duty`, 0 (off) to 1, and with an imposed flow `mean_flow`, m/s; states and outputs are quantities of the
    registry by name, SI, rates signed about +x. A duty beyond its range is taken at its end, as the drive does. The
    system's `params` are the robot's numbers, see `axial_robot.PARAMETERS`, and can be changed in a response.

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot, with a `dc-motor` or
            `torque-speed` drive.
        model: a hydrodynamic model, or `auto`.
        friction: friction model; None: the robot's own.
        calibrated: apply the robot's calibration factors for this model.
        calibration: calibration file whose factors replace the robot's.
        placement: where the robot is held, for `tube`; with a `flow`, also 0, the imposed flow is an input.

    Raises:
        InputError: for wrong input, another drive, a motion far outside Stokes flow at full duty, or where
            python-control is not installed; in a response, for an input that is no number.
    """
    library = import_optional("control", "a system of python-control", "control")
    axial = axial_robot(
        robot, model=model, friction=friction, calibrated=calibrated, calibration=calibration, placement=placement
    )
    axial.check_steady(1.0, axial.flow or 0.0)
    places = list(axial.outputs.values())

    def whole(x: Samples, u: Samples, params: Mapping[str, float]) -> tuple[Samples, Samples, float, float]:
        """All numbers and states of `PARAMETERS` and `STATES`, and the inputs."""
        (duty, flow), numbers = _inputs_of(u), axial.numbers.copy()
        numbers[-len(params) :] = [params[item.name] for item in axial.parameters]
        if axial.curve is not None:
            x = np.array([axial.steady_current(numbers, duty, flow), *x, 0.0])
        return numbers, x, duty, flow

    def changes(_t: float, x: Samples, u: Samples, params: Mapping[str, float]) -> Samples:
        numbers, x, duty, flow = whole(x, u, params)
        found = rates(numbers, float(x[0]), duty, flow)
        return found[[STATES.index(name) for name in axial.states]]

    def seen(_t: float, x: Samples, u: Samples, params: Mapping[str, float]) -> Samples:
        return np.asarray(outputs(*whole(x, u, params))[places])

    return library.nlsys(
        changes,
        seen,
        name=axial.robot.name,
        inputs=_inputs(axial),
        states=list(axial.states),
        outputs=list(axial.outputs),
        params={item.name: value for item, value in axial.parameters.items()},
    )


def linear_system(
    robot: str | Path | Mapping[str, Any] | Robot,
    *,
    duty: float | None = None,
    flow: str | float | None = None,
    model: str = AUTO,
    friction: str | None = None,
    calibrated: bool = True,
    calibration: str | Path | None = None,
    placement: Placement | Mapping[str, Any] | None = None,
) -> LinearSystem:
    """A robot in axial motion, linearised in closed form where a duty and a flow have become steady.

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot, with a `dc-motor` or
            `torque-speed` drive.
        duty: duty of the point, 0 to 1; None: the drive's own.
        flow: mean flow of the point, with its unit or a float in m/s; None: that of the placement.
        model: a hydrodynamic model, or `auto`.
        friction: friction model; None: the robot's own.
        calibrated: apply the robot's calibration factors for this model.
        calibration: calibration file whose factors replace the robot's.
        placement: where the robot is held, for `tube`; with a `flow`, also 0, the imposed flow is an input.

    Raises:
        InputError: for wrong input, another drive, a flow without one in the placement, or where python-control is not
            installed.
    """
    library = import_optional("control", "a system of python-control", "control")
    axial = axial_robot(
        robot, model=model, friction=friction, calibrated=calibrated, calibration=calibration, placement=placement
    )
    at_duty = axial.duty if duty is None else as_duty(duty)
    if flow is not None and axial.flow is None:
        raise InputError(
            f"flow = {as_given(flow, 'm/s')} without one in the placement; allowed: placement with flow, or no flow"
        )
    at_flow = (axial.flow or 0.0) if flow is None else parse_option("flow", flow, KINDS["velocity"])
    inertia = axial.check_steady(at_duty, at_flow)
    numbers = axial.numbers
    current = axial.steady_current(numbers, at_duty, at_flow)
    a, b, c, d = slopes(numbers, current, at_duty) if axial.curve is None else _slopes_on_curve(axial, at_duty, at_flow)
    inputs = _inputs(axial)
    count = len(inputs)
    system = library.ss(
        a,
        b[:, :count],
        c,
        d[:, :count],
        name=axial.robot.name,
        inputs=inputs,
        states=list(axial.states),
        outputs=list(axial.outputs),
    )
    steady = outputs(numbers, np.array([current, 0.0, 0.0, 0.0, 0.0]), at_duty, at_flow)
    return LinearSystem(
        system=system,
        inputs=dict(zip(inputs, (at_duty, at_flow), strict=False)),
        outputs={name: float(steady[place]) for name, place in axial.outputs.items()},
        time_constant=-1.0 / float(a[0, 0]) if axial.curve is None else 0.0,
        warnings=tuple(dict.fromkeys((*axial.prediction.warnings, *inertia))),
    )


def _inputs(axial: AxialRobot) -> list[str]:
    return [INPUTS[0]] if axial.flow is None else list(INPUTS)


def _inputs_of(u: Samples) -> tuple[float, float]:
    if not np.all(np.isfinite(u)):
        name = INPUTS[int(np.flatnonzero(~np.isfinite(u))[0])]
        raise InputError(f"{name} = {float(u[~np.isfinite(u)][0])}; allowed: a number")
    return min(max(float(u[0]), 0.0), 1.0), float(u[1]) if len(u) > 1 else 0.0


def _slopes_on_curve(axial: AxialRobot, duty: float, flow: float) -> tuple[Samples, Samples, Samples, Samples]:
    """As `slopes`, of a motor with a curve, whose torque follows duty and flow at once."""
    p, torque = axial.numbers, axial.steady_current(axial.numbers, duty, flow)
    per_torque, per_flow = motion(p, 1.0, 0.0), motion(p, 0.0, 1.0)
    _, tail, body = per_torque * torque + per_flow * flow
    sense, curve = p[core.AXIAL_POLARITY], axial.prediction.batch.curve
    assert curve is not None  # noqa: S101 - of such a motor alone
    rate, rates, torques = sense * (tail - body), np.array(curve.rates), np.array(curve.torques)
    piece = int(np.clip(np.searchsorted(rates, rate) - 1, 0, rates.size - 2))
    slope = 0.0 if rate < 0.0 else (torques[piece + 1] - torques[piece]) / (rates[piece + 1] - rates[piece])
    full = torques[piece] + slope * (rate - rates[piece])  # at the duty 1
    left = 1.0 - duty * slope * (per_torque[1] - per_torque[2])
    by_input = np.array([sense * full, duty * slope * (per_flow[1] - per_flow[2])]) / left  # of the torque
    moved = np.outer(per_torque, by_input)
    moved[:, 1] += per_flow
    d = np.vstack([np.zeros((3, 2)), moved, moved[1] - moved[2], by_input])
    return np.zeros((3, 3)), moved, np.eye(len(d), 3), d
