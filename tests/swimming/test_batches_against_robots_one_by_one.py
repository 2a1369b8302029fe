"""A batch answers as its robots do alone, block after block, whatever the robots beside them are."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.errors import InputError
from spirillum.robot.batch import RobotBatch, batches
from spirillum.robot.load import load
from spirillum.robot.robot import Robot
from spirillum.swimming.motions import STEADY
from spirillum.swimming.steady import swim

BLOCK = 1 << 15
WAVELENGTHS = np.array([10e-3, 15e-3, 20e-3, 25e-3])
AMPLITUDES = np.array([1.5e-3, 2.5e-3, 3.5e-3, 2.0e-3])
FRICTIONS = np.array([7e-7, 1e-6, 1e-5, 3e-5])
_NAMES = [item.name for item in STEADY]


def assert_equal(together: Any, i: int, alone: Any, rtol: float = 1e-13) -> None:
    for name in (*_NAMES, "valid"):
        np.testing.assert_allclose(getattr(together, name)[i], getattr(alone, name)[0], rtol=rtol, err_msg=name)


@pytest.fixture(scope="module")
def robots() -> list[Robot]:
    """One for each of the columns."""
    return [
        load(
            "biorob2012-wide",
            **{
                "tail.wavelength": f"{wavelength!r} m",
                "tail.amplitude": f"{amplitude!r} m",
                "friction.effective": f"{friction!r} N m s/rad",
            },
        )
        for wavelength, amplitude, friction in zip(
            WAVELENGTHS.tolist(), AMPLITUDES.tolist(), FRICTIONS.tolist(), strict=True
        )
    ]


@pytest.mark.parametrize("model", ["sbt", "rft"])
@pytest.mark.parametrize("reading", ["none", "rotor", "body", "paper"])
def test_columns_and_stacked_robots_agree_with_single_robots(
    robots: list[Robot], wide: Any, model: str, reading: str
) -> None:
    columns = wide.with_values(
        {"tail.wavelength": WAVELENGTHS, "tail.amplitude": AMPLITUDES, "friction.effective": FRICTIONS}
    )
    stacked = RobotBatch.of(robots)
    rates = np.array([3.0, 4.0, 5.0, 9.0])  # slower, B_eff of reading `paper` would exceed E_x
    for given in ({}, {"tail_rate": rates}, {"motor_rate": rates}):
        together, again = (
            swim(columns, model, friction=reading, **given),
            swim(stacked, model, friction=reading, **given),
        )
        assert together.valid.tolist() == [True] * 4
        for i, robot in enumerate(robots):
            one = {name: rate[i : i + 1] for name, rate in given.items()}
            alone = swim(RobotBatch.of(robot), model, friction=reading, **one)
            assert_equal(together, i, alone)
            assert_equal(again, i, alone)


def test_robots_of_a_batch_may_differ_in_hand_polarity_and_taper() -> None:
    robots = [
        load("biorob2012-wide", **changes)
        for changes in (
            {"tail.handedness": "left"},
            {"motor.polarity": "reverse"},
            {"tail.taper": "none"},
            {"tail.taper": 3.0, "drive.duty": 0.5},
        )
    ]
    for model in ("sbt", "rft"):
        together = swim(RobotBatch.of(robots), model)
        for i, robot in enumerate(robots):
            assert_equal(together, i, swim(RobotBatch.of(robot), model), rtol=1e-10)


def test_borders_between_blocks(wide: Any) -> None:
    size = 2 * BLOCK + 3
    rng = np.random.default_rng(1)
    wavelengths, rates = rng.uniform(10e-3, 40e-3, size), rng.uniform(1, 10, size)
    together = swim(wide.with_values({"tail.wavelength": wavelengths}), "sbt", tail_rate=rates)
    assert all(getattr(together, name).shape == (size,) for name in (*_NAMES, "valid"))
    assert together.valid.all()
    for i in (0, BLOCK - 1, BLOCK, 2 * BLOCK - 1, 2 * BLOCK, size - 1):
        one = wide.with_values({"tail.wavelength": wavelengths[i]})
        assert_equal(together, i, swim(one, "sbt", tail_rate=rates[i : i + 1]))


@pytest.mark.parametrize("size", [1, 5, BLOCK, BLOCK + 1])
def test_blocks_cover_the_batch_once(wide: Any, size: int) -> None:
    batch = wide.with_values({"tail.wavelength": np.arange(1.0, size + 1)}) if size > 1 else wide
    seen = [
        block.wavelength if block.size > 1 or size == 1 else np.broadcast_to(block.wavelength, (cut.stop - cut.start,))
        for cut, block in batch.blocks(BLOCK)
    ]
    np.testing.assert_array_equal(np.concatenate(seen), batch.wavelength)
    assert sum(cut.stop - cut.start for cut, _ in batch.blocks(BLOCK)) == size
    for _, block in batch.blocks(BLOCK):
        assert block.calibration["sbt"].body_drag.size == 1
        assert block.viscosity.size == 1


@pytest.mark.parametrize(
    ("model", "broken"),
    [
        ("rft", {"tail.wire_diameter": 7e-3}),  # c_t > c_n
        ("rft", {"tail.wavelength": 4e-3}),
        ("sbt", {"tail.wavelength": 0.4e-3, "tail.wire_diameter": 1e-6}),  # alpha below the table of A1, A2, A3
        ("sbt", {"tail.wire_diameter": 12e-3, "tail.amplitude": 1e-4}),  # q < 0
        ("sbt", {"tail.amplitude": 20e-3}),  # wider than the channel
        ("sbt", {"body.diameter": 41e-3}),
        ("sbt", {"tail.length": 400e-3}),
        ("sbt", {"body.length": 8e-3}),  # shorter than its nose
        ("sbt", {"tail.wire_diameter": 3e-3, "tail.wavelength": 2.5e-3}),  # turns touch
        ("sbt", {"coupling.clearance": 6e-3}),
        ("sbt", {"tail.wavelength": np.nan}),
        ("rft", {"tail.amplitude": np.nan}),
        ("rft", {"fluid.viscosity": np.nan}),
    ],
    ids=str,
)
def test_one_robot_that_cannot_be_leaves_the_others_alone(wide: Any, model: str, broken: dict[str, float]) -> None:
    fine = {path: getattr(wide, name)[0] for path, name in _ATTRIBUTES.items() if path in broken}
    batch = wide.with_values({path: [fine[path], value, fine[path]] for path, value in broken.items()})
    together, alone = swim(batch, model), swim(wide, model)
    assert together.valid.tolist() == [True, False, True]
    for name in _NAMES:
        values = getattr(together, name)
        assert np.isnan(values[1]), name
        np.testing.assert_allclose(values[[0, 2]], getattr(alone, name)[0], rtol=1e-12, err_msg=name)


_ATTRIBUTES = {
    "tail.wire_diameter": "wire_diameter",
    "tail.wavelength": "wavelength",
    "tail.amplitude": "amplitude",
    "tail.length": "tail_length",
    "body.diameter": "body_diameter",
    "body.length": "body_length",
    "coupling.clearance": "coupling_clearance",
    "fluid.viscosity": "viscosity",
}


def test_broken_requirement_names_field_value_limit_and_reason(wide: Any) -> None:
    from spirillum.fluid.registry import find_swimmer_model
    from spirillum.robot.limits import broken

    batch = wide.with_values({"tail.wire_diameter": [1e-3, 7e-3]})
    (limit,) = [limit for limit in broken(find_swimmer_model("rft").requirements(batch)) if "rft" in limit.flag]
    assert int(np.argmin(limit.holds)) == 1
    sentence = limit.sentence(1)
    # exp(1.5) 7 mm = 31.37 mm
    assert sentence.startswith("tail.wavelength = 25 mm; allowed: more than 31.37 mm, because")


def test_with_values_refuses_what_a_batch_cannot_vary(wide: Any) -> None:
    with pytest.raises(InputError, match=r"tail\.handedness cannot vary in a batch; allowed: .*tail\.taper"):
        wide.with_values({"tail.handedness": 1.0})
    with pytest.raises(InputError, match=r"columns of a batch have lengths \[1, 2, 3\]; allowed: one length, or 1"):
        wide.with_values({"tail.wavelength": [0.02, 0.03], "tail.amplitude": [1e-3, 2e-3, 3e-3]})


@pytest.mark.parametrize("name", ["tail_rate", "motor_rate"])
def test_rates_have_to_match_the_batch(wide: Any, name: str) -> None:
    batch = wide.with_values({"tail.wavelength": WAVELENGTHS})
    with pytest.raises(InputError, match=rf"{name} has shape \(3,\); allowed: one value, or 4, one for each robot"):
        swim(batch, **{name: np.ones(3)})
    for one in (2.0, [2.0]):
        assert_equal(sp.swim(wide, "sbt", **{name: one}), 0, swim(wide, "sbt", **{name: np.array([2.0])}))
    assert sp.swim(batch, "sbt", **{name: [1.0, 2.0, 3.0, 4.0]}).valid.all()


@pytest.mark.parametrize(
    "wrong", [np.nan, [np.nan, np.nan], None, True, "1", [1.0, None], 10**400, [[1], [2, 3]]], ids=str
)
def test_values_of_a_batch_have_to_be_numbers(wide: Any, wrong: Any) -> None:
    with pytest.raises(InputError, match=r"fluid\.viscosity = .*; allowed: numbers in SI units"):
        wide.with_values({"fluid.viscosity": wrong})


def test_what_is_no_robot_is_not_stacked() -> None:
    robot = load("biorob2012-wide")
    for wrong, words in (
        (["biorob2012-wide"], r"robots\[0\] = 'biorob2012-wide'; allowed: a RobotTables"),
        ([robot, None], r"robots\[1\] = None; allowed: a RobotTables"),
        (None, "robots = None; allowed: a RobotTables or a list"),
        ([robot, load("ecoli")], "use spirillum.robot.batch.batches for a mixed list"),
        ([], r"robots = \[\]; allowed: one robot, or several"),
    ):
        with pytest.raises(InputError, match=words):
            RobotBatch.of(wrong)
    for wrong, words in ((None, "robots = None; allowed: a list"), ([1], r"robots\[0\] = 1; allowed: a RobotTables")):
        with pytest.raises(InputError, match=words):
            batches(wrong)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="placement = 'low'; allowed: a Placement or None"):
        RobotBatch.of(robot, "low")  # type: ignore[arg-type]


def test_parts_of_a_batch_are_asked_for_by_numbers(wide: Any) -> None:
    batch = wide.with_values({"tail.wavelength": WAVELENGTHS})
    for wrong in ("foo", np.nan, None, 10**400, 0, [[1], [2]], [0.7], [True], [4], [-1]):
        with pytest.raises(InputError, match=r"rows.*; allowed: whole numbers from 0 to 3, one after the other"):
            batch.taken(wrong)
    for wrong in (0, -1, 1.5, "2", None, True):
        with pytest.raises(InputError, match=r"size = .*; allowed: a whole number"):
            batch.blocks(wrong)
    for wrong in (None, [[1], [2]], "tail.wavelength"):
        with pytest.raises(InputError, match=r"values = .*; allowed: a mapping"):
            batch.with_values(wrong)
    with pytest.raises(InputError, match="placement = 'foo'; allowed: a Placement"):
        batch.placed("foo")
    assert batch.taken([3, 0, 3]).wavelength.tolist() == WAVELENGTHS[[3, 0, 3]].tolist()
    assert (wide.taken([0, 0, 0]).size, wide.taken([0]).size) == (3, 1)
    assert sp.swim(wide.taken([0, 0, 0]), "sbt").forward_velocity.tolist() == 3 * [
        swim(wide, "sbt").forward_velocity[0]
    ]
    with pytest.raises(InputError, match=r"rows has shape \(0,\); allowed: "):
        batch.taken(np.array([], dtype=int))


def test_unknown_model_and_missing_drive(wide: Any, batch_of: Callable[..., Any]) -> None:
    with pytest.raises(InputError, match=r"model = 'stb' \(did you mean sbt\?\); allowed: .*sbt"):
        swim(wide, "stb")
    with pytest.raises(InputError, match="drive is missing; allowed"):
        swim(batch_of(drive=None), "sbt")
    assert swim(batch_of(drive=None), "sbt", tail_rate=np.array([2.0])).valid[0]


def test_rates_may_be_missing_for_some_robots(wide: Any) -> None:
    """NaN is `not observed`: a robot with either rate has an answer, one with neither has none."""
    batch = wide.with_values({"tail.wavelength": WAVELENGTHS})
    s = swim(
        batch, "rft", tail_rate=np.array([2.0, np.nan, 2.0, np.nan]), motor_rate=np.array([np.nan, 3.0, 3.0, np.nan])
    )
    assert s.valid.tolist() == [True, True, True, False]
    assert s.tail_rotation_rate[0] == 2.0
    assert s.motor_rotation_rate[1] == pytest.approx(3.0, rel=1e-14)


def test_mixed_robots_do_not_stack_but_group() -> None:
    names = ["sphere", "plain", "rate", "other plain", "near a floor", "plain reading"]
    robots = [
        load("biorob2012-wide", body={"shape": "sphere", "length": "18 mm", "front": None, "rear": None}),
        load("biorob2012-wide"),
        load("biorob2012-wide", drive={"kind": "rate", "rate": "1 Hz"}),
        load("biorob2012-narrow", **{"tail.wavelength": "12 mm"}),
        load("biorob2012-wide", **{"model.rft.coefficients": "brennen-winet"}),
        load("biorob2012-wide", **{"friction.reading": "paper"}),
    ]
    with pytest.raises(InputError, match="robots of one batch have to share"):
        RobotBatch.of(robots)
    groups = batches(robots)
    assert [[names[i] for i in indices] for indices, _ in groups] == [
        ["sphere"],
        ["plain", "other plain"],
        ["rate"],
        ["near a floor"],
        ["plain reading"],
    ]
    for indices, batch in groups:
        together = swim(batch, "rft")
        for place, i in enumerate(indices):
            assert_equal(together, place, swim(RobotBatch.of(robots[i]), "rft"))


def test_heights_above_the_floor_are_columns_of_one_batch() -> None:
    options = {"model.rft.coefficients": "brennen-winet"}
    robots = [load("biorob2012-wide", **options, **{"model.rft.axis_height": h}) for h in ("4 mm", "9 mm")]
    ((indices, batch),) = batches(robots)
    assert indices == [0, 1]
    s = swim(batch, "rft", tail_rate=np.array([5.0]))
    for i, robot in enumerate(robots):
        assert_equal(s, i, swim(RobotBatch.of(robot), "rft", tail_rate=np.array([5.0])))
    assert s.forward_velocity[0] != s.forward_velocity[1]
