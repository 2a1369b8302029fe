"""The model `slender` as its users meet it: parts, batches, wrong input, accuracy, and the paper's robot."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.fluid.closed.perrin import spheroid_drag
from spirillum.fluid.registry import MODELS, SWIMMER_MODELS, find_swimmer_model

PRESET = "biorob2012-wide"
PARTS = ("body", "coupling", "tail", "rotor", "robot")


def robot(**overrides: Any) -> sp.Robot:
    return sp.load(PRESET, **{name.replace("__", "."): value for name, value in overrides.items()})


def refused(call: Callable[[], object]) -> str:
    with pytest.raises(sp.InputError) as caught:
        call()
    text = str(caught.value)
    assert len(text.splitlines()) == 1
    return text


def test_it_is_a_model_that_swims() -> None:
    assert SWIMMER_MODELS["slender"] is MODELS["slender"]
    assert MODELS["slender"].parts == PARTS
    assert not MODELS["slender"].closed_form
    assert "Cortez" in str(sp.citation("slender"))


@pytest.mark.parametrize("part", PARTS)
def test_every_part(part: str) -> None:
    """Symmetric positive definite 6x6; the robot is the default."""
    answer = sp.resistance(PRESET, part=part, model="slender")
    np.testing.assert_allclose(answer.matrix, answer.matrix.T, rtol=1e-12, atol=1e-15)
    np.linalg.cholesky(answer.matrix)
    assert answer.to_dict()["part"] == part
    if part == "robot":
        np.testing.assert_array_equal(sp.resistance(PRESET, model="slender").matrix, answer.matrix)


def test_body_is_the_exact_spheroid() -> None:
    """For this shape `slender` and `perrin` are the same body."""
    spheroid = robot(body__shape="spheroid", body__front=None, body__rear=None)
    found = sp.resistance(spheroid, part="body", model="slender").matrix
    np.testing.assert_allclose(
        found, sp.resistance(spheroid, part="body", model="perrin").matrix, rtol=1e-8, atol=1e-12
    )
    drag = np.ravel(spheroid_drag(np.array([3.5]), np.array([17.5e-3]), np.array([9e-3])))
    np.testing.assert_allclose(np.diag(found)[[0, 1, 3, 4]], drag, rtol=1e-8)


def test_reference_point_and_phase() -> None:
    """About the tail's root the same power is dissipated; turned by a whole turn nothing changes."""
    here = sp.resistance(PRESET, part="robot", model="slender", phase=0.4)
    there = sp.resistance(PRESET, part="robot", model="slender", phase=0.4 + 2 * np.pi, about="tail-root")
    twist = np.array([1e-3, 2e-3, -1e-3, 0.3, -0.1, 0.2])
    root = np.array([-27.5e-3, 0.0, 0.0])
    moved = twist.copy()
    moved[:3] += np.cross(twist[3:], root)
    assert twist @ here.matrix @ twist == pytest.approx(moved @ there.matrix @ moved, rel=1e-11)


def test_rotor_is_coupling_and_tail() -> None:
    alone = {part: sp.resistance(PRESET, part=part, model="slender").matrix for part in PARTS}
    rotor, tail, coupling = alone["rotor"], alone["tail"], alone["coupling"]
    # The coupling carries nearly half of the rotor's torque (it is outside of the tail's flow, almost).
    assert 0.35 < coupling[3, 3] / rotor[3, 3] < 0.5
    assert max(tail[0, 0], coupling[0, 0]) < rotor[0, 0] < tail[0, 0] + coupling[0, 0]
    assert rotor[3, 3] == pytest.approx(tail[3, 3] + coupling[3, 3], rel=0.03)


def test_paper_robot_swims_forward_and_turns_back() -> None:
    """A right-handed tail that turns about +x pushes forward, the body turns back; adding parts up overstates it."""
    answer = sp.predict(PRESET, model="slender", tail_rate="1 Hz", calibrated=False)
    left = sp.predict(robot(tail__handedness="left"), model="slender", tail_rate="-1 Hz", calibrated=False)
    assert answer.forward_velocity > 0
    assert answer.body_rotation_rate < 0
    assert left.forward_velocity == pytest.approx(answer.forward_velocity, rel=1e-10)
    assert left.body_rotation_rate == pytest.approx(-answer.body_rotation_rate, rel=1e-10)
    assert answer.dissipated_power > 0


def test_flow_between_body_and_bare_tail_slows_the_robot(wide: Any) -> None:
    """Adding isolated matrices overstates the speed of body and tail by 15 to 20 %."""
    bare = wide.with_values({"coupling.diameter": 0.0})
    model = find_swimmer_model("slender")
    together = sp.swim(bare, model, tail_rate=np.array([6.0]), calibrated=False)
    body, tail = (model.part_matrix(bare, part, np.zeros(1))[0] for part in ("body", "tail"))
    apart = -tail[0, 3] / (body[0, 0] + tail[0, 0]) * 6.0
    assert 1.15 < apart / together.forward_velocity[0] < 1.2


@pytest.mark.parametrize("accuracy", ["standard", "high"])
def test_accuracy(accuracy: str) -> None:
    """Both forms of the wire agree within what their statement says; the estimate is of that size."""
    answer = sp.predict(PRESET, model="slender", tail_rate="1 Hz", calibrated=False, resolution={"accuracy": accuracy})
    other = sp.predict(PRESET, model="slender", tail_rate="1 Hz", calibrated=False, resolution={"accuracy": "high"})
    assert answer.forward_velocity == pytest.approx(other.forward_velocity, rel=0.01)
    assert 0 < answer.error_estimate < 0.02
    assert answer.to_dict()["error_estimate"]["value"] == answer.error_estimate
    own = sp.predict(robot(model__slender__accuracy=accuracy), model="slender", tail_rate="1 Hz", calibrated=False)
    assert own.forward_velocity == answer.forward_velocity
    matrix = sp.resistance(PRESET, model="slender", resolution={"accuracy": accuracy}).matrix
    np.testing.assert_array_equal(
        matrix, sp.resistance(robot(model__slender__accuracy=accuracy), model="slender").matrix
    )


def test_narrow_channel_is_not_felt() -> None:
    """Unbounded fluid: the channel's diameter changes nothing but the warnings."""
    wide, narrow = (
        sp.predict(robot(channel__diameter=d), model="slender", tail_rate="1 Hz", calibrated=False)
        for d in ("40 mm", "30 mm")
    )
    assert wide.forward_velocity == narrow.forward_velocity
    assert wide.placement == {"kind": "unbounded fluid"}


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        (
            {"coupling__length": "0.4 mm", "coupling__clearance": "0.1 mm"},
            ("coupling.length = 0.4 mm", "more than 0.5 mm"),
        ),
        ({"coupling__clearance": "0.05 mm"}, ("coupling.clearance = 0.05 mm", "at least 0.06 mm")),
        ({"coupling__clearance": "0 mm"}, ("coupling.clearance = 0 mm", "at least 0.06 mm")),
        ({"coupling__length": "0 mm", "coupling__diameter": "0 mm"}, ("coupling.length = 0 mm", "more than 0.5 mm")),
        ({"tail__wire_diameter": "0.01 mm"}, ("tail.wire_diameter", "at most")),
    ],
    ids=lambda value: str(value)[:30],
)
def test_robot_outside_the_domain(overrides: dict[str, Any], said: tuple[str, str]) -> None:
    """One sentence with field, value and what is allowed; for the motion and for every part that it concerns."""
    outside = robot(**overrides)
    for call in (
        lambda: sp.predict(outside, model="slender", tail_rate="1 Hz"),
        lambda: sp.resistance(outside, part="robot", model="slender"),
    ):
        text = refused(call)
        assert text.startswith("biorob2012-wide with model 'slender': ")
        assert all(words in text for words in said)
    body = sp.resistance(outside, part="body", model="slender").matrix
    np.testing.assert_array_equal(body, sp.resistance(PRESET, part="body", model="slender").matrix)


def test_batch_with_robots_outside_the_domain(wide: Any) -> None:
    """NaN and valid = False for those, the others as if alone."""
    lengths = np.array([0.010, 0.0004, 0.012, np.nan])
    clearances = np.array([0.0005, 0.0001, 0.00001, 0.0005])
    batch = wide.with_values({"coupling.length": lengths, "coupling.clearance": clearances})
    found = sp.swim(batch, "slender", tail_rate=np.array([6.0]), calibrated=False)
    np.testing.assert_array_equal(found.valid, [True, False, False, False])
    alone = sp.swim(wide, "slender", tail_rate=np.array([6.0]), calibrated=False)
    assert found.forward_velocity[0] == pytest.approx(alone.forward_velocity[0], rel=1e-12)
    assert np.all(np.isnan(found.forward_velocity[1:]))
    assert np.all(np.isnan(found.dissipated_power[1:]))
    model = find_swimmer_model("slender")
    full = model.resistance(batch, np.zeros(1))
    assert full.shape == (4, 12, 12)
    assert np.all(np.isfinite(full[0]))
    assert np.all(np.isnan(full[1:]))


def test_batch_of_phases_and_viscosities(wide: Any) -> None:
    """Columns of different lengths broadcast; viscosity only scales."""
    from dataclasses import replace

    model = find_swimmer_model("slender")
    batch = replace(wide, viscosity=np.array([1.0, 2.0, 4.0]))
    matrices = model.resistance(batch, np.array([0.0, 0.0, np.pi]))
    np.testing.assert_allclose(matrices[1], 2 * matrices[0], rtol=1e-12, atol=1e-15)
    half_turn = np.kron(np.eye(4), np.diag([1.0, -1.0, -1.0]))
    np.testing.assert_allclose(matrices[2], 4 * half_turn @ matrices[0] @ half_turn, rtol=1e-9, atol=1e-12)
    phases = model.resistance(wide, np.linspace(0.0, 1.0, 5))
    assert phases.shape == (5, 12, 12)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: sp.resistance(PRESET, part="wing", model="slender"), "allowed: body, coupling, tail, rotor, robot"),
        (lambda: sp.resistance(PRESET, model="slendr"), "did you mean slender?"),
        (lambda: sp.resistance(PRESET, part="coupling", model="rft"), "part = 'coupling' with model 'rft'; allowed: "),
        (lambda: sp.resistance(PRESET, model="slender", about="nose"), "about = 'nose'; allowed: body, tail-root"),
        (lambda: sp.resistance(PRESET, model="slender", phase=float("nan")), "is not finite"),
        (
            lambda: sp.resistance(PRESET, model="slender", resolution={"accuracy": "bogus"}),
            "accuracy = 'bogus'; allowed: standard, high",
        ),
        (
            lambda: sp.predict(PRESET, model="slender", resolution={"accuracy": "bogus"}),
            "accuracy = 'bogus'; allowed: standard, high",
        ),
        (
            lambda: sp.predict(PRESET, model="slender", resolution={"accuracy": ""}),
            "accuracy = ''; allowed: standard, high",
        ),
        (lambda: robot(model__slender__accuracy="hihg"), "(did you mean high?)"),
        (lambda: robot(model__slender__acuracy="high"), "(did you mean accuracy?)"),
    ],
)
def test_wrong_input(call: Callable[[], object], said: str) -> None:
    assert said in refused(call)


def test_coupling_that_is_not_there(wide: Any) -> None:
    bare = wide.with_values({"coupling.diameter": 0.0})
    text = refused(lambda: MODELS["slender"].part_matrix(bare, "coupling", np.zeros(1)))
    assert "this robot has none" in text
    rotor, tail = (MODELS["slender"].part_matrix(bare, part, np.zeros(1)) for part in ("rotor", "tail"))
    np.testing.assert_array_equal(rotor, tail)
    uncoupled = robot(coupling={"length": "0 mm", "diameter": "0 mm", "clearance": "0 mm"})
    assert "this robot has none" in refused(lambda: sp.resistance(uncoupled, part="coupling", model="slender"))


def test_wire_that_touches_its_own_arm_is_left_out_of_a_batch(wide: Any) -> None:
    """The arm at a steep root is no part of the plain helix: only the whole wire shows that it is too thick."""
    values = {
        "tail.length": [0.06, 10.4e-3],
        "tail.wire_diameter": [1e-3, 7.6e-3],
        "tail.taper": [100.0, 8200.0],
        "tail.wavelength": [25e-3, 16.5e-3],
        "tail.amplitude": [2.5e-3, 7.6e-3],
    }
    answer = sp.swim(wide.with_values(values), "slender", tail_rate=np.array([7.5]))
    assert answer.valid.tolist() == [True, False]
    assert np.isfinite(answer.forward_velocity).tolist() == [True, False]


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ({"coupling.diameter": "1e-9 mm"}, "ratio of length and diameter of a thousand"),
        ({"tail.amplitude": "1100 mm", "tail.wavelength": "10 m"}, "hundredth of tail.amplitude"),
        ({"tail.wire_diameter": "0.05 mm"}, "at most 1500"),
    ],
)
def test_what_would_fill_the_memory_is_refused_at_once(overrides: dict[str, str], words: str) -> None:
    assert words in refused(lambda: sp.predict(sp.load(PRESET, channel="none", **overrides), model="slender"))


@pytest.mark.slow
def test_without_memory_for_a_check_there_is_no_estimate() -> None:
    """A thousand stations are too many for the check's first moments."""
    answer = sp.predict(sp.load(PRESET, **{"tail.wire_diameter": "0.14 mm"}), model="slender", tail_rate=7.5)
    assert np.isfinite(answer.forward_velocity)
    assert answer.to_dict()["error_estimate"]["value"] is None
