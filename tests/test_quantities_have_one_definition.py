"""Every quantity has one definition: answers and datasets carry the registry's units."""

import tomllib
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

import spirillum as sp
from spirillum.papers import biorob2012
from spirillum.quantities import QUANTITIES
from spirillum.swimming.motions import Swimming
from spirillum.units import _registry, shown_in

PARTS = ("mean_", "held_", "largest_", "least_", "modelled_")
ENDINGS = ("_low", "_high", "_at_place")


def registered(name: str) -> str | None:
    """Name of the quantity that a variable holds; None for what is no quantity."""
    for part in PARTS:
        if name not in QUANTITIES:
            name = name.removeprefix(part)
    for end in ("_on", "_steady", "_held", "_trial"):
        if name not in QUANTITIES:
            name = name.removesuffix(end)
    name = name if name in QUANTITIES else name.partition("_at_")[0]
    return name if name in QUANTITIES else None


@pytest.mark.parametrize("name", QUANTITIES)
def test_units_are_units_and_shown_in_units_of_the_same_kind(name: str) -> None:
    item = QUANTITIES[name]
    assert item.name == name
    assert item.meaning
    assert item.source
    if item.display_unit != item.unit:
        ratio = _registry().Quantity(1.0, item.unit).to(item.display_unit).magnitude
        assert shown_in(1.0, item.display_unit) == pytest.approx(ratio, rel=1e-14)
    else:
        _registry().parse_units(item.unit if item.unit != "1" else "")


def test_steady_swimming_holds_registered_quantities() -> None:
    assert {item.name for item in fields(Swimming)} <= {*QUANTITIES, "warnings"}


def assert_registered(dataset: Any) -> None:
    found = {str(name): registered(str(name)) for name in dataset.data_vars}
    assert [name for name, known in found.items() if known is None and name != "outside"] == []
    for name, known in found.items():
        if known is not None:
            assert dataset[name].attrs["units"] == QUANTITIES[known].unit, name


def test_runs_carry_the_registrys_units() -> None:
    assert_registered(sp.simulate("biorob2012-wide", motion="held", timing={"turns": 0.2}, model="rft"))
    assert_registered(sp.simulate("biorob2012-wide", timing={"turns": 0.2}, model="rft"))


def test_studies_carry_the_registrys_units() -> None:
    """One tail in each channel has all the quantities of the paper's study."""
    study = tomllib.loads(Path(biorob2012.__file__).with_name("study.toml").read_text("utf-8"))
    study["grid"] |= {"wavelengths": ["25 mm"], "amplitudes": ["2.5 mm"]}
    assert_registered(sp.study(study))


def test_answers_carry_the_registrys_units() -> None:
    answer = sp.predict("biorob2012-wide", tail_rate="1.2 Hz").to_dict()
    quantities = {name: item for name, item in answer.items() if isinstance(item, dict) and "unit" in item}
    assert {name: item["unit"] for name, item in quantities.items()} == {
        name: QUANTITIES[name].unit for name in quantities
    }
