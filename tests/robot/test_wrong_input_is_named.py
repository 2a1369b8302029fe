"""Every kind of wrong input ends in one sentence that names the field or file, its value, and what is allowed."""

import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spirillum.errors import InputError
from spirillum.robot.limits import Limit
from spirillum.robot.load import load, raw_table

LENGTHS = 'for example "18 mm"'
HUGE = 10**400

FIELDS: list[tuple[dict[str, Any], str, str]] = [
    # overrides, the field that has to be named, what has to be said
    ({"tail.wavelength": "25 kg"}, 'tail.wavelength = "25 kg"', '"18 mm"'),
    ({"tail.wavelength": "25 parsnip"}, 'tail.wavelength = "25 parsnip"', '"18 mm"'),
    ({"tail.wavelength": 25}, "tail.wavelength = 25", LENGTHS),
    ({"tail.wavelength": 2.5e-2}, "tail.wavelength = 0.025", LENGTHS),
    ({"tail.wavelength": "25"}, 'tail.wavelength = "25"', LENGTHS),
    ({"tail.wavelength": "-25 mm"}, 'tail.wavelength = "-25 mm"', "1 nm to 100 m"),
    ({"tail.wavelength": "0 mm"}, 'tail.wavelength = "0 mm"', "1 nm to 100 m"),
    ({"tail.wavelength": "1 km"}, 'tail.wavelength = "1 km"', "1 nm to 100 m"),
    ({"tail.wavelength": "nan mm"}, 'tail.wavelength = "nan mm"', "1 nm to 100 m"),
    ({"tail.wavelength": "inf mm"}, 'tail.wavelength = "inf mm"', "1 nm to 100 m"),
    ({"tail.wavelength": float("nan")}, "tail.wavelength = nan", "1 nm to 100 m"),
    ({"tail.wavelength": float("-inf")}, "tail.wavelength = -inf", "1 nm to 100 m"),
    ({"tail.wavelength": HUGE}, "tail.wavelength = ", LENGTHS),
    ({"tail.wavelength": "1" * 5000 + " mm"}, "tail.wavelength = ", LENGTHS),
    ({"tail.wavelength": True}, "tail.wavelength = True", LENGTHS),
    ({"tail.wavelength": ["25 mm"]}, "tail.wavelength = ", LENGTHS),
    ({"tail.wavelength": {"value": 25}}, "tail.wavelength = ", LENGTHS),
    ({"tail.wavelength": "25 m\nnonsense"}, "tail.wavelength = ", '"18 mm"'),
    ({"tail.wavelength": "{0} {sentence} mm"}, "tail.wavelength = ", LENGTHS),
    ({"fluid.viscosity": "3.5 Pa"}, 'fluid.viscosity = "3.5 Pa"', '"3.5 Pa s"'),
    ({"fluid.density": "1 g"}, 'fluid.density = "1 g"', "985 kg/m^3"),
    ({"body.mass": "10.7 mm"}, 'body.mass = "10.7 mm"', '"10.7 g"'),
    ({"drive": {"kind": "rate", "rate": "2 1/s"}}, 'drive.rate = "2 1/s"', "rad/s, Hz, rpm"),
    ({"friction.effective": "-1 N m s"}, "friction.effective", "0 N m s/rad to 1e6 N m s/rad"),
    ({"friction.effective": "1e-6 N m"}, "friction.effective", '"7e-7 N m s/rad"'),
    ({"motor.back_emf_constant": "1 V"}, "motor.back_emf_constant", '"0.004 V s/rad"'),
    # numbers without a unit
    ({"tail.taper": 0}, "tail.taper = 0", "a number from 0.1 to 10000, or 'none'"),
    ({"tail.taper": 1e5}, "tail.taper = 100000.0", "0.1 to 10000"),
    ({"tail.taper": float("nan")}, "tail.taper = nan", "0.1 to 10000"),
    ({"tail.taper": "100"}, "tail.taper = '100'", "0.1 to 10000"),
    ({"tail.taper": True}, "tail.taper = True", "0.1 to 10000"),
    ({"tail.taper": HUGE}, "tail.taper = ", "0.1 to 10000"),
    ({"drive.duty": 1.5}, "drive.duty = 1.5", "1"),
    ({"drive.duty": -0.1}, "drive.duty = -0.1", "motor.polarity"),
    ({"drive.duty": float("nan")}, "drive.duty = nan", "number"),
    ({"drive.duty": "0.5"}, "drive.duty = '0.5'", "number"),
    ({"drive.duty": True}, "drive.duty = True", "number"),
    ({"calibration.sbt.body_drag": 0.0}, "calibration.sbt.body_drag = 0.0", "0.001"),
    ({"calibration.sbt.body_drag": HUGE}, "calibration.sbt.body_drag = ", "allowed: "),
    ({"calibration.sbt.source": ""}, "calibration.sbt.source = ''", "text that is not empty"),
    ({"name": 5}, "name = 5", "text in quotes"),
    ({"name": ""}, "name = ''", "text that is not empty"),
    ({"name": "x" * 300}, "name = 'xxx", "at most 200 characters"),
    ({"model.rft.spin": "yes"}, "model.rft.spin = 'yes'", "true or false"),
    # words
    ({"tail.handedness": "rihgt"}, "tail.handedness = 'rihgt'", "(did you mean right?)"),
    ({"tail.handedness": "rihgt"}, "tail.handedness", "'right' or 'left'"),
    ({"tail.handedness": 1}, "tail.handedness = 1", "'right' or 'left'"),
    ({"body.shape": "cylindre"}, "body.shape = 'cylindre'", "(did you mean cylinder?)"),
    ({"body.shape": "capsul"}, "body.shape = 'capsul'", "(did you mean capsule?)"),
    ({"friction.reading": "papers"}, "friction.reading = 'papers'", "(did you mean paper?)"),
    ({"model.rft.coefficients": "gray"}, "model.rft.coefficients = 'gray'", "(did you mean gray-hancock?)"),
    ({"motor.polarity": "backward"}, "motor.polarity = 'backward'", "'forward' or 'reverse'"),
    ({"channel": "nothing"}, "channel = 'nothing'", "'none', or a [channel] table"),
    ({"channel": 40}, "channel = 40", "'none', or a [channel] table"),
    # keys and tables
    ({"tail.wavelenght": "25 mm"}, "tail.wavelenght is not a known field", "(did you mean wavelength?)"),
    ({"tail.turns": 3}, "tail.turns is not a known field", "tail.length over tail.wavelength is the number of turns"),
    ({"tial.wavelength": "25 mm"}, "tial is not a known field", "(did you mean tail?)"),
    ({"motor.resistance.constnat": "1 ohm"}, "motor.resistance.constnat", "(did you mean constant?)"),
    ({"channel.diametre": "30 mm"}, "diametre", "(did you mean diameter?)"),
    ({"calibration.sbt.factor": 2}, "calibration.sbt.factor", "body_drag"),
    ({"body": None}, "body is missing", "has to be given"),
    ({"tail": None}, "tail is missing", "has to be given"),
    ({"fluid.viscosity": None}, "fluid.viscosity is missing", "has to be given"),
    ({"tail": "long"}, "tail = 'long'", "[tail] table"),
    ({"tail": ["a"]}, "tail = ['a']", "[tail] table"),
    ({"tail.wavelength.unit": "mm"}, "tail.wavelength", LENGTHS),
    ({"": 1}, "'' is no field", "tail.wavelength"),
    ({"tail..wavelength": "25 mm"}, "'tail..wavelength' is no field", "tail.wavelength"),
    ({"a.b.c.d.e.f.g.h.i.j.k": 1}, "is no field", "tail.wavelength"),
    # what cannot be built or does not fit
    ({"tail.amplitude": "20 mm"}, "tail.amplitude = 20 mm", "less than 19.5 mm"),
    ({"body.length": "400 mm"}, "body.length = 400 mm", "less than 340 mm"),
    ({"body.diameter": "40 mm"}, "body.diameter = 40 mm", "less than 40 mm"),
    ({"coupling.diameter": "41 mm"}, "coupling.diameter = 41 mm", "less than 40 mm"),
    ({"channel.length": "100 mm"}, "tail.length = 60 mm", "at most 55 mm"),
    ({"tail.wavelength": "0.9 mm"}, "tail.wire_diameter = 1 mm", "less than 0.89"),
    ({"tail.wire_diameter": "18 mm"}, "tail.wire_diameter = 18 mm", "less than 17.67 mm"),
    ({"tail.length": "30 m", "channel.length": None}, "tail.length = 3e+04 mm", "less than 2.5e+04 mm"),
    ({"body.length": "5 mm"}, "body.length = 5 mm", "9 mm"),
    ({"body.shape": "sphere", "body.front": None, "body.rear": None}, "body.length = 35 mm", "exactly 18 mm"),
    ({"body.shape": "sphere"}, "body.front", "leave it out"),
    ({"body.fillet": "1 mm"}, "body.fillet", "both or neither"),
    ({"body.rear": "fillet"}, "body.fillet", "both or neither"),
    ({"body.rear": "fillet", "body.fillet": "10 mm"}, "body.fillet = 10 mm", "9 mm"),
    ({"coupling.diameter": "-1 mm"}, "coupling.diameter", "0 m to 100 m"),
    ({"coupling.clearance": "6 mm"}, "coupling.clearance = 6 mm", "less than 5 mm"),
    ({"model.rft.axis_height": "5 mm"}, "model.rft.axis_height", "brennen-winet"),
    # drives and joints
    ({"drive.joint": "fixed"}, "drive.joint = 'fixed'", "'revolute'"),
    ({"drive.kind": "rate"}, "drive.rate is missing", "drive.kind = 'rate'"),
    ({"drive.kind": "torque"}, "drive.torque is missing", "drive.kind = 'torque'"),
    ({"drive.rate": "1 Hz"}, "drive.rate is set", "drive.kind = 'rate'"),
    ({"drive.torque": "1 N m"}, "drive.torque is set", "drive.kind = 'torque'"),
    ({"drive.kind": "wind"}, "drive.kind = 'wind'", "'dc-motor'"),
    ({"motor": None}, "motor is missing", "[motor] table"),
    ({"battery": None}, "battery is missing", "[battery] table"),
    ({"motor.resistance.slope": "-2000 ohm/A"}, "motor.resistance", "R(I) > 0"),
]


def sentence_of(caught: Any) -> str:
    text = str(caught.value)
    assert len(text.splitlines()) == 1, text
    assert len(text) < 700, text
    return text


@pytest.mark.parametrize(("overrides", "field", "said"), FIELDS, ids=lambda value: str(value)[:40])
def test_field(overrides: dict[str, Any], field: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        load("biorob2012-wide", **overrides)
    text = sentence_of(caught)
    assert text.startswith("preset biorob2012-wide: ") or "is no field" in text
    assert field in text
    assert said in text
    assert all(len(problem.splitlines()) == 1 for problem in caught.value.problems)


def test_duty_belongs_to_the_motor() -> None:
    with pytest.raises(InputError, match=r"drive\.duty = 0\.5 with drive\.kind = 'rate'; allowed: only for 'dc-motor'"):
        load("biorob2012-wide", drive={"kind": "rate", "rate": "1 Hz", "duty": 0.5})


def test_a_misspelt_field_is_told_before_the_one_that_is_missing_for_it() -> None:
    table = raw_table("biorob2012-wide")[0]
    table["tail"]["wavelenght"] = table["tail"].pop("wavelength")
    with pytest.raises(
        InputError, match=r"^the robot: tail.wavelenght is not a known field \(did you mean wavelength\?\)"
    ):
        load(table)


def test_all_problems_are_kept_and_the_first_is_told() -> None:
    wrong = {"tail.wavelength": "25", "tail.handedness": "up", "fluid.viscosity": "-1 Pa s"}
    with pytest.raises(InputError, match=r"\(and 2 more: ") as caught:
        load("biorob2012-wide", **wrong)
    assert len(caught.value.problems) == 3
    for field in wrong:
        assert sum(field in problem for problem in caught.value.problems) == 1


WRONG_FILES: list[tuple[bytes, str]] = [
    (b"", "is empty"),
    (b" \n\t\n", "is empty"),
    (bytes(range(256)), "is not text"),
    ('name = "é"'.encode("latin-1"), "is not text"),
    ('name = "x"'.encode("utf-16"), "is not text"),
    (b"tail = = 1", "is not TOML"),
    (b"a = 1\x00", "is not TOML"),
    (b"just words", "is not TOML"),
    (b"a = " + b"[" * 50_000, "nested too deeply"),
    (b"a = " + b"9" * 10_000, "too long"),
    (b"a = " + b"[" * 300 + b"]" * 300, "is not a known field"),
    (b"[" + b".".join([b"a"] * 5000) + b"]\nb = 1", "a key of more than 24 parts"),
    (b"[tail." + b".".join([b"a"] * 900) + b"]\nb = 1", "a key of more than 24 parts"),
    (b"[tail." + b".".join([b"a"] * 20) + b"]\nb = 1", "is not a known field"),
    (b'extends = "biorob2012-wide"\n[tail.' + b".".join([b"a"] * 20) + b"]\nb = 1", "tail"),
    (b'extends = "biorob2012-wild"', "(did you mean biorob2012-wide?)"),
    (b"extends = 5", "biorob2012-narrow, biorob2012-wide"),
    (b'extends = "robot.toml"', "biorob2012-narrow, biorob2012-wide"),
    (b"body = 1", "[body] table"),
]


@pytest.mark.parametrize(("content", "said"), WRONG_FILES, ids=lambda value: repr(value)[:40])
def test_file(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "robot.toml"
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        load(path)
    text = sentence_of(caught)
    assert str(path) in text
    assert said in text


def test_huge_file_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    with path.open("wb") as file:
        file.truncate(100 << 20)
    with pytest.raises(InputError, match=r"104857600 bytes; allowed: .* at most 1048576 bytes") as caught:
        load(path)
    assert str(path) in sentence_of(caught)


def test_folder_and_missing_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is a folder; allowed: ") as caught:
        load(tmp_path)
    assert str(tmp_path) in sentence_of(caught)
    with pytest.raises(InputError, match="does not exist; allowed: ") as caught:
        load(str(tmp_path / "absent.toml"))
    assert "absent.toml" in sentence_of(caught)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.toml")
    with pytest.raises(InputError, match="is not a regular file"):
        load(tmp_path / "pipe.toml")


@pytest.mark.parametrize(
    ("robot", "said"),
    [
        ("biorob2012-wild", "did you mean biorob2012-wide?"),
        ("no-such-robot", "biorob2012-narrow, biorob2012-wide"),
        ("x" * 5000 + ".toml", "allowed: "),
        ("a\nb.toml", "allowed: "),
        ("a\x00b.toml", "allowed: "),
    ],
    ids=lambda value: repr(value)[:30],
)
def test_name(robot: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        load(robot)
    assert said in sentence_of(caught)


def test_tables_nested_without_end() -> None:
    deep: dict[str, Any] = {}
    inner = deep
    for _ in range(3000):
        inner["tail"] = {}
        inner = inner["tail"]
    for arguments in ((deep, {}), ("biorob2012-wide", deep)):
        with pytest.raises(InputError) as caught:
            load(arguments[0], **arguments[1])
        sentence_of(caught)
    with pytest.raises(InputError, match="body is missing"):
        load({})


def test_overrides_do_not_change_a_checked_robot() -> None:
    robot = load("biorob2012-wide")
    assert load(robot) is robot
    with pytest.raises(InputError, match="overrides of a checked Robot"):
        load(robot, name="other")


def test_robots_are_frozen() -> None:
    robot = load("biorob2012-wide")
    with pytest.raises(ValueError, match="frozen"):
        robot.tail.wavelength = 1.0  # type: ignore[misc]


SECTIONS = ["body", "coupling", "tail", "channel", "fluid", "drive", "motor", "motor.resistance", "battery", "friction"]
KEYS = [
    "diameter",
    "length",
    "wavelength",
    "amplitude",
    "taper",
    "kind",
    "joint",
    "rate",
    "constant",
    "slope",
    "x",
    "fillet",
]
paths = st.one_of(
    st.sampled_from(SECTIONS),
    st.tuples(st.sampled_from(SECTIONS), st.sampled_from(KEYS)).map(".".join),
    st.text(max_size=12),
)
junk = st.recursive(
    st.one_of(
        st.none(),
        st.booleans(),
        st.integers(),
        st.floats(),
        st.text(max_size=20),
        st.sampled_from(
            ["1 mm", "1 nm", "100 m", "2 Hz", "-3 rpm", "1e5 ohm", "none", "rate", "fixed", "sphere", "fillet"]
        ),
        st.dates(),
    ),
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(st.sampled_from(KEYS), inner, max_size=3)),
    max_leaves=5,
)


@settings(max_examples=40)
@given(overrides=st.dictionaries(paths, junk, min_size=1, max_size=3))
def test_any_table_is_a_robot_or_an_input_error(overrides: dict[str, Any]) -> None:
    is_a_robot_or_an_input_error(overrides)


@pytest.mark.slow
@settings(max_examples=1000)
@given(overrides=st.dictionaries(paths, junk, min_size=1, max_size=3))
def test_of_many_tables_each_is_a_robot_or_an_input_error(overrides: dict[str, Any]) -> None:
    is_a_robot_or_an_input_error(overrides)


def is_a_robot_or_an_input_error(overrides: dict[str, Any]) -> None:
    try:
        load("biorob2012-wide", **overrides)
    except InputError as error:
        sentences = (str(error), *error.problems)
    else:
        sentences = ()
    for sentence in sentences:
        assert len(sentence.splitlines()) == 1, sentence


def test_a_bound_that_is_missed_by_little_is_told_from_the_value() -> None:
    limit = Limit.of("Reynolds number", np.array([0.1, 0.100004]), "at most", 0.1, "1", "inertia is left out", "re")
    assert limit.sentence(1) == "Reynolds number = 0.100004; allowed: at most 0.1, because inertia is left out"


@pytest.mark.parametrize(
    ("lowest", "sentence"),
    [
        ('[tail]\nwavelength = "20"', 'tail.wavelength = "20" has no unit'),
        ("[tail]\nwavelength = nan", "tail.wavelength = nan"),
        ('[tail]\nwavelength = "1 km"', 'tail.wavelength = "1 km" is out of range'),
        ("[tail]\npitch = 3", "tail.pitch is not a known field"),
        ("foo = 3", "foo is not a known field"),
        ("[model.rft]\nfoo = 3", "model.rft.foo is not a known field"),
        ('[drive]\nkind = "rate"', "drive.rate is missing with drive.kind = 'rate'"),
        ('[channel]\ndiameter = "10 mm"', "body.diameter = 17 mm; allowed: less than 10 mm"),
    ],
)
def test_the_file_of_a_chain_is_named_in_which_a_wrong_field_stands(tmp_path: Path, lowest: str, sentence: str) -> None:
    base, middle, top = (tmp_path / f"{name}.toml" for name in ("base", "middle", "top"))
    base.write_text(f'extends = "biorob2012-wide"\n{lowest}\n[body]\ndiameter = "17 mm"\n')
    middle.write_text('extends = "base.toml"\n[tail]\namplitude = "3 mm"\n')
    top.write_text('extends = "middle.toml"\n[fluid]\nviscosity = "2 Pa s"\n')
    with pytest.raises(InputError) as refused:
        load(top)
    assert str(refused.value).startswith(f"{top}: extends: {middle}: extends: {base}: {sentence}")
    with pytest.raises(InputError) as refused:
        load(top, **{"tail.length": 3})
    assert f"{top}: tail.length = 3 has no unit" in str(refused.value.problems)


def test_two_files_of_a_chain_that_do_not_fit_are_named_by_the_upper_one(tmp_path: Path) -> None:
    base, top = tmp_path / "base.toml", tmp_path / "top.toml"
    base.write_text('extends = "biorob2012-wide"\n[body]\ndiameter = "17 mm"\n')
    top.write_text('extends = "base.toml"\n[channel]\ndiameter = "10 mm"\n')
    with pytest.raises(InputError, match=f"^{re.escape(str(top))}: body.diameter = 17 mm; allowed: less than 10 mm"):
        load(top)
