"""How accurate is the model `tube`, and how long does it take?

Sphere, annulus, capsule and open ends against `tube_reference.json` and closed forms; the lying capsule and the whole
robot against themselves, resolved more finely; the robot near the glass against its table; the paper's 16 tails in both
channels; memory. Seconds are of the wall
and of the processor, and over those of two LU factorisations of the size of the equations (one for each parity), which
are measured next to them. Kernels are compiled before anything is timed, and answers on disk are not used.

    OMP_NUM_THREADS=1 python benchmarks/tube_accuracy.py [--quick] [--only CASE] [--json] [--draw FILE.png]
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from tube_reference import annulus_axial_drag, annulus_axial_drag_no_flux, annulus_rotation

import spirillum as sp
from spirillum.fluid.registry import find_swimmer_model
from spirillum.fluid.tube.confined import UnitMotions, solve_unit_motions
from spirillum.fluid.tube.library import tables_of
from spirillum.fluid.tube.outer_resistance import matrix_of
from spirillum.fluid.tube.solids import Fineness, Solids
from spirillum.fluid.tube.tube import END_LOSS, solved
from spirillum.fluid.wire.interaction import one_thread
from spirillum.fluid.wire.stokeslets import stations_along
from spirillum.robot.batch import RobotBatch
from spirillum.robot.load import with_resolution
from spirillum.robot.outline import Outline, body_outline
from spirillum.robot.placement import Placement
from spirillum.robot.tube_pose import TubePose
from spirillum.swimming.steady import swim

Row = dict[str, Any]

REFERENCE = json.loads((Path(__file__).parent / "tube_reference.json").read_text(encoding="utf-8"))
CHANNELS = {"wide": 20.0, "narrow": 15.0}
"""Radii, mm."""
WAVELENGTHS, AMPLITUDES = ("10 mm", "15 mm", "20 mm", "25 mm"), ("1.5 mm", "2 mm", "2.5 mm", "3.5 mm")
TAIL_RATE = 7.5


@dataclass(frozen=True)
class Timed:
    """What a call returned and how long it took."""

    value: Any
    wall: float
    processor: float


def timed(call: Callable[[], Any]) -> Timed:
    wall, processor = time.perf_counter(), time.process_time()
    value = call()
    return Timed(value, time.perf_counter() - wall, time.process_time() - processor)


def factorisations(size: int) -> float:
    """Seconds for two LU factorisations of matrices of that size, one thread, at best."""
    from scipy.linalg import lu_factor

    matrix = np.random.default_rng(0).normal(size=(size, size))
    with one_thread():
        return 2.0 * min(timed(lambda: lu_factor(matrix, check_finite=False)).wall for _ in range(3))


def body(radius: float, length: float, rear: Any) -> Outline:
    shape = "sphere" if length == 2.0 * radius else "capsule"
    return body_outline(shape, 2.0 * radius, length, 0.0, "hemisphere", rear)


def held(outline: Outline, radius: float, offset: float, fineness: Fineness) -> Timed:
    return timed(lambda: solve_unit_motions(Solids([(outline, 0)], TubePose(radius, offset), fineness), []))


def took(*runs: Timed) -> Row:
    sizes = {run.value.strengths.solids.size for run in runs}
    unknowns = max(sizes)
    wall = max(run.wall for run in runs)
    return {
        "unknowns": unknowns,
        "s": wall,
        "cpu_s": max(run.processor for run in runs),
        "over_two_LU": wall / factorisations(unknowns),
    }


def sphere_rows(*, quick: bool) -> list[Row]:
    """On the axis, against multipoles in 40 digits; largest relative error of drag, torque and force in a flow."""
    rows = []
    for case in REFERENCE["sphere_on_axis"]["rows"][: 5 if quick else 9]:
        a = case["radius_ratio"]
        run = held(body(a, 2 * a, None), 1.0, 0.0, Fineness(order=12, tolerance=1e-10, panel=1.5))
        matrix, load = run.value.matrix, run.value.load
        errors = (
            matrix[0, 0] / (6 * np.pi * a) / case["drag"] - 1,
            matrix[3, 3] / (8 * np.pi * a**3) / case["torque"] - 1,
            load[0] / (6 * np.pi * a) / case["held_in_poiseuille"] - 1,
        )
        names = ("drag_error", "torque_error", "load_error")
        rows.append({"a/R": a, **dict(zip(names, errors, strict=True)), **took(run)})
    return rows


def annulus_rows(*, quick: bool) -> list[Row]:
    """Difference of two long capsules per length, against closed forms of an eccentric annulus."""
    cases = [(0.5, 1e-4, 8)] if quick else [(0.5, 1e-4, 8), (0.2, 1e-3, 8)]
    rows = []
    for radius in CHANNELS.values():
        for gap, tolerance, order in cases:
            place = (9.0, radius, radius - 9.0 - gap)
            lengths = (60.0, 80.0) if quick else (80.0, 100.0)
            fineness = Fineness(tolerance=tolerance, order=order)
            runs = [held(body(9.0, length, "hemisphere"), radius, place[2], fineness) for length in lengths]
            short, long = (run.value for run in runs)

            def slope(
                value: Callable[[UnitMotions], float], short: UnitMotions = short, long: UnitMotions = long
            ) -> float:
                return (value(long) - value(short)) / 20.0

            drag, load, loss = slope(lambda h: h.matrix[0, 0]), slope(lambda h: h.load[0]), slope(lambda h: h.drag)
            journal, torque = annulus_rotation(*place)
            rows.append(
                {
                    "R_mm": radius,
                    "gap_mm": gap,
                    "tolerance": tolerance,
                    "no_gradient_error": (drag - load**2 / (8 * np.pi + loss)) / annulus_axial_drag(*place) - 1,
                    "no_flux_error": drag / annulus_axial_drag_no_flux(*place) - 1,
                    "torque_error": slope(lambda h: h.matrix[3, 3]) / torque - 1,
                    "journal_error": -slope(lambda h: h.matrix[1, 3]) / journal - 1,
                    **took(*runs),
                }
            )
    return rows


LYING = {
    "drag": lambda h: h.matrix[0, 0],
    "torque": lambda h: h.matrix[3, 3],
    "plug": lambda h: h.load[0],
    "normal": lambda h: h.matrix[2, 2],
    "journal": lambda h: h.matrix[1, 3],
}


def capsule_rows(*, quick: bool) -> list[Row]:
    """The paper's capsule lying in either tube, against itself with a finer tolerance and more nodes."""
    cases = {0.5: ((1e-2, 1e-3, 1e-4), Fineness(tolerance=1e-5, order=10, panel=2.0))}
    if not quick:
        cases[0.2] = ((1e-2, 1e-3), Fineness(tolerance=1e-4, order=10))
        cases[0.05] = ((1e-2,), Fineness(tolerance=2e-3, order=8))
    rows = []
    for radius in CHANNELS.values():
        for gap, (tolerances, finest) in cases.items():
            outline, offset = body(9.0, 35.0, "flat"), radius - 9.0 - gap
            fine = held(outline, radius, offset, finest)
            for tolerance in tolerances:
                run = held(outline, radius, offset, Fineness(tolerance=tolerance))
                errors = {f"{name}_error": value(run.value) / value(fine.value) - 1 for name, value in LYING.items()}
                rows.append(
                    {
                        "R_mm": radius,
                        "gap_mm": gap,
                        "tolerance": tolerance,
                        **errors,
                        "asymmetry": run.value.asymmetry,
                        **took(run),
                        "finest": finest.tolerance,
                    }
                )
    return rows


def end_rows(*, quick: bool) -> list[Row]:
    """Capsule on the axis of closed and open tubes against a meshed wall."""
    rows = []
    for closed in REFERENCE["capsule_on_axis"]["closed_tube_zero_net_flux"][: 1 if quick else None]:
        radius = 0.5 * closed["tube_diameter"]
        run = held(body(9.0, 35.0, "flat"), radius, 0.0, Fineness(tolerance=1e-5, order=10))
        matrix, load = run.value.matrix, run.value.load
        rows.append({"R_mm": radius, "ends": "closed", "drag_error": matrix[0, 0] / closed["drag"] - 1, **took(run)})
        for case in REFERENCE["capsule_on_axis"]["open_tube_in_a_bath"]:
            if case["tube_diameter"] == closed["tube_diameter"]:
                flow = load[0] / (8 * np.pi * (case["tube_length"] + END_LOSS * radius) + run.value.drag)
                ends = f"open, {case['tube_length']:g} mm, wall {case['wall_thickness']:g} mm"
                drag = matrix[0, 0] - load[0] * flow
                rows.append({"R_mm": radius, "ends": ends, "drag_error": drag / case["drag"] - 1})
    return rows


def _speed(channel: str, placement: dict[str, Any], tolerance: float) -> Timed:
    robot = with_resolution(sp.load(f"biorob2012-{channel}"), {"tolerance": tolerance, "phases": 1})
    return timed(lambda: sp.predict(robot, model="tube", tail_rate=TAIL_RATE, placement=placement))


def robot_rows(*, quick: bool) -> list[Row]:
    """Speed per turn at one phase of the tail, as `predict` answers with its error estimate, against a finer one."""
    places: list[tuple[dict[str, Any], float]] = [({"gap": "0.5 mm"}, 5e-4), ({"gap": "0.2 mm"}, 5e-4)]
    places.append(({"gap": "0.5 mm", "pitch": "1 deg"}, 2.5e-3))
    rows = []
    for channel in CHANNELS:
        for placement, finest in places[:1] if quick else places:
            run = _speed(channel, placement, 5e-3)
            fine = _speed(channel, placement, finest)
            rows.append(
                {
                    "channel": channel,
                    "placement": ", ".join(placement.values()),
                    "speed_error": run.value.forward_velocity / fine.value.forward_velocity - 1,
                    "body_rate_error": run.value.body_rotation_rate / fine.value.body_rotation_rate - 1,
                    "torque_error": run.value.tail_torque / fine.value.tail_torque - 1,
                    "error_estimate": run.value.error_estimate,
                    "s": run.wall,
                    "cpu_s": run.processor,
                    "finest": finest,
                    "finest_s": fine.wall,
                }
            )
    return rows


def tail_rows(*, quick: bool) -> list[Row]:
    """The paper's 16 tails in each channel at two phases and one gap of 0.5 mm, without error estimates."""
    model = find_swimmer_model("tube")
    rows = []
    for channel in CHANNELS:
        tails = [(w, a) for w in WAVELENGTHS for a in AMPLITUDES][: 2 if quick else None]
        robots = [sp.load(f"biorob2012-{channel}", **{"tail.wavelength": w, "tail.amplitude": a}) for w, a in tails]
        batch = RobotBatch.of(robots, Placement.of({"gap": "0.5 mm"}))
        run = timed(lambda batch=batch: swim(batch, model, tail_rate=np.array([TAIL_RATE])))
        rows.append({"channel": channel, "tails": len(robots), "s": run.wall, "cpu_s": run.processor})
    return rows


def wire_rows(*, quick: bool) -> list[Row]:
    """A straight wire along the glass, per length, against a long capsule: two of each, one radius longer."""
    b = 0.04  # of R; the paper's wire has 0.025 and 0.033
    rows = []
    for height in (8.0, 3.0) if quick else (8.0, 4.0, 3.0, 2.0):
        offset, lengths = 1.0 - height * b, (3.0, 4.0)
        runs = [held(body(b, length, "hemisphere"), 1.0, offset, Fineness(tolerance=1e-3)) for length in lengths]
        solid = runs[1].value.matrix - runs[0].value.matrix
        lines = []
        for length in lengths:
            x = np.linspace(-0.5 * length, 0.5 * length, 60)
            wire = stations_along(np.stack([x, 0 * x, 0 * x], axis=1), b)
            lines.append(
                solve_unit_motions(Solids([], TubePose(1.0, 0.0), Fineness(tolerance=1e-5)), [(wire, 1)], offset)
            )
        found = (lines[1].matrix - lines[0].matrix)[6:, 6:]
        load, loss = lines[1].load[6] - lines[0].load[6], lines[1].drag - lines[0].drag
        no_gradient = (found[0, 0] - load**2 / (8 * np.pi + loss)) / annulus_axial_drag(b, 1.0, offset)
        names = ("along_no_flux_error", "sideways_error", "towards_error", "spin_error")
        errors = {name: found[i, i] / solid[i, i] - 1 for i, name in enumerate(names)}
        rows.append({"h/a": height, "along_no_gradient_error": no_gradient - 1, **errors})
    return rows


def film_rows(*, quick: bool) -> list[Row]:
    """The whole robot, level and near the glass, against its table: largest differences of its resistances.

    Relative to the geometric mean of the diagonal entries. A table is a film with an extrapolated rest there.
    """
    cases = {1e-4: (1e-2, 1e-3)} if quick else {1e-4: (1e-2, 1e-3), 5e-5: (2e-3, 1e-3)}
    rows = []
    for channel in CHANNELS:
        table: Any = tables_of(RobotBatch.of(sp.load(f"biorob2012-{channel}")))[0]
        for gap, tolerances in cases.items():
            pose = TubePose.at_gap(table.geometry.body, table.radius, gap)
            own, _ = table.at(pose.offset, 0.0, 0.0, FILM_PHASE)
            size = np.sqrt(np.diag(own))
            for tolerance in tolerances:
                question = table.geometry, pose, Fineness(tolerance=tolerance, order=6, growth=1.2), FILM_PHASE
                run = timed(lambda question=question: matrix_of(solved(*question)))
                off = (run.value - own) / np.outer(size, size)
                found = dict(zip(FILM_MOTIONS, np.diag(off).tolist(), strict=False))
                found["others"] = float(np.abs(off - np.diag(np.diag(off))).max())
                rows.append({"channel": channel, "gap_mm": 1e3 * gap, "tolerance": tolerance, **found})
                rows[-1] |= {"s": run.wall, "cpu_s": run.processor}
    return rows


FILM_PHASE, FILM_MOTIONS = 0.3, ("forward", "sideways", "normal", "roll", "pitch", "yaw")
"""Phase of the tail, rad, and motions of the body."""
CASES = {
    "sphere": sphere_rows,
    "annulus": annulus_rows,
    "capsule": capsule_rows,
    "ends": end_rows,
    "robot": robot_rows,
    "tails": tail_rows,
    "wire": wire_rows,
    "film": film_rows,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=list(CASES), action="append")
    parser.add_argument("--quick", action="store_true", help="fewer rows")
    parser.add_argument("--json", action="store_true", help="JSON instead of tables")
    parser.add_argument("--draw", type=Path, help="picture of the capsule's errors against the tolerance")
    options = parser.parse_args()
    os.environ["SPIRILLUM_CACHE"] = "off"
    held(body(0.3, 0.6, None), 1.0, 0.2, Fineness(tolerance=1e-2))
    warm = with_resolution(sp.load("biorob2012-wide", **{"tail.length": "10 mm"}), {"phases": 1})
    sp.predict(warm, model="tube", tail_rate=1.0, placement={"gap": "4 mm"}, resolution={"tolerance": 0.05})
    answer: dict[str, list[Row]] = {}
    for name, run in CASES.items():
        if options.only is None or name in options.only:
            answer[name] = run(quick=options.quick)
            answer[name][-1]["peak_GiB"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
            if not options.json:
                _print(name, run.__doc__ or "", answer[name])
    if options.draw and "capsule" in answer:
        draw(answer["capsule"], options.draw)
    if options.json:
        print(json.dumps(answer, indent=1, default=float))


def draw(rows: list[Row], target: Path) -> None:
    """Errors of the lying capsule against the tolerance of waves and modes, gaps of 0.5 and 0.2 mm."""
    from spirillum.view.figures.style import COLOURS, new_figure, styled

    shown = {"drag": ("black", "o"), "plug": ("blue", "s"), "torque": ("green", "^"), "normal": ("vermillion", "v")}
    with styled():
        figure = new_figure(7.2, 3.0)
        figure.set_layout_engine("constrained")
        axes = figure.subplots(1, 2, sharey=True)
        for axis, gap in zip(axes, (0.5, 0.2), strict=True):
            for name, (colour, marker) in shown.items():
                for radius, line in ((20.0, "-"), (15.0, "--")):
                    some = [row for row in rows if row["gap_mm"] == gap and row["R_mm"] == radius]
                    x, y = [row["tolerance"] for row in some], [abs(row[f"{name}_error"]) for row in some]
                    label = name if radius == 20.0 else None
                    axis.loglog(x, y, line, color=COLOURS[colour], marker=marker, markersize=4, label=label)
            axis.set_xlabel("tolerance of modes and waves")
            axis.set_title(f"gap {gap:g} mm")
            axis.set_xlim(7e-5, 1.4e-2)
        axes[0].set_ylabel("relative error")
        axes[1].legend(title="solid: wide\ndashed: narrow", loc="center left", bbox_to_anchor=(1.02, 0.5))
        figure.savefig(target, dpi=130, metadata={"Software": None})


def _print(name: str, title: str, rows: list[Row]) -> None:
    names = list(dict.fromkeys(key for row in rows for key in row))
    cells = [names, *([_cell(row.get(key, ""), key) for key in names] for row in rows)]
    widths = [max(len(line[i]) for line in cells) for i in range(len(names))]
    print(f"\n{name}: {title}")
    for line in cells:
        print("  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)), flush=True)


def _cell(value: Any, key: str) -> str:
    if not isinstance(value, float):
        return str(value)
    return f"{value:.1e}" if "error" in key or key == "asymmetry" else f"{value:.4g}"


if __name__ == "__main__":
    main()
