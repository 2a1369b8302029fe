"""A warm motor transient of three turns against rebuilding the tail's matrix at every step.

The baseline does what the paper describes (two to three seconds a simulation): at every evaluation of the
right-hand side it assembles the tail's 6x6 matrix of eq. (12) over at least 100 intervals per wavelength in
a plain Python loop, with NumPy for the 3x3 algebra. Its cost is the measured cost of one such evaluation
times the number of evaluations that the paper's integrator makes.
"""

from __future__ import annotations

import json
import time

import numpy as np

import spirillum as sp
from spirillum.dynamics.axial_robot import RUNGE_KUTTA, AxialRobot
from spirillum.fluid.closed.rft import local_coefficients
from spirillum.papers.biorob2012 import transient
from spirillum.robot.batch import RobotBatch
from spirillum.swimming.prediction import predict_steady

INTERVALS_PER_WAVELENGTH = 100


def rebuilt_tail_matrix(batch: RobotBatch, phase: float) -> np.ndarray:
    """B_t of eq. (12) by the midpoint rule, one interval after the other."""
    c = local_coefficients(batch)
    c_t, c_n = float(c.tangential[0]), float(c.normal[0])
    wavelength, amplitude = float(batch.wavelength[0]), float(batch.amplitude[0])
    length, root, taper = float(batch.tail_length[0]), float(batch.root[0]), float(batch.taper[0])
    k = 2 * np.pi / wavelength
    count = int(np.ceil(INTERVALS_PER_WAVELENGTH * length / wavelength))
    step = length / count
    ds = step / float(batch.arc_fraction[0])
    total = np.zeros((6, 6))
    for index in range(count):
        xi = (index + 0.5) * step
        decay = np.exp(-taper * xi / length)
        r, slope = amplitude * (1 - decay), amplitude * taper / length * decay
        angle = k * (-root - xi) + phase
        cos, sin = np.cos(angle), np.sin(angle)
        t = np.array([-1.0, slope * cos + k * r * sin, slope * sin - k * r * cos])
        t /= np.linalg.norm(t)
        local = c_n * np.eye(3) + (c_t - c_n) * np.outer(t, t)
        x, y, z = -root - xi, r * cos, r * sin
        s = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        total[:3, :3] += local * ds
        total[:3, 3:] -= local @ s * ds
        total[3:, :3] += s @ local * ds
        total[3:, 3:] -= s @ local @ s * ds
    return total


def main() -> None:
    robot = sp.load("biorob2012-wide")
    batch = RobotBatch.of(robot)
    prediction = predict_steady(robot, model="rft")
    axial = AxialRobot.of(prediction)
    turn = 2 * np.pi / abs(prediction.tail_rotation_rate)
    samples = np.linspace(0.0, 3 * turn, 301)
    duty = np.ones(301)

    calls = 0
    original = transient._derivative  # noqa: SLF001 - counting calls is the point

    def counting(*arguments):
        derivative = original(*arguments)

        def counted(*state):
            nonlocal calls
            calls += 1
            return derivative(*state)

        return counted

    transient._derivative = counting  # noqa: SLF001
    transient.adams_states(axial, samples, duty)
    transient._derivative = original  # noqa: SLF001

    def best(function, repeats: int) -> float:
        times = []
        for _ in range(repeats):
            start = time.perf_counter()
            function()
            times.append(time.perf_counter() - start)
        return min(times)

    ours = best(lambda: RUNGE_KUTTA.states(axial, samples, duty), 30)
    whole = best(lambda: sp.simulate(robot, model="rft", motion="held"), 10)
    one_matrix = best(lambda: rebuilt_tail_matrix(batch, 0.3), 5)
    exact = sp.resistance(robot, part="tail", phase=0.3).matrix
    error = float(np.abs(rebuilt_tail_matrix(batch, 0.3) - exact).max() / np.abs(exact).max())
    print(
        json.dumps(
            {
                "question": "warm motor transient of three turns against rebuilding the tail matrix at every step",
                "right_hand_side_evaluations": calls,
                "transient_s": ours,
                "simulate_with_dataset_s": whole,
                "one_rebuilt_matrix_s": one_matrix,
                "rebuilt_matrix_relative_error": error,
                "rebuilding_every_step_s": one_matrix * calls,
                "ratio": one_matrix * calls / ours,
                "ratio_with_dataset": one_matrix * calls / whole,
                "target_ratio": 1000,
            },
            indent=2,
        )
    )


if __name__ == "__main__":
    main()
