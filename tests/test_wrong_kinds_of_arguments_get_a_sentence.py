"""Every argument of every public function, given a value of each kind that it does not take, is named in a sentence."""

from __future__ import annotations

import inspect
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.argument_validation import validate_arguments
from spirillum.calibration.posterior import Sampling
from spirillum.dynamics.release import InTube
from spirillum.dynamics.rotating_field import Field
from spirillum.dynamics.timing import Timing
from spirillum.robot.arguments import Options
from spirillum.robot.model_options import Resolution
from spirillum.robot.placement import Placement
from spirillum.swimming.steady import swim
from spirillum.virtual.artifacts import Degradation
from spirillum.virtual.trial_options import CameraOptions, MotionOptions, SetupErrors, TrialOptions

WIDE, LONG = "biorob2012-wide", "x" * 5000
FUNCTIONS = [name for name in sp.__all__ if inspect.isfunction(getattr(sp, name)) and name != "citation"]
OF_A_KIND: dict[str, Any] = {
    "str": "text",
    "Path": Path("file"),
    "int": 3,
    "float": 2.5,
    "bool": True,
    "None": None,
    "Mapping": {"field": 1},
    "Sequence": ["text"],
    "object": object(),
}
ALSO = {
    "float": ("int",),
    "RobotSource": ("str", "Path", "Mapping"),
    "Source": ("str", "Path", "Mapping"),
    "Any": ("Mapping",),
    "tuple": ("Sequence",),
}


def taken(annotation: str) -> set[str]:
    """Kinds of `OF_A_KIND` that an annotation lets in, read from its words alone."""
    outer = annotation
    while "[" in outer:  # what stands in brackets is of items
        start = outer.rindex("[")
        outer = outer[:start] + outer[outer.index("]", start) + 1 :]
    words = {word.strip() for word in outer.split("|")}
    return words.union(*(ALSO.get(word, ()) for word in words))


MADE = ("AxialBatch", "LiveTracker", "Plant", "SerialRemote", "VirtualCamera")


@pytest.mark.parametrize("name", [*FUNCTIONS, *MADE])
def test_each_argument_of_a_wrong_kind_is_named(name: str) -> None:
    function = getattr(sp, name)
    parameters = [item for item in inspect.signature(function).parameters.values() if item.kind is not item.VAR_KEYWORD]
    tried = 0
    for item in parameters:
        given = {first.name: None for first in parameters if first.default is first.empty and first is not item}
        for kind in OF_A_KIND.keys() - taken(item.annotation):
            with pytest.raises(sp.InputError) as refused:
                function(**{item.name: OF_A_KIND[kind]}, **given)
            sentence = str(refused.value)
            assert sentence.startswith((f"{item.name} = ", f"{item.name}[")), (item.name, kind, sentence)
            assert "; allowed: " in sentence
            tried += 1
    assert tried >= 4 * len(parameters)


@pytest.mark.parametrize(
    "options",
    [Placement, Timing, InTube, Resolution, Degradation, MotionOptions, TrialOptions, CameraOptions, SetupErrors],
)
def test_each_option_of_a_wrong_kind_is_named(options: type[Options]) -> None:
    for name in options.model_fields:
        for wrong in (object(), [object()], {"a": 1}, 1 + 2j, np.zeros((2, 2))):
            with pytest.raises(sp.InputError) as refused:
                options.of({name: wrong})
            assert name.replace("_", "-") in str(refused.value).replace("_", "-"), (name, wrong, str(refused.value))


def test_no_number_is_too_long_for_a_sentence() -> None:
    plant = sp.Plant("biorob2012-wide", model="rft")
    for wrong in (10**400, 10**5000, True, "1", None, 1j):
        with pytest.raises(sp.InputError, match=r"dt = .*; allowed: above 0"):
            plant.step(wrong)  # type: ignore[arg-type]
    with pytest.raises(sp.InputError, match="state = 3; allowed: a PlantState"):
        plant.reset(3)  # type: ignore[arg-type]
    with pytest.raises(sp.InputError, match=r"foo is no argument of Plant\(\).*; allowed: robot"):
        sp.Plant("biorob2012-wide", foo=1)  # type: ignore[call-arg]


def test_a_plant_refuses_odd_flows_and_fields() -> None:
    plant = sp.Plant("biorob2012-wide", model="rft")
    for wrong in (float("nan"), float("inf"), "1 mm/s", True, 10**400):
        with pytest.raises(sp.InputError, match=r"velocity = .*; allowed: "):
            plant.impose_flow(wrong)  # type: ignore[arg-type]
    with pytest.raises(sp.InputError, match="asked = 3; allowed: a Field"):
        plant.impose_field(3)  # type: ignore[arg-type]
    with pytest.raises(sp.InputError, match="no field turns it"):
        plant.impose_field(Field.of({"yaw": 0.1}))


@pytest.mark.parametrize("long", ["a" * 300, "a" * 5000, "folder/" + "é" * 200])
def test_no_name_is_too_long_for_a_sentence(long: str) -> None:
    for call in (
        sp.load,
        sp.propose_setup,
        lambda name: sp.measure("film.mp4", name),
        lambda name: sp.study(output=name),
    ):
        with pytest.raises(sp.InputError, match=r"(bytes|characters); allowed: "):
            call(long)


def test_sampler_wants_whole_numbers() -> None:
    for name in vars(Sampling()):
        with pytest.raises(sp.InputError, match=f"{name} = 'x'; allowed: a whole number"):
            Sampling(**{name: "x"})  # type: ignore[arg-type]


def test_sentence_says_what_is_allowed() -> None:
    for wrong, words in (
        ({"calibration": 3}, "calibration = 3; allowed: text, a path or None"),
        ({"placement": 1.0}, "placement = 1.0; allowed: a Placement, a mapping of names or None"),
        ({"placement": {1: 2}}, "placement = {1: 2}; allowed: a Placement, a mapping of names or None"),
        ({"calibrated": "no"}, "calibrated = 'no'; allowed: True or False"),
        ({"durations": 3}, "durations is no argument of simulate()"),
    ):
        with pytest.raises(sp.InputError) as refused:
            sp.simulate("biorob2012-wide", **wrong)  # type: ignore[arg-type]
        assert str(refused.value).startswith(words)
    with pytest.raises(sp.InputError, match=r"models\[1\] = 3; allowed: text"):
        sp.compare_models("biorob2012-wide", models=["sbt", 3])  # type: ignore[list-item]


def test_numbers_and_lists_of_numpy_are_numbers_and_lists() -> None:
    def function(number: float, whole: int, names: Sequence[str], flag: bool) -> tuple[Any, ...]:  # type: ignore[name-defined]  # noqa: F821
        return number, whole, names, flag

    names = np.array(["a", "b"])
    assert validate_arguments(function)(np.float32(2.0), np.int64(3), names, np.True_)[:2] == (2.0, 3)
    with pytest.raises(sp.InputError, match="whole = True; allowed: a whole number"):
        validate_arguments(function)(2.0, True, names, False)


@pytest.mark.parametrize("time", [np.timedelta64(1, "s"), np.timedelta64(1, "ns")], ids=str)
def test_lengths_of_time_of_numpy_are_no_numbers(time: Any) -> None:
    """They pass for whole numbers, and their count depends on their unit."""
    for call in (
        lambda: sp.predict(WIDE, tail_rate=time),
        lambda: sp.resistance(WIDE, phase=time, part="tail"),
        lambda: sp.study(workers=time),
        lambda: sp.simulate(WIDE, timing={"duration": time}),
        lambda: sp.simulate(WIDE, timing={"samples_per_turn": time}),
        lambda: sp.simulate(WIDE, in_tube={"wait": time}),
        lambda: sp.simulate(WIDE, in_tube={"friction_coefficient": time}),
    ):
        with pytest.raises(sp.InputError, match=r"; allowed: "):
            call()


@pytest.mark.parametrize("value", [np.array("a"), np.ma.masked, np.array(3)], ids=["text", "masked", "number"])
def test_an_array_of_one_value_is_no_list(value: Any) -> None:
    with pytest.raises(sp.InputError, match=r"models = .*; allowed: a list"):
        sp.compare_models(WIDE, models=value)
    with pytest.raises(sp.InputError, match=r"size = .*; allowed: "):
        sp.show(WIDE, size=value)


@pytest.mark.parametrize("size", [np.array([]), {1}, range(3), {640, 480}], ids=str)
def test_sizes_are_pairs(size: Any) -> None:
    with pytest.raises(sp.InputError, match=r"size = .*; allowed: WIDTHxHEIGHT"):
        sp.show(WIDE, size=size)


def test_public_functions_can_be_sent_to_another_process() -> None:
    assert pickle.loads(pickle.dumps(sp.predict)) is sp.predict


@pytest.mark.parametrize("name", ["tail_rate", "motor_rate"])
@pytest.mark.parametrize(
    "wrong", [np.array(["a"]), "1", True, np.ma.masked, [None], np.array([1j]), [[1.0], [2.0, 3.0]]], ids=str
)
def test_rates_have_to_be_numbers(name: str, wrong: Any) -> None:
    with pytest.raises(sp.InputError, match=rf"{name} = .*; allowed: numbers in rad/s"):
        swim(sp.RobotBatch.of(sp.load("biorob2012-wide")), **{name: wrong})


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: sp.calibrate("", WIDE), "an empty name, or '.', is a folder; allowed: an observations file"),
        (lambda: sp.study(""), "an empty name, or '.', is a folder; allowed: a study file"),
        (lambda: sp.predict(WIDE, posterior=""), "an empty name, or '.', is a folder; allowed: posterior.nc"),
        (lambda: sp.study({"robots": [LONG]}), "is not allowed; allowed: at most 200 characters"),
        (lambda: sp.study({"robots": [""]}), "robots.0 = '' is not allowed; allowed: text that is not empty"),
        (lambda: sp.predict(WIDE, model=LONG), "xxx'; allowed: auto, sbt"),
        (lambda: sp.predict(WIDE, friction=LONG), "xxx'; allowed: none, rotor"),
        (lambda: sp.study({"robots": [WIDE], "models": [LONG]}), "; allowed: auto, sbt"),
    ],
)
def test_empty_and_long_names_are_told_what_is_allowed(call: Callable[[], Any], words: str) -> None:
    with pytest.raises(sp.InputError) as caught:
        call()
    assert words in str(caught.value)
    assert len(str(caught.value)) < 810
