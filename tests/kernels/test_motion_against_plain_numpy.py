"""Rates and steps of free robots as csrc/ finds them, against the same balances assembled with NumPy and SciPy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import spirillum as sp
from spirillum.dynamics.free_robot import packed
from spirillum.fluid.tube.domain import in_tube
from spirillum.fluid.tube.library import find_table
from spirillum.kernels import core
from spirillum.kernels.core import resistance_at
from spirillum.robot.batch import RobotBatch

RADIUS, VISCOSITY, MU, SLOW = 0.02, 0.9, 0.2, 1e-5
DRIVES = [(kind, fixed) for kind in (0.0, 1.0, 2.0, 3.0) for fixed in (0.0, 1.0) if (kind, fixed) != (0.0, 1.0)]
CURRENT, JOINT_AXIS, ROBOT_AXIS = core.STATE_CURRENT, np.eye(7)[6], np.eye(7)[3]


class Case:
    """Two links with numbers of a robot's order, and a state of theirs."""

    def __init__(self, kind: float, fixed: float, gap: float, seed: int = 1) -> None:
        rng = np.random.default_rng(seed)
        self.drive = np.zeros(core.DRIVE_SIZE)
        self.drive[core.DRIVE_DUTY :] = rng.uniform(0.5, 1.5, core.DRIVE_SIZE - core.DRIVE_DUTY)
        self.drive[[core.DRIVE_KIND, core.DRIVE_FIXED, core.DRIVE_AXIS_Y, core.DRIVE_AXIS_Z]] = kind, fixed, 0, 0
        self.drive[core.DRIVE_GIVEN] = 1e-3 if kind == core.TORQUE else 0.02
        self.drive[core.DRIVE_TORQUE_CONSTANT] = 1e-3
        size = np.array([1.0, 1.0, 1.0, 0.01, 0.01, 0.01, 0.01])
        half = rng.normal(size=(7, 7))
        self.drag = np.outer(size, size) * (half @ half.T + np.eye(7))
        self.friction = np.zeros((7, 7))
        self.friction[np.ix_([3, 6], [3, 6])] = 1e-4 * np.array([[1.0, 0.2], [0.3, 1.0]])
        self.weight = rng.uniform(0.5, 1.0, core.WEIGHT_SIZE) * np.array([0.1, 0.1] + 6 * [1e-4])
        self.state = rng.normal(size=core.STATE_SIZE)
        turned = Rotation.from_euler("xyz", [0.4, -0.01, 0.02])
        self.state[3:7] = 1.01 * turned.as_quat(scalar_first=True)
        self.state[1:3] = (RADIUS - 0.009 - gap) * np.array([np.sin(0.3), -np.cos(0.3)])
        self.axes = turned.as_matrix()

    @property
    def along(self) -> np.ndarray:
        """What the drive's torque acts on."""
        return ROBOT_AXIS if self.drive[core.DRIVE_FIXED] else JOINT_AXIS

    def loads(self, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Weight, and the field on the magnetic moment."""
        down, place = -self.axes[2], self.weight[2:].reshape(2, 3)
        rotor = about_x(self.state[7])[:3, :3] @ place[1]
        weight = np.concatenate(
            [self.weight[:2].sum() * down, np.cross(place[0] + rotor, down), np.cross(rotor, down)[:1]]
        )
        field = np.zeros(7)
        if self.drive[core.DRIVE_KIND] == core.MAGNETIC:
            angle = self.drive[core.DRIVE_FIELD_RATE] * time + self.drive[core.DRIVE_FIELD_PHASE]
            strength = self.drive[core.DRIVE_FIELD] * np.array([0.0, -np.sin(angle), np.cos(angle)])
            field[3:6] = np.cross(self.drive[core.DRIVE_MOMENT : core.DRIVE_MOMENT + 3], self.axes.T @ strength)
        return weight, field


def about_x(phase: float) -> np.ndarray:
    """Velocities and rotations turned about x, the joint's rate as it is, and as much again of the mean flow."""
    found = np.eye(8)
    for first in (1, 4):
        found[first : first + 2, first : first + 2] = [[np.cos(phase), -np.sin(phase)], [np.sin(phase), np.cos(phase)]]
    return found


def check_motion(case: Case, seen: np.ndarray, dy: np.ndarray) -> None:
    """The drive, and the derivative of the state from the rates."""
    drive, q, current = case.drive, seen[:7], case.state[CURRENT]
    torque, kind = seen[core.SEEN_DRIVE_TORQUE], drive[core.DRIVE_KIND]
    if kind == core.RATE:
        assert q[3] + q[6] == pytest.approx(drive[core.DRIVE_GIVEN], rel=1e-9)
    else:
        motor = drive[core.DRIVE_POLARITY] * drive[core.DRIVE_TORQUE_CONSTANT] * current
        assert torque == {0.0: motor, 1.0: drive[core.DRIVE_DUTY] * drive[core.DRIVE_GIVEN], 3.0: 0.0}[kind]
    assert dy[:3] == pytest.approx(case.axes @ q[:3], rel=1e-12)
    step = 1e-6
    later = Rotation.from_matrix(case.axes) * Rotation.from_rotvec(step * q[3:6])
    moved = Rotation.from_quat(case.state[3:7] + step * dy[3:7], scalar_first=True)
    assert (later.inv() * moved).magnitude() == pytest.approx(0.0, abs=step**2 * (1.0 + q[3:6] @ q[3:6]))
    assert dy[[7, 8]] == pytest.approx(q[[6, 3]])
    constant, decay, fall, growth, rise, slope = drive[core.DRIVE_CONSTANT : core.DRIVE_SLOPE + 1]
    resistance = constant + decay * np.exp(-fall * abs(current)) + growth * np.exp(rise * abs(current))
    resistance += slope * abs(current)
    sag = drive[core.DRIVE_INTERNAL_RESISTANCE] * abs(current)
    supply = drive[core.DRIVE_DUTY] * (drive[core.DRIVE_VOLTAGE] - sag)
    emf = drive[core.DRIVE_BACK_EMF] * drive[core.DRIVE_POLARITY] * q[6]
    change = (supply - resistance * current - emf) / drive[core.DRIVE_INDUCTANCE]
    assert dy[CURRENT] == pytest.approx(change if kind == core.MOTOR else 0.0, rel=1e-12)


@pytest.mark.parametrize(("kind", "fixed"), DRIVES)
@pytest.mark.parametrize("gap", [1e-3, 2e-5, 5e-6])
def test_rates_without_a_tube(kind: float, fixed: float, gap: float) -> None:
    """The whole matrix with its films is solved by NumPy, with the drive's torque as it was found."""
    case, rough, load = Case(kind, fixed, gap), 1e-5, 0.01
    wall, ring = np.array([RADIUS, rough, 1e3, load]), np.array([[0.002, 0.009, 0.0, 0.3, 1.5, 5e-4]])
    none = np.zeros(0)
    data = packed(case.friction, case.weight, case.drive, case.drag, wall, ring)
    dy, j, thinnest = np.empty(19), np.empty(6), np.empty(1)
    core.rates(dy, 0.7, case.state, data, none)
    core.gaps_of(case.state, data, none, thinnest)
    turn = about_x(case.state[7])[:7, :7]
    a, (weight, field) = turn @ case.drag @ turn.T + case.friction, case.loads(0.7)
    film = core.film_of(case.state, case.axes, wall, ring[0], j)
    assert (thinnest[0], data[core.SEEN_FILM]) == (pytest.approx(film, rel=1e-9), pytest.approx(film, rel=1e-9))
    h = max(film, 1e-9 * rough)
    if h < ring[0, 5]:
        a[:6, :6] += min(0.3 * ((ring[0, 5] / h) ** 1.5 - 1.0), 1e3) * np.outer(j, j)
    if h < rough:
        weight[:6] -= load * (rough / h - 1.0) * j
    force = weight + field + data[core.SEEN_DRIVE_TORQUE] * case.along
    free = slice(0, 6 if fixed else 7)
    q = np.zeros(7)
    q[free] = np.linalg.solve(a[free, free], force[free])
    assert data[:7] == pytest.approx(q, rel=1e-8)
    check_motion(case, data, dy)


@pytest.fixture(scope="module")
def table() -> np.ndarray:
    batch = RobotBatch.of(sp.load("biorob2012-wide"))
    found = find_table(*in_tube(batch))
    assert found is not None
    return found.packed


def fluid_at(table: np.ndarray, case: Case) -> np.ndarray:
    """The table's 8x8 at a state's place, in body axes."""
    side = case.state[1:3]
    e, (d, y) = np.hypot(*side), (case.axes[:, 0], case.axes[:, 1])
    z_loc = np.array([0.0, *(-side / e)])
    y_loc = np.cross(z_loc, [1.0, 0.0, 0.0])
    pitch, yaw = np.arcsin(d @ z_loc), np.arctan2(d @ y_loc, d[0])
    across = np.array([-np.sin(yaw), 0.0, 0.0]) + np.cos(yaw) * y_loc
    roll = np.arctan2(y @ np.cross(d, across), y @ across)
    out = np.empty((8, 8))
    assert resistance_at(table, e, pitch, yaw, roll + case.state[7], out) == 0
    return VISCOSITY * about_x(-roll) @ out @ about_x(-roll).T


@pytest.mark.parametrize(("kind", "fixed"), DRIVES)
@pytest.mark.parametrize("ends", [core.CLOSED, core.OPEN, core.IMPOSED])
@pytest.mark.parametrize("gap", [2e-3, 6e-5])
def test_rates_in_a_tube(table: np.ndarray, kind: float, fixed: float, ends: float, gap: float) -> None:
    """The rates leave nothing of the forces as NumPy assembles them, contact and dry friction included."""
    case, rough = Case(kind, fixed, gap), 4e-4
    tube = np.array([RADIUS, rough, 0.05, MU, SLOW, VISCOSITY, ends, 0.5, np.inf])
    sites = np.array([[0.0085, 0.0, 0.0, 0.009, 0.0], [-0.0175, 0.0085, 0.0, 0.0005, 1.0]])
    flow = np.array([[0.0, 0.0], [0.5, 1e-3], [1.0, 3e-3], [2.0, 0.0]])
    counts, wire = np.array([len(sites), 0.0]), np.zeros(6)
    data = packed(case.friction, case.weight, case.drive, tube, counts, wire, sites, flow)
    dy, gaps = np.empty(19), np.empty(3)
    core.rates(dy, 0.7, case.state, data, table)
    core.gaps_of(case.state, data, table, gaps)
    q, m = data[:7], fluid_at(table, case)
    weight, field = case.loads(0.7)
    mean_flow = 1e-3 + 0.4 * 2e-3 if ends == core.IMPOSED else 0.0
    if ends == core.OPEN:
        mean_flow = m[7, :7] @ q / (8.0 * np.pi * 0.5 * VISCOSITY + m[7, 7])
    assert data[core.SEEN_MEAN_FLOW] == pytest.approx(mean_flow, rel=1e-9)
    against = m[:7, :7] @ q - m[:7, 7] * mean_flow
    left = weight + field + data[core.SEEN_DRIVE_TORQUE] * case.along - against - case.friction @ q
    lost = normal_force = 0.0
    for site, found in zip(sites, gaps, strict=False):
        normal, point, j, rows = np.empty(3), np.empty(3), np.empty(7), np.empty((2, 7))
        assert core.ring_gap(case.state, case.axes, RADIUS, site, normal, point, j) == found
        load = core.asperity_load(found, rough, 0.05)
        for row, way in zip(rows, (case.axes[0], np.cross(case.axes[0], normal)), strict=True):
            turning = np.cross(point, way)
            row[:] = *way, *turning, site[4] * turning[0]
        sliding = rows @ q
        drag = MU * load / np.sqrt(sliding @ sliding + SLOW**2)
        left -= load * j + drag * rows.T @ sliding
        lost += drag * sliding @ sliding
        normal_force += load
    if fixed:
        assert q[6] == 0.0
        left[6] = 0.0
    scale = np.abs(weight) + np.abs(against) + np.abs(case.friction @ q) + normal_force * np.array([1] * 3 + [0.01] * 4)
    assert left == pytest.approx(np.zeros(7), abs=1e-9 * scale.max())
    assert (normal_force > 0.0) == (gap < rough)
    assert data[[core.SEEN_CONTACT_FORCE, core.SEEN_CONTACT_POWER]] == pytest.approx([normal_force, lost], rel=1e-9)
    check_motion(case, data, dy)


def test_steps_are_those_of_another_method() -> None:
    """A robot that a field turns, by an explicit method of order 8."""
    case, none = Case(3.0, 1.0, 1e-3), np.zeros(0)
    case.weight *= 1e-3
    case.drive[core.DRIVE_FIELD_RATE] = 3.0
    case.drive[core.DRIVE_MOMENT : core.DRIVE_MOMENT + 3] *= 1e-3
    data = packed(case.friction, case.weight, case.drive, case.drag, np.full(4, np.inf))
    y, dy = case.state.copy(), np.empty(19)
    y[3:7] /= np.linalg.norm(y[3:7])

    def rates(time: float, state: np.ndarray) -> np.ndarray:
        core.rates(dy, time, state, data, none)
        return dy.copy()

    times = np.linspace(0.0, 2.0, 9)[1:]
    expected = solve_ivp(rates, (0.0, 2.0), y, method="DOP853", t_eval=times, rtol=1e-11, atol=1e-13).y.T
    memory, found = np.zeros(core.MEMORY_SIZE), np.empty((8, 19))
    memory[core.MEMORY_STEP] = 1e-4
    sizes, limits = np.append(np.ones(19), [1e-6, 1.0]), np.array([np.inf, 0.0, 0.0, 0.0, np.inf])
    sizes[:3] = 0.01
    end = core.advance(
        2.0, True, 100_000, 1e-9, memory, y, y.copy(), np.zeros((8, 19)), np.zeros((8, 8)), np.ones(4), times,
        found, sizes, limits, 0.0, data, none,
    )  # fmt: skip
    assert (end, memory[core.MEMORY_ANSWERED], memory[core.MEMORY_TIME]) == (core.DONE, 8.0, 2.0)
    assert found == pytest.approx(expected, abs=1e-6)
    assert np.abs(expected[-1, 3:7] - case.state[3:7]).max() > 0.1
