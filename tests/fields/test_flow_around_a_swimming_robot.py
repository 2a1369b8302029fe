"""The flow of `sp.flow` sticks to the moving robot, keeps its mass, and nothing pushes the robot along."""

import numpy as np
import pytest

import spirillum as sp

WIDE = {"extends": "biorob2012-wide", "tail": {"length": "30 mm"}}
PHASE = np.radians(40.0)


@pytest.fixture(scope="module")
def swimming() -> sp.Flow:
    """The paper's robot at one phase of its tail."""
    return sp.flow(WIDE, tail_rate="1.2 Hz", phase=PHASE, model="slender")


def _directions(count: int) -> np.ndarray:
    """Points spread over the unit sphere, in pairs opposite to each other."""
    k = np.arange(count) + 0.5
    polar, turn = np.arccos(1.0 - 2.0 * k / count), np.pi * (1.0 + np.sqrt(5.0)) * k
    half = np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], axis=1)
    return np.concatenate([half, -half])


def test_motion_is_the_predicted_one(swimming: sp.Flow) -> None:
    alone = sp.predict(WIDE, model="slender", tail_rate="1.2 Hz", calibrated=False, resolution={"accuracy": "high"})
    assert swimming.prediction.forward_velocity == alone.forward_velocity
    assert swimming.prediction.calibrated is False


def test_fluid_sticks_to_the_body(swimming: sp.Flow) -> None:
    motion = swimming.prediction
    angle = np.linspace(0.0, 2 * np.pi, 12, endpoint=False)
    for x in (-0.010, 0.0, 0.006):
        points = np.stack([np.full(12, x), 0.009001 * np.cos(angle), 0.009001 * np.sin(angle)], axis=1)
        wall = np.array([motion.forward_velocity, 0, 0]) + np.cross([motion.body_rotation_rate, 0, 0], points)
        np.testing.assert_allclose(swimming.velocity(points), wall, atol=2e-3 * np.abs(wall).max())


def test_fluid_follows_the_wire(swimming: sp.Flow) -> None:
    """Around the wire the fluid moves with it, to the accuracy of a line of blobs, which is blurred there."""
    from spirillum.view.figures.scene import wire_lines

    motion = swimming.prediction
    (line,) = wire_lines(swimming.robot, PHASE, 1.0)
    place = len(line) // 2
    middle, tangent = line[place], line[place + 1] - line[place - 1]
    outward = np.array([0.0, *middle[1:]]) / np.linalg.norm(middle[1:])
    sideways = np.cross(tangent / np.linalg.norm(tangent), outward)
    angle = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)[:, None]
    points = middle + 0.52e-3 * (np.cos(angle) * outward + np.sin(angle) * sideways)
    wall = np.array([motion.forward_velocity, 0, 0]) + np.cross([motion.tail_rotation_rate, 0, 0], points)
    found = swimming.velocity(points)
    np.testing.assert_allclose(found.mean(axis=0), wall.mean(axis=0), atol=0.2 * np.linalg.norm(wall.mean(axis=0)))
    np.testing.assert_allclose(found, wall, atol=0.35 * np.abs(wall).max())
    assert swimming.inside(middle[None, :]).all()


def test_a_point_inside_is_named_with_its_part(swimming: sp.Flow) -> None:
    from spirillum.view.figures.scene import wire_lines

    (line,) = wire_lines(swimming.robot, PHASE, 1.0)
    for point, part in (((0.0, 0.0, 0.0), "body"), ((-0.022, 0.0, 0.0), "coupling"), (line[len(line) // 2], "tail")):
        points = np.array([[0.1, 0.0, 0.0], point])
        assert list(swimming.inside(points)) == [False, True]
        with pytest.raises(sp.InputError, match=f"point 1 = .* inside the {part}"):
            swimming.velocity(points)
        with pytest.raises(sp.InputError, match=part):
            swimming.pressure(points)


def test_as_much_flows_in_as_out(swimming: sp.Flow) -> None:
    normals = _directions(600)
    out = np.sum(swimming.velocity(0.1 * normals + np.array([-0.03, 0, 0])) * normals, axis=1)
    assert abs(out.mean()) < 1e-3 * np.abs(out).mean()


def test_nothing_pushes_the_swimmer_along(swimming: sp.Flow) -> None:
    """Far away on the axis, what is even in x is a force's, F/(4 pi mu r); sideways forces have no part in it."""
    mu, distance = swimming.robot.fluid.viscosity, 5.0
    along = swimming.velocity(np.array([[distance, 0.0, 0.0], [-distance, 0.0, 0.0]]))[:, 0]
    force = 2.0 * np.pi * mu * distance * along.sum()
    drag = 6.0 * np.pi * mu * 0.009 * swimming.prediction.forward_velocity
    assert abs(force) < 0.01 * drag


def test_tail_pumps_fluid_backwards(swimming: sp.Flow) -> None:
    angle = np.linspace(0.0, 2 * np.pi, 40, endpoint=False)
    axis = np.zeros((1, 3))
    for x in (-0.05, -0.044, -0.038):
        axis[0, 0] = x
        assert swimming.velocity(axis)[0, 0] < -swimming.prediction.forward_velocity
        ring = np.stack([np.full(40, x), 0.02 * np.cos(angle), 0.02 * np.sin(angle)], axis=1)
        assert abs(swimming.velocity(ring)[:, 0].mean()) < abs(swimming.velocity(axis)[0, 0])


def test_turning_the_tail_turns_the_flow(swimming: sp.Flow) -> None:
    cos, sin = np.cos(PHASE), np.sin(PHASE)
    turn = np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])
    at_rest = sp.flow(WIDE, tail_rate="1.2 Hz", phase="0 deg", frame="body", model="slender")
    points = np.array([[-0.06, 0.006, 0.001], [-0.02, 0.01, -0.02], [0.03, 0.0, 0.01]])
    turned = swimming.velocity(points @ turn.T) - np.array([swimming.prediction.forward_velocity, 0, 0])
    np.testing.assert_allclose(turned, at_rest.velocity(points) @ turn.T, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(swimming.pressure(points @ turn.T), at_rest.pressure(points), rtol=1e-9)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"frame": "tail"}, "frame = 'tail'.*allowed: lab, body"),
        ({"phase": "40"}, 'phase = "40" has no unit'),
        ({"tail_rate": "0 Hz"}, "a tail at rest"),
        ({"friction": "ice"}, "friction = 'ice'"),
        ({"resolution": {"accuracy": "perfect"}}, "accuracy = 'perfect'"),
    ],
)
def test_wrong_questions_are_named(arguments: dict[str, str], words: str) -> None:
    with pytest.raises(sp.InputError, match=words):
        sp.flow(WIDE, **arguments, model="slender")
