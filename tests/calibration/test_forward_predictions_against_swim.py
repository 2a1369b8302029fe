"""Predictions for many draws at once are those of `swim`, robot by robot; interpolation is as good as it says."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import spirillum as sp
from spirillum.calibration.experiment import read_experiment
from spirillum.calibration.forward_models import Forward
from spirillum.calibration.problem import posed
from spirillum.fluid.registry import find_swimmer_model
from spirillum.robot.batch import RobotBatch
from spirillum.robot.load import load
from spirillum.swimming.sampled_resistance import AxialTable, chebyshev_points

VISCOSITY = np.array([3.5])
PRESETS = ["biorob2012-wide", "biorob2012-narrow"]


@pytest.mark.parametrize("model", ["sbt", "rft"])
def test_kinematics_and_motor_are_those_of_swim(made: Callable[..., Path], model: str) -> None:
    experiment = read_experiment(made(), [load(name) for name in PRESETS])
    free = ("body_drag", "body_rotation", "shared_friction", "torque_constant")
    problem = posed(experiment, model, free)
    z = np.random.default_rng(3).normal(size=(3, len(problem.coordinates)))
    predicted, draws = problem.predicted(z), problem.draws(z)
    for draw in range(3):
        for place in (0, 13, 31):
            robot = experiment.robots[place]
            assert robot.motor is not None
            drag, rotation = (float(draws[name][draw, place]) for name in ("body_drag", "body_rotation"))
            factors = robot.calibration[model].model_copy(update={"body_drag": drag, "body_rotation": rotation})
            motor = robot.motor.model_copy(update={"torque_constant": float(draws["torque_constant"][draw, 0])})
            friction = robot.friction.model_copy(update={"effective": float(draws["shared_friction"][draw, 0])})
            changed = {"calibration": {model: factors}, "motor": motor, "friction": friction}
            swum = sp.swim(RobotBatch.of(robot.model_copy(update=changed)), model)
            assert predicted["advance"][draw, place] == pytest.approx(float(swum.advance_per_radian[0]), rel=1e-12)
            turning = swum.body_rotation_rate / swum.tail_rotation_rate
            assert predicted["turning"][draw, place] == pytest.approx(float(turning[0]), rel=1e-11)
            assert predicted["motor_rate"][draw, place] == pytest.approx(float(swum.motor_rotation_rate[0]), rel=1e-9)


def test_coefficients_of_resistive_force_theory_are_factors(made: Callable[..., Path]) -> None:
    plain = [load(name).model_copy(update={"calibration": {}}) for name in PRESETS]
    experiment = read_experiment(made(), plain)
    problem = posed(experiment, "rft", ("normal_factor", "tangential_factor"))
    z = problem.coordinate_of({"normal_factor": np.array(1.4), "tangential_factor": np.array(0.8)})
    options = {"model.rft.normal_factor": 1.4, "model.rft.tangential_factor": 0.8}
    changed = AxialTable.of(
        RobotBatch.of([_with_tail(r, options) for r in experiment.robots]), find_swimmer_model("rft")
    )
    truth = Forward(changed, None, VISCOSITY).predict({})
    found = problem.predicted(z[None])
    assert found["advance"][0] == pytest.approx(truth.advance[0], rel=1e-12)
    assert found["turning"][0] == pytest.approx(truth.turning[0], rel=1e-12)


def _with_tail(robot, options):
    rft = robot.model.rft.model_copy(update={name.rsplit(".", 1)[1]: value for name, value in options.items()})
    return robot.model_copy(update={"model": robot.model.model_copy(update={"rft": rft})})


def test_interpolation_converges_as_fast_as_its_points_say(made: Callable[..., Path]) -> None:
    experiment = read_experiment(made(), [load(name) for name in PRESETS])
    batch, model = RobotBatch.of(experiment.robots), find_swimmer_model("sbt")
    at = {"wire_diameter": np.full((1, 1), 1.13e-3)}
    exact = Forward(AxialTable.of(batch.with_values({"tail.wire_diameter": 1.13e-3}), model), None, VISCOSITY)
    errors = []
    for count in (3, 5, 7):
        table = AxialTable.of(batch, model, wires=chebyshev_points(count, 0.7e-3, 1.4e-3))
        errors.append(Forward(table, None, VISCOSITY).largest_difference(exact, at))
    assert errors[1] < 0.05 * errors[0]
    assert errors[2] < 0.05 * errors[1]
    assert posed(experiment, "sbt", ("body_drag", "wire_diameter")).interpolation_error < 1e-6
