"""Films of micrometres along runs of the paper's robot: numbers of docs/contact.md, beside independent solutions.

    python tools/films_of_runs.py              # a minute
    python tools/films_of_runs.py --tails      # trends over sixteen tails at three bounds, ten minutes

Prints means of the runs; their lifts beside Reynolds' equation in two dimensions; and the torques about the body's axis
over the last turn of a run beside closed forms at the same poses and rates, and beside the closed problem of a level
cylinder that bears the weight, to which one neglected effect after the other is added.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

import spirillum as sp
from spirillum.dynamics.run_file import rotation_matrix
from spirillum.fluid.tube.library import tables_of
from spirillum.kernels import core, tube_table
from spirillum.robot.batch import RobotBatch
from spirillum.robot.placement import Placement

sys.path.insert(0, str(Path(__file__).parents[1]))
from tests.support.reynolds import run_lift

Vector = NDArray[np.float64]

RUNS = (
    ("wide", "none", "600 s"),
    ("wide", "100 kPa", "0 s"),
    ("wide", "100 kPa", "60 s"),
    ("wide", "100 kPa", "600 s"),
    ("wide", "10 kPa", "600 s"),
    ("narrow", "100 kPa", "60 s"),
    ("narrow", "100 kPa", "600 s"),
    ("narrow", "10 kPa", "600 s"),
)
"""Preset, bound of the pressure and waiting time of each run."""
COMPARED = 24
"""Moments of a run."""
SLICES, END_LOSS, STEEP_END, ROUND_END = 60, 1.85, 0.26, 0.76
Z, ROLL, JOINT = 2, 3, 6
HZ = 2.0 * np.pi


class Moment(NamedTuple):
    """Pose and rates of a run at a sample, in the axes of the body that do not roll."""

    pose: tuple[float, float, float]
    """Offset, m, pitch and yaw, rad."""
    phase: float
    rates: Vector
    """U, Omega_b and omega_m, (7,)."""


def moment_of(now: Any) -> Moment:
    """The moment at a sample."""
    azimuth, pitch, yaw = (float(now[name]) for name in ("azimuth", "wall_pitch", "wall_yaw"))
    axes = Rotation.from_euler("XZY", [azimuth, yaw, -pitch]).as_matrix()
    turned = axes.T @ rotation_matrix(now["attitude"].values)
    phase = np.arctan2(turned[2, 1], turned[1, 1]) + float(now["tail_phase"])
    rates = [axes.T @ now[name].values for name in ("velocity", "angular_velocity")]
    return Moment(
        (float(now["offset"]), pitch, yaw), phase, np.concatenate([*rates, [float(now["motor_rotation_rate"])]])
    )


class Side:
    """The film under the straight side by closed forms of line contacts, slice by slice."""

    def __init__(self, robot: Any) -> None:
        """Take the sizes of a robot."""
        body = robot.body
        self.radius, self.tube = 0.5 * body.diameter, 0.5 * robot.channel.diameter
        self.bend = self.radius * self.tube / (self.tube - self.radius)
        rear, front = (0.5 * body.length - body.rounding(end) for end in (body.rear_end, body.front_end))
        self.rounding = body.rounding(body.rear_end), body.rounding(body.front_end)
        self.fluid = robot.fluid
        share = (np.arange(SLICES) + 0.5) / SLICES
        sums = share**3 + (1.0 - share) ** 3
        self.length = 3.0 * (rear + front) * (share * (1.0 - share) / sums) ** 2 / SLICES
        self.to_rear = (rear + front) * share**3 / sums
        self.to_front, self.x = rear + front - self.to_rear, self.to_rear - rear

    def _at(self, pose: tuple[float, float, float]) -> tuple[Vector, Vector, Vector, Vector]:
        """Gaps (n,), and velocities of opening, of entrainment and of the body's surface around, (n, 6)."""
        offset, pitch, yaw = pose
        axes = Rotation.from_euler("ZY", [yaw, -pitch]).as_matrix()
        origin = np.array([0.0, 0.0, -offset])
        centre = origin + self.x[:, None] * axes[:, 0]
        normal = centre * [0.0, 1.0, 1.0]
        normal = normal - (normal @ axes[:, 0])[:, None] * axes[:, 0]
        point = centre + self.radius * normal / np.linalg.norm(normal, axis=1)[:, None]
        away = np.hypot(point[:, 1], point[:, 2])
        outward = point * [0.0, 1.0, 1.0] / away[:, None]
        ahead = np.broadcast_to([1.0, 0.0, 0.0], outward.shape)
        around = np.cross(ahead, outward)

        def along(direction: Vector, at: Vector) -> Vector:
            turning = np.cross(axes.T[:, None], (at - origin)[None])
            moving = np.broadcast_to(axes.T[:, None], turning.shape)
            return np.asarray(np.einsum("knj,nj->nk", np.concatenate([moving, turning]), direction))

        # The gap opens along the body, and its line runs around the tube, while the body takes both along.
        surface, slid = along(around, point), along(ahead, point)
        lean, skew = (direction @ axes[:, :1] for direction in (outward, around))
        of_axis = along(around, centre) - skew * (along(ahead, centre) - 0.5 * slid)
        entrained = 0.5 * surface - self.tube / (self.tube - self.radius) * of_axis
        return self.tube - away, 0.5 * lean * slid - along(outward, point), entrained, surface

    def forces(self, pose: tuple[float, float, float], rates: Vector) -> tuple[Vector, Vector]:
        """Force and torque of the linear film, (6,), and what cavitation adds."""
        gap, opening, entrained, surface = self._at(pose)
        if gap.min() <= 0.0:
            return np.full(6, np.nan), np.zeros(6)
        width = np.sqrt(2.0 * self.bend * gap)
        steep = np.gradient(gap, self.x) * width / gap
        ends = zip((self.to_rear, self.to_front), self.rounding, (steep, -steep), strict=True)
        eta = np.full(SLICES, self.fluid.viscosity)
        for far, r, slope in ends:
            depth = (far / width + ROUND_END * np.sqrt(r / self.bend)) / (1.0 + STEEP_END * np.maximum(slope, 0.0))
            eta *= 1.0 - np.exp(-END_LOSS * depth)
        v, u, slip = opening @ rates, entrained @ rates, surface @ rates
        out = np.empty((SLICES, 6))
        for n in range(SLICES):  # each with its own viscosity
            numbers = (np.array([number]) for number in (gap[n], self.bend, v[n], u[n]))
            core.lift_of_cavitation(*numbers, eta[n], self.fluid.cavitation_pressure or np.inf, out[n : n + 1])
        squeeze, roll = -3.0 * np.pi * eta * self.bend * width / gap**2 * v, -4.0 * np.pi * eta * width / gap * u
        shear = -np.pi * self.fluid.viscosity * width / gap * slip
        linear = (self.length * squeeze) @ opening + (self.length * roll) @ entrained + (self.length * shear) @ surface
        return linear, (self.length * out[:, 0]) @ opening + (self.length * out[:, 1]) @ entrained


def simulate(tube: str, bound: str, wait: str) -> Any:
    """A run of 20 s."""
    robot = sp.load(f"biorob2012-{tube}", **{"fluid.cavitation_pressure": bound})
    return sp.simulate(robot, model="tube", timing={"duration": "20 s"}, in_tube={"wait": wait})


def print_means(run: Any) -> None:
    """Speed, body rate, gap and forces."""
    speed, rate = (float(run[f"mean_{name}_on"]) for name in ("forward_velocity", "body_rotation_rate"))
    loads = ", ".join(
        f"{name} {1e3 * float(run[name].mean()):.1f} mN" for name in ("contact_force", "film_load", "lift")
    )
    gap = 1e6 * float(run["wall_gap"].median())
    print(f"  {1e3 * speed:.3f} mm/s, body {rate / HZ:.4f} Hz, gap {gap:.2f} um, {loads}")


def print_lifts(run: Any) -> None:
    """The run's lift beside that of finite differences."""
    places = np.flatnonzero((run["lift"].values > 0.0) & (run["time"].values > 0.5))
    if not places.size:
        return
    moments = [run.isel(time=int(k)) for k in places[:: max(1, places.size // COMPARED)]]
    own, other = np.array([(float(moment["lift"]), run_lift(moment, (120, 90))) for moment in moments]).T
    off = np.sqrt(np.mean((own - other) ** 2)) / other.mean()
    print(
        f"  lift {1e3 * own.mean():.1f} mN, Reynolds {1e3 * other.mean():.1f} mN, moments differ by {100 * off:.0f} %"
    )


def body_torques(robot: sp.Robot, table: Vector, now: Any) -> tuple[dict[str, float], Vector]:
    """Torques on the body about its axis, N m, and force of film and cavitation on it towards the tube's axis, N."""
    at, eta = moment_of(now), robot.fluid.viscosity
    matrix, film = np.empty((8, 8)), np.empty((6, 6))
    core.resistance_at(table, *at.pose, at.phase, matrix)
    core.film_at(table[tube_table.film_start(table) :], *at.pose, film)
    linear = -eta * film @ at.rates[:6]
    row = matrix[ROLL, :7] - matrix[JOINT, :7]  # of both links, without the rotor
    row[:6] -= film[ROLL]
    drive, flow = (
        -float(now["drive_torque"]),
        -eta * float(matrix[ROLL, 7] - matrix[JOINT, 7]) * float(now["mean_flow"]),
    )
    parts = {
        "drive": drive,
        "film, linear": linear[ROLL],
        "rotor's flow": -eta * row[JOINT] * at.rates[JOINT],
        "other fluid by the body's rate": -eta * row[ROLL] * at.rates[ROLL],
    }
    rest = -eta * row @ at.rates[:7] - parts["rotor's flow"] - parts["other fluid by the body's rate"] - flow
    found = parts | {"other fluid by other rates": rest}
    found["film, cavitation"] = -sum(found.values())
    pull = -float(now["film_load"]) - float(now["lift"])
    return found, np.array([pull, float(now["lift"])])


def print_balance(run: Any) -> None:
    """Terms of the balance of torque beside closed forms, and the ladder from the closed problem to the run."""
    robot = sp.load("biorob2012-wide", **{"fluid.cavitation_pressure": "10 kPa"})
    table: Any = tables_of(RobotBatch.of(robot, Placement.of({"gap": "0.5 mm"})))[0]
    side = Side(robot)
    turn = HZ / float(run["tail_rotation_rate"][-1])
    last = [run.isel(time=int(k)) for k in np.flatnonzero(run["time"].values > float(run["time"][-1]) - turn)]
    own = [body_torques(robot, table.packed, now) for now in last]
    terms = {name: float(np.mean([one[name] for one, _ in own])) for name in own[0][0]}
    moments = [moment_of(now) for now in last]
    closed = np.mean([side.forces(one.pose, one.rates[:6]) for one in moments], axis=0)
    rates = np.mean([one.rates for one in moments], axis=0)
    for name, value in terms.items():
        print(f"    {name}: {1e6 * value:.1f} uN m")
    print(f"    closed forms: film, linear {1e6 * closed[0, ROLL]:.1f}, cavitation {1e6 * closed[1, ROLL]:.1f} uN m")
    pull, lift = 1e3 * np.mean([force for _, force in own], axis=0)
    print(f"    film, linear {pull:.1f} mN, lift {lift:.1f} mN")
    print(f"    closed forms, the nose left out: {1e3 * closed[0, Z]:.1f} mN, {1e3 * closed[1, Z]:.1f} mN")
    load = float(np.mean([float(now["weight_load"] + now["outer_load"]) for now in last]))
    rotor = terms["rotor's flow"] + terms["other fluid by other rates"]
    other = terms["other fluid by the body's rate"] / rates[ROLL]
    steps = {
        "level, all of the torque on the film": (0.0, 0.0, 0.0),
        "less what the rotor's flow takes": (rotor, 0.0, 0.0),
        "less what other fluid takes": (rotor, other, 0.0),
        "drifting around the tube": (rotor, other, float(rates[1] / rates[ROLL])),
    }
    for name, (taken, per_rate, drift) in steps.items():

        def left(unknown: Vector, taken: float = taken, per_rate: float = per_rate, drift: float = drift) -> Vector:
            gap, rate = np.exp(unknown)
            linear, lifted = side.forces(
                (side.tube - side.radius - float(gap), 0.0, 0.0), -rate * np.array([0.0, drift, 0.0, 1.0, 0.0, 0.0])
            )
            torque = linear[ROLL] + lifted[ROLL] + taken - per_rate * rate
            return np.array([(linear[Z] + lifted[Z]) / load - 1.0, torque / -terms["drive"] - 1.0])

        gap, rate = np.exp(fsolve(left, np.log([3e-6, 0.03])))
        print(f"    {name}: {1e6 * gap:.1f} um, {rate / HZ:.4f} Hz")
    torque = -terms["drive"] - rotor - closed[1, ROLL]
    per_rate = other + closed[0, ROLL] / rates[ROLL]
    print(f"    at the poses of the run: {abs(torque / per_rate) / HZ:.4f} Hz, the run: {abs(rates[ROLL]) / HZ:.4f} Hz")


TAILS = ([10, 15, 20, 25], [1.5, 2.0, 2.5, 3.5])
"""Wavelengths and amplitudes, mm, of the paper's study."""


def print_trends(bound: str) -> None:
    """In how many steps over tails each of the paper's trends holds, 12 s after a minute of waiting."""
    speed, motor, friction = np.empty((3, 2, 4, 4))
    for place in np.ndindex(2, 4, 4):
        tube, wavelength, amplitude = ("wide", "narrow")[place[0]], TAILS[0][place[1]], TAILS[1][place[2]]
        tail = {"tail.wavelength": f"{wavelength} mm", "tail.amplitude": f"{amplitude} mm"}
        robot = sp.load(f"biorob2012-{tube}", **{"fluid.cavitation_pressure": bound}, **tail)
        timing = {"duration": "12 s", "samples_per_turn": 20}
        run = sp.simulate(robot, model="tube", timing=timing, in_tube={"wait": "60 s"})
        rates = [float(run[f"mean_{part}_rotation_rate"]) for part in ("tail", "body")]
        load = float(sp.predict(robot, model="rft", tail_rate=rates[0]).tail_torque)
        speed[place], motor[place] = float(run["mean_forward_velocity_on"]), rates[0] - rates[1]
        friction[place] = (float(run["motor_torque"][-1]) - load) / motor[place]
    rising = np.diff(motor, axis=1)
    trends = {
        "speed increases with wavelength": np.diff(speed, axis=1),
        "speed decreases with amplitude but at 25 mm": -np.diff(speed[:, :-1], axis=2),
        "motor rate decreases with amplitude": -np.diff(motor, axis=2),
        "motor rate increases with wavelength": rising,
        "motor rate saturates": -np.diff(rising, axis=1),
        "B_eff depends on the amplitude": np.std(friction.mean(axis=1), axis=1) - np.std(friction.mean(axis=2), axis=1),
    }
    for name, steps in trends.items():
        print(f"p_c {bound}: {name} in {np.count_nonzero(steps > 0.0)} of {steps.size}")


def main() -> None:
    """Print all."""
    if "--tails" in sys.argv[1:]:
        for bound in ("none", "100 kPa", "10 kPa"):
            print_trends(bound)
        return
    for tube, bound, wait in RUNS:
        print(f"{tube} tube, p_c {bound}, waited {wait}")
        run = simulate(tube, bound, wait)
        print_means(run)
        print_lifts(run)
        if (tube, bound) == ("wide", "10 kPa"):
            print_balance(run)


if __name__ == "__main__":
    main()
