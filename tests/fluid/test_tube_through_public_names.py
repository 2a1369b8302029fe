"""The model `tube` through its public names: ends, imposed flow, domain sentences, error estimate, the cache."""

import hashlib
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.fluid.algebra import joint_locked
from spirillum.fluid.registry import find_swimmer_model
from spirillum.fluid.tube.cache import cache_folder
from spirillum.fluid.tube.tube import END_LOSS, unit_motions
from spirillum.robot.placement import Placement

MODEL: Any = find_swimmer_model("tube")
ZERO = np.zeros(1)
SMALL = {
    "body.shape": "sphere",
    "body.length": "18 mm",
    "body.front": "none",
    "body.rear": "none",
    "coupling.diameter": "0 mm",
    "tail.length": "20 mm",
    "tail.wavelength": "20 mm",
    "tail.wire_diameter": "1.5 mm",
}
"""A ball as wide as the paper's body with a short and thick tail: an answer takes a fraction of a second."""


@pytest.fixture(scope="module")
def robot() -> Any:
    return sp.load("biorob2012-wide", **SMALL)


@pytest.fixture(scope="module")
def batch(batch_of: Callable[..., Any]) -> Any:
    """That robot 4 mm over the floor, at a coarse tolerance and one phase."""
    made = batch_of(**SMALL, **{"model.tube.tolerance": 0.04, "model.tube.phases": 1})
    return replace(made, placement=Placement.of({"gap": "4 mm"}))


def placed(batch: Any, **fields: Any) -> Any:
    return replace(batch, placement=Placement.of({"gap": "4 mm", **fields}))


def predicted(robot: Any, **options: Any) -> Any:
    options = {"placement": {"gap": "4 mm"}, "resolution": {"tolerance": 0.04, "phases": 1}, **options}
    return sp.predict(robot, model="tube", tail_rate="1.2 Hz", **options)


def refused(call: Callable[[], Any]) -> str:
    with pytest.raises(sp.InputError) as caught:
        call()
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_ends_are_one_scalar(batch: Any) -> None:
    """Open: load load'/(8 pi mu (L + 1.09 R) + drag) less than closed; no length at all is no pressure drop."""
    held = unit_motions(batch)
    mu, length, radius = (
        float(batch.viscosity[0]),
        float(batch.channel_length[0]),
        0.5 * float(batch.channel_diameter[0]),
    )
    closed = MODEL.resistance(placed(batch, ends="closed"), ZERO)[0]
    np.testing.assert_allclose(closed, mu * held.matrix, atol=1e-12 * mu * np.max(np.abs(held.matrix)))
    opened = MODEL.resistance(batch, ZERO)[0]
    wanted = mu * (
        held.matrix - np.outer(held.load, held.load) / (8 * np.pi * (length + END_LOSS * radius) + held.drag)
    )
    np.testing.assert_allclose(opened, wanted, atol=1e-12 * np.max(np.abs(closed)))
    short = replace(batch, channel_length=np.array([0.12]))
    no_drop = mu * (held.matrix - np.outer(held.load, held.load) / held.drag)
    drags = [joint_locked(m)[0, 0] for m in (closed, opened, MODEL.resistance(short, ZERO)[0], no_drop)]
    assert np.all(np.diff(drags) < 0)
    long = replace(batch, channel_length=np.array([900.0]))
    assert np.linalg.eigvalsh(opened / np.sqrt(np.outer(np.diag(opened), np.diag(opened))))[0] > 0
    far = MODEL.resistance(replace(long, placement=Placement.of({"gap": "4 mm", "ends": "open"})), ZERO)[0]
    np.testing.assert_allclose(np.diag(far), np.diag(closed), rtol=1e-3)


def test_an_imposed_flow_is_closed_and_a_load(batch: Any) -> None:
    """The same matrix, the wrench of that flow on the robot at rest, and the mean flow that was asked for."""
    flowing, closed = placed(batch, flow="2 mm/s"), placed(batch, ends="closed")
    np.testing.assert_array_equal(MODEL.axial(flowing), MODEL.axial(closed))
    held = unit_motions(batch)
    wanted = 2e-3 * float(batch.viscosity[0]) * held.load[[0, 3, 6, 9]]
    moved = MODEL.axial_flow(flowing)
    np.testing.assert_allclose(moved.load[0], wanted, rtol=1e-12)
    np.testing.assert_array_equal(moved.mean_flow, [[0, 0, 0, 0, 2e-3]])
    assert np.all(MODEL.axial_flow(closed).load == 0)
    back = placed(batch, flow="-2 mm/s")
    np.testing.assert_array_equal(MODEL.axial_flow(back).load, -moved.load)


def test_plug(batch: Any, robot: Any) -> None:
    """The mean flow of the open tube balances: what robot and ends resist is what the robot's motion drives."""
    answer = predicted(robot)
    held = unit_motions(batch)
    rates = np.array(
        [answer.forward_velocity, answer.body_rotation_rate, answer.forward_velocity, answer.tail_rotation_rate]
    )
    length = float(batch.channel_length[0]) + END_LOSS * 0.5 * float(batch.channel_diameter[0])
    plug = held.load[[0, 3, 6, 9]] @ rates / (8 * np.pi * length + held.drag)
    np.testing.assert_allclose(answer.plug_velocity, plug, rtol=1e-9)
    assert predicted(robot, placement={"gap": "4 mm", "ends": "closed"}).plug_velocity == 0
    assert predicted(robot, placement={"gap": "4 mm", "flow": "1 mm/s"}).plug_velocity == pytest.approx(1e-3)


def test_viscosity_and_scale(batch: Any) -> None:
    """Everything in proportion to the viscosity; all lengths times s: forces s, couplings s^2, torques s^3."""
    found = MODEL.resistance(batch, ZERO)[0]
    thick = MODEL.resistance(replace(batch, viscosity=7.0 * batch.viscosity), ZERO)[0]
    np.testing.assert_allclose(thick, 7 * found, rtol=1e-13)
    s = 2.0**-8
    columns = {
        "body.diameter": batch.body_diameter,
        "body.length": batch.body_length,
        "tail.wavelength": batch.wavelength,
        "tail.amplitude": batch.amplitude,
        "tail.length": batch.tail_length,
        "tail.wire_diameter": batch.wire_diameter,
        "coupling.length": batch.coupling_length,
        "coupling.clearance": batch.coupling_clearance,
        "channel.diameter": batch.channel_diameter,
        "channel.length": batch.channel_length,
    }
    small = batch.with_values({name: s * column for name, column in columns.items()})
    small = replace(small, placement=Placement.of({"gap": 4e-3 * s}))
    units = np.diag(np.tile([1.0, 1, 1, s, s, s], 2))
    wanted = s * units @ found @ units
    scale = np.sqrt(np.outer(np.diag(wanted), np.diag(wanted)))
    np.testing.assert_allclose(MODEL.resistance(small, ZERO)[0] / scale, wanted / scale, atol=1e-8)


def test_mirror_images(batch: Any) -> None:
    """A left-handed tail at the mirrored phase: y changes sign, and rotations about x and z."""
    right = MODEL.resistance(batch, np.array([0.6]))[0]
    left = MODEL.resistance(replace(batch, hand=-batch.hand), np.array([np.pi - 0.6]))[0]
    mirror = np.tile([1.0, -1, 1, -1, 1, -1], 2)
    scale = np.sqrt(np.outer(np.diag(right), np.diag(right)))
    np.testing.assert_allclose(left / scale, mirror[:, None] * right * mirror / scale, atol=1e-7)


def test_phases_are_averaged(batch: Any) -> None:
    four = replace(
        batch, options=batch.options.model_copy(update={"tube": batch.options.tube.model_copy(update={"phases": 2})})
    )
    closed = placed(four, ends="closed")
    each = [
        MODEL.resistance(closed, np.array([phase]))[0][np.ix_([0, 3, 6, 9], [0, 3, 6, 9])] for phase in (0.0, np.pi)
    ]
    np.testing.assert_allclose(MODEL.axial(closed)[0], np.mean(each, axis=0), rtol=1e-12)
    assert np.max(np.abs(each[0] / each[1] - 1)) > 1e-5


def test_parts_take_less_power_than_the_robot(batch: Any) -> None:
    """Least dissipation, closed ends: a part with another one added resists every motion more."""
    closed = placed(batch, ends="closed")
    parts = {part: MODEL.part_matrix(closed, part, ZERO)[0] for part in ("body", "tail", "rotor", "robot")}
    for part in ("body", "tail"):
        scale = np.sqrt(np.diag(parts["robot"]))
        assert np.linalg.eigvalsh((parts["robot"] - parts[part]) / np.outer(scale, scale))[0] > -1e-3
    np.testing.assert_allclose(parts["rotor"], parts["tail"], rtol=1e-12)
    assert "this robot has none" in refused(lambda: MODEL.part_matrix(closed, "coupling", ZERO))


def test_a_wide_channel_gives_slender(batch: Any) -> None:
    """R = 100 lengths of the robot, on the axis: 1.2 % of the drag, in R to infinity none."""
    high = batch.options.model_copy(update={"slender": batch.options.slender.model_copy(update={"accuracy": "high"})})
    slender = find_swimmer_model("slender").resistance(replace(batch, options=high), ZERO)[0]
    scale = np.sqrt(np.outer(np.diag(slender), np.diag(slender)))
    errors = []
    for radius in (2.0, 8.0):
        wide = batch.with_values(
            {"channel.diameter": np.array([2 * radius]), "channel.length": np.array([50 * radius])}
        )
        wide = replace(wide, placement=Placement.of({"eccentricity": 0.0, "ends": "closed"}))
        errors.append(np.max(np.abs(MODEL.resistance(wide, ZERO)[0] - slender) / scale))
    assert errors[0] < 0.03
    assert errors[1] < 0.35 * errors[0]


def test_error_estimate(robot: Any) -> None:
    """There is one, and it is not nothing, at the smallest and the largest tolerance that it takes to be quick."""
    for tolerance in (0.05, 0.02):
        answer = predicted(robot, resolution={"tolerance": tolerance, "phases": 2})
        assert 0 < answer.error_estimate < 2 * tolerance, tolerance
    assert answer.to_dict()["error_estimate"]["value"] == answer.error_estimate


def test_error_estimate_holds_what_few_phases_miss(robot: Any) -> None:
    """The second harmonic of the tail's phase stays in a mean over two of them; what wires cost is in both errors."""
    few, many = (predicted(robot, resolution={"tolerance": 0.05, "phases": phases}) for phases in (2, 5))
    missed = abs(few.forward_velocity / many.forward_velocity - 1.0)
    assert missed < few.error_estimate - many.error_estimate


def test_placement_of_an_answer() -> None:
    """Of a small ball, which is solved for in less time than a capsule; its default gap is 1/18 of its radius."""
    robot = sp.load("biorob2012-wide", **{**SMALL, "body.diameter": "12 mm", "body.length": "12 mm"})
    found = predicted(robot, placement={"gap": "4 mm", "pitch": "2 deg"}).to_dict()["placement"]
    assert found["kind"] == "in the channel"
    assert found["ends"] == "open"
    assert found["gap"]["value"] == pytest.approx(4e-3, rel=1e-6)
    assert found["pitch"]["value"] == pytest.approx(np.radians(2))
    default = sp.resistance(robot, model="tube", part="body", resolution={"tolerance": 0.05}).to_dict()["placement"]
    assert default["gap"]["value"] == pytest.approx(6e-3 / 18, rel=1e-6)


def test_refusals(robot: Any) -> None:
    """One sentence each: no channel, no room, too thin a film, a tail in the glass, and where."""
    no_channel = sp.load("biorob2012-wide", **SMALL, channel="none")
    assert "channel.diameter" in refused(lambda: predicted(no_channel, placement=None))
    assert "at most 11 mm" in refused(lambda: predicted(robot, placement={"gap": "12 mm"}))
    assert "at least" in refused(lambda: predicted(robot, placement={"gap": "1 um"}))
    sentence = refused(lambda: predicted(robot, placement={"gap": "1 mm", "pitch": "30 deg"}))
    assert "phase" in sentence
    assert "tail" in sentence
    assert "deg" in sentence
    assert "phase" in refused(lambda: predicted(robot, placement={"gap": "1 mm", "tail_drop": "8 mm"}))
    for bad in (float("nan"), "nan m/s"):
        assert "placement.flow" in refused(lambda bad=bad: predicted(robot, placement={"gap": "4 mm", "flow": bad}))
    assert "simulate" not in refused(lambda: sp.resistance(robot, model="tube", part="nose"))


@pytest.fixture
def fresh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache folder of its own, and nothing in memory."""
    monkeypatch.setenv("SPIRILLUM_CACHE", str(tmp_path))
    _forget()
    yield tmp_path
    _forget()


def _forget() -> None:
    from spirillum.fluid.tube import tube

    tube._answer.cache_clear()


PRINT = """
import numpy as np, spirillum as sp
import spirillum.fluid.tube.tube as tube
def refuse(*arguments):
    raise AssertionError("computed anew")
tube.solve_unit_motions = refuse
robot = sp.load("biorob2012-wide")
asked = {"placement": {"gap": "4 mm", "ends": "closed"}, "resolution": {"tolerance": 0.04}}
answer = sp.resistance(robot, model="tube", part="body", **asked)
print([float(value).hex() for value in np.ravel(answer.matrix)])
"""


def test_another_process_finds_the_same_numbers(fresh: Path) -> None:
    environment = {**os.environ, "SPIRILLUM_CACHE": str(fresh)}

    def run() -> str:
        done = subprocess.run(
            [sys.executable, "-c", PRINT], env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    asked = {"placement": {"gap": "4 mm", "ends": "closed"}, "resolution": {"tolerance": 0.04}}
    made = sp.resistance("biorob2012-wide", model="tube", part="body", **asked)
    assert len(list(fresh.rglob("*.f64"))) == 1
    assert run().strip() == str([float(value).hex() for value in np.ravel(made.matrix)])


def test_a_damaged_cache_is_computed_anew(fresh: Path, batch: Any) -> None:
    first = MODEL.part_matrix(batch, "body", ZERO)
    files = list(fresh.rglob("*.f64"))
    assert files
    whole = files[0].read_bytes()
    flipped = bytearray(whole)
    flipped[100] ^= 1
    for damage in (whole[: len(whole) // 2], b"", b"not numbers", b"PK\3\4" + whole, bytes(flipped), bytes(len(whole))):
        files[0].write_bytes(damage)
        _forget()
        np.testing.assert_array_equal(MODEL.part_matrix(batch, "body", ZERO), first)
        assert files[0].read_bytes() == whole
    content = (2.0 * np.frombuffer(whole[32:])).tobytes()
    files[0].write_bytes(hashlib.sha256(content).digest() + content)
    _forget()
    assert np.max(MODEL.part_matrix(batch, "body", ZERO)) > 1.5 * np.max(first)  # it is the file that answers
    assert not [path for path in fresh.rglob("*") if path.is_file() and path.suffix != ".f64"]


def test_no_cache(fresh: Path, batch: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    for named in ("off", str(fresh / "file" / "below")):
        (fresh / "file").write_text("in the way")
        monkeypatch.setenv("SPIRILLUM_CACHE", named)
        _forget()
        assert cache_folder() is None
        assert np.all(np.isfinite(MODEL.part_matrix(batch, "body", ZERO)))
    assert not list(fresh.rglob("*.f64"))


def test_other_questions_have_other_answers(fresh: Path, batch: Any) -> None:
    """Gap, part, phase, tolerance and hand are in the key; viscosity and ends are not."""
    MODEL.resistance(batch, ZERO)
    asked = [
        (placed(batch, ends="closed"), 0.0, 0),
        (replace(batch, viscosity=2 * batch.viscosity), 0.0, 0),
        (replace(batch, placement=Placement.of({"gap": "4.1 mm"})), 0.0, 1),
        (batch, 0.3, 1),
        (replace(batch, hand=-batch.hand), 0.0, 1),
        (placed(batch, tail_drop="1 mm"), 0.0, 1),
    ]
    count = len(list(fresh.rglob("*.f64")))
    for other, phase, more in asked:
        MODEL.resistance(other, np.array([phase]))
        count += more
        assert len(list(fresh.rglob("*.f64"))) == count
