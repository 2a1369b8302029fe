"""How accurate is every model, and how long does the resolved one take against a full solution of the surfaces?

Every model on the same reference robots, against resolved, exact or measured values; `tools/write_tables.py` writes
the tables of the documentation from these rows. The resolved values of tail and robot are those that
`resolved_reference.py --full` gave (minutes, in `resolved_reference.json`); `--time` also runs its coarsest tail, for
the ratio of times on one machine.

    OMP_NUM_THREADS=1 python benchmarks/stated_errors.py --time
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import spirillum as sp
from spirillum.fluid.wire.interaction import Discretisation, solve
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.fluid.wire.slender import robot_solution
from spirillum.fluid.wire.stokeslets import Accuracy, Wire
from spirillum.robot.batch import RobotBatch
from spirillum.robot.outline import body_outline, cylinder_outline

REFERENCE = json.loads((Path(__file__).parent / "resolved_reference.json").read_text(encoding="utf-8"))
TAIL = "biorob2012-wide"
ROBOT = {"body.rear": "hemisphere", "coupling.diameter": "0 mm"}
"""The same tail 10 mm behind a capsule with two hemispherical ends, no coupling."""

MODELS: dict[str, tuple[str, dict[str, Any]]] = {
    "RFT, printed coefficients": ("rft", {}),
    "RFT, printed, with spin": ("rft", {"model.rft.spin": True}),
    "RFT, Gray and Hancock": ("rft", {"model.rft.coefficients": "gray-hancock"}),
    "RFT, Lighthill": ("rft", {"model.rft.coefficients": "lighthill"}),
    "SBT, eqs (1) to (7)": ("sbt", {}),
    "SBT with spin": ("sbt", {"model.sbt.spin": True}),
    "slender, standard": ("slender", {}),
    "slender, high": ("slender", {"model.slender.accuracy": "high"}),
}
TORUS = {0.1: 0.7843079118776118, 0.001: 0.4410799504734741}
"""Broadside drag over 6 pi mu U (R + a), arXiv:2102.01791, Table 2."""
CYLINDERS = {2.0: (0.25, 0.99), 4.0: (0.03, 0.90), 10.0: (-0.11, 0.86)}
"""Length over diameter to end corrections along and across: Tirado and Garcia de la Torre, 1979."""

Row = dict[str, Any]


def tail_rows() -> list[Row]:
    """Drag, thrust coupling and axial torque of the bare tail (25, 2.5 mm; wire 1 mm) against the resolved wire."""
    true = {name: value for name, (value, _) in REFERENCE["tail"]["sharp"].items()}
    rows = []
    for title, (model, fields) in MODELS.items():
        robot = sp.load(TAIL, **fields)
        matrix = sp.resistance(robot, part="tail", model=model).matrix / robot.fluid.viscosity
        found = {"B11": matrix[0, 0] * 1e3, "B14": matrix[0, 3] * 1e6, "B44": matrix[3, 3] * 1e9}
        rows.append({"model": title} | {name: found[name] / true[name] - 1.0 for name in true})
    return rows


def tails_rows() -> list[Row]:
    """The same entries of other tails; their resolved wires have edges rounded by half the wire's radius."""
    rows = []
    for case in REFERENCE["tails"]:
        tail = {f"tail.{name}": f"{case[name]} mm" for name in ("wavelength", "amplitude")}
        for title in ("RFT, printed coefficients", "SBT, eqs (1) to (7)", "slender, standard", "slender, high"):
            model, fields = MODELS[title]
            robot = sp.load(TAIL, **tail, **fields)
            matrix = sp.resistance(robot, part="tail", model=model).matrix / robot.fluid.viscosity
            found = {"B11": matrix[0, 0] * 1e3, "B14": matrix[0, 3] * 1e6, "B44": matrix[3, 3] * 1e9}
            errors = {name: found[name] / case[name] - 1.0 for name in found}
            rows.append({"tail": f"{case['wavelength']:g}, {case['amplitude']:g} mm", "model": title} | errors)
    return rows


def robot_rows() -> list[Row]:
    """Speed, counter-rotation and torque per rate of the tail, against the resolved robot."""
    true = {name: value for name, (value, _) in REFERENCE["robot"]["sharp"].items()}
    rows = []
    for title, (model, fields) in MODELS.items():
        robot = sp.load(TAIL, **ROBOT, **fields)
        answer = sp.predict(robot, model=model, tail_rate=1.0, friction="none", calibrated=False)
        found = {
            "speed": 1e3 * answer.forward_velocity,
            "body_rate": answer.body_rotation_rate,
            "torque": 1e9 * answer.tail_torque / robot.fluid.viscosity,
        }
        rows.append({"model": title} | {name: found[name] / true[name] - 1.0 for name in true})
    rows.append({"model": "slender, high, without interaction"} | _without_interaction(true))
    return rows


def _without_interaction(true: dict[str, float]) -> Row:
    """The robot's motion from body and tail each alone in the fluid."""
    robot = sp.load(TAIL, **ROBOT, **{"model.slender.accuracy": "high"})
    body, tail = (
        sp.resistance(robot, part=part, model="slender").matrix / robot.fluid.viscosity for part in ("body", "tail")
    )
    drag = body[0, 0] + tail[0, 0]
    speed = -tail[0, 3] / drag  # without the body's own rate, which exerts no force
    torque = tail[3, 3] + tail[3, 0] * speed
    found = {"speed": 1e3 * speed, "body_rate": -torque / body[3, 3], "torque": 1e9 * torque}
    return {name: float(found[name] / true[name] - 1.0) for name in true}


def body_rows() -> list[Row]:
    """Largest relative error of the diagonal of bodies of revolution, `slender` at standard accuracy."""
    rows = []
    for title, diameter, length in (("sphere", 2.0, 2.0), ("spheroid 1:2.5", 2.0, 5.0), ("spheroid 2:1", 2.0, 1.0)):
        shape = "sphere" if length == diameter else "spheroid"
        fields = {"body.shape": shape, "body.diameter": f"{diameter} mm", "body.length": f"{length} mm"}
        robot = sp.load(TAIL, **fields, **{"body.front": None, "body.rear": None, "body.mass": None})
        exact, found = (
            np.diag(sp.resistance(robot, part="body", model=model).matrix) for model in ("perrin", "slender")
        )
        rows.append({"body": title, "against": "exact", "error": float(np.max(np.abs(found / exact - 1.0)))})
    for title, rear in (("capsule, hemispherical ends", "hemisphere"), ("capsule, flat rear", "flat")):
        outline = body_outline("capsule", 18e-3, 35e-3, 0.0, "hemisphere", rear)
        coarse, fine = (np.diag(solve([(outline, 0)], [], Discretisation(order=n)).matrix)[:6] for n in (8, 20))
        rows.append({"body": title, "against": "20 nodes", "error": float(np.max(np.abs(coarse / fine - 1.0)))})
    for slenderness, (along, across) in CYLINDERS.items():
        outline = cylinder_outline(1.0, 0.5 * slenderness, -0.5 * slenderness)
        drag = np.diag(solve([(outline, 0)], [], Discretisation()).matrix)
        log = np.log(slenderness)
        true = np.array([2.0 / (log + along), 4.0 / (log + across)]) * np.pi * slenderness
        error = float(np.max(np.abs(drag[:2] / true - 1.0)))
        rows.append({"body": f"cylinder, L/d = {slenderness:g}", "against": "Tirado and Garcia", "error": error})
    return rows


def torus_rows() -> list[Row]:
    """The torus broadside on, exact."""
    rows = []
    accuracies: tuple[Accuracy, ...] = ("standard", "high")
    for accuracy in accuracies:
        for ratio, exact in TORUS.items():
            if ratio < 0.01 and accuracy == "high":
                continue  # thousands of stations: for a ring that thin both forms agree
            what = f"torus, a/R = {ratio:g}"
            found = _resistance(_ring(ratio), accuracy)[0, 0] / (6.0 * np.pi * (1.0 + ratio))
            rows.append({"wire": what, "accuracy": accuracy, "quantity": "drag", "error": found / exact - 1.0})
    return rows


def _resistance(wire: Wire, accuracy: Accuracy) -> np.ndarray:
    return solve([], [(wire, 0)], Discretisation(wire=accuracy)).matrix[:6, :6]


def _ring(ratio: float) -> Wire:
    """A ring of radius 1, its stations as far apart as those of other wires."""
    count = int(np.ceil(2.0 * np.pi / (0.75 * np.exp(0.5) * ratio)))
    angle = 2.0 * np.pi * np.arange(count) / count
    points = np.stack([0.0 * angle, np.cos(angle), np.sin(angle)], axis=1)
    tangents = np.stack([0.0 * angle, -np.sin(angle), np.cos(angle)], axis=1)
    return Wire(points, tangents, np.full(count, 2.0 * np.pi / count), ratio)


def times(*, baseline: bool) -> Row:
    """Warm times of solutions, and their ratios to the coarsest solution of the surfaces."""
    found: Row = {}
    accuracies: tuple[Accuracy, ...] = ("standard", "high")
    for accuracy in accuracies:
        fields = {"model.slender.accuracy": accuracy}
        batch = RobotBatch.of(sp.load(TAIL, **ROBOT, **fields))
        coupled = RobotBatch.of(sp.load(TAIL, **fields))
        wire = RobotGeometry.of(batch).wire()
        found[f"tail 6x6, {accuracy}"] = _best(lambda w=wire, a=accuracy: _resistance(w, a))
        found[f"robot 12x12, {accuracy}"] = _best(lambda b=batch: robot_solution(b))
        found[f"robot with coupling 12x12, {accuracy}"] = _best(lambda b=coupled: robot_solution(b))
    outline = RobotGeometry.of(batch).body
    found["body 6x6, standard"] = _best(lambda: solve([(outline, 0)], [], Discretisation()))
    answer: Row = {"milliseconds": {name: round(1e3 * value, 2) for name, value in found.items()}}
    if baseline:
        import resolved_reference

        start = time.perf_counter()
        resolved_reference.tail_case(1.0, resolved_reference.COARSE)
        seconds = time.perf_counter() - start
        answer["baseline_seconds"] = round(seconds, 1)
        answer["times_faster"] = {name: round(seconds / value) for name, value in found.items()}
    return answer


def _best(run: Callable[[], object]) -> float:
    seconds = []
    for _ in range(6):
        start = time.perf_counter()
        run()
        seconds.append(time.perf_counter() - start)
    return min(seconds[1:])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--time", action="store_true", help="also run the coarsest resolved tail, for the ratio of times"
    )
    options = parser.parse_args()
    answer = {
        "question": "relative errors of all models on the same reference robots, and times of the resolved one",
        "reference": REFERENCE["source"],
        "tail": tail_rows(),
        "tails": tails_rows(),
        "robot": robot_rows(),
        "bodies": body_rows(),
        "torus": torus_rows(),
        "times": times(baseline=options.time),
    }
    print(json.dumps(answer, indent=1))


if __name__ == "__main__":
    main()
