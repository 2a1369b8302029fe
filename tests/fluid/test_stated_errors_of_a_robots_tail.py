"""What a model says of a robot's own tail: the numbers of docs/accuracy.md, and of the tail that is most like it."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.fluid.reference_errors import CHECKED, SPEED_ERRORS, WITHOUT_INTERACTION, validation_note
from spirillum.fluid.registry import find_swimmer_model

PAGE = (Path(__file__).parents[2] / "docs" / "accuracy.md").read_text(encoding="utf-8")
NAMES = {"rft": "RFT, printed coefficients", "sbt": "SBT, eqs (1) to (7)", "slender": "slender, standard"}


def rows() -> dict[tuple[str, str], list[float]]:
    """Errors in percent by tail and model, from the page."""
    found = {}
    for line in PAGE.splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        values = [
            float(cell.replace("−", "-").removesuffix(" %")) for cell in cells if re.fullmatch(r"[+−]\S+ %", cell)
        ]
        if len(values) == 3:
            tail = cells[0] if len(cells) == 5 else "25, 2.5 mm"
            found.setdefault((tail, cells[-4]), values)
    return found


@pytest.mark.parametrize("model", CHECKED)
def test_numbers_are_those_of_the_page(model: str) -> None:
    page = rows()
    for (wavelength, amplitude), errors in CHECKED[model].items():
        assert list(errors) == page[f"{wavelength:g}, {amplitude:g} mm", NAMES[model]]


def _tail(**fields: Any) -> dict[str, Any]:
    return {f"tail.{name}": value for name, value in fields.items()}


def _said(model: str, **fields: Any) -> str:
    return sp.predict(sp.load("biorob2012-wide", **_tail(**fields)), model=model).known_error


def _numbers(said: str) -> list[float]:
    """Drag, thrust and torque of a sentence, percent."""
    found = re.search(r"drag (\S+) %, thrust (\S+) %, axial torque (\S+) % of the tail", said)
    assert found is not None
    return [float(text) for text in found.groups()]


def test_sentence_is_about_the_robots_own_tail() -> None:
    said = sp.predict("biorob2012-wide", model="rft").known_error
    assert said.startswith("against a resolved wire of this tail (wavelength 25 mm, amplitude 2.5 mm): drag +56 %")
    said = _said("rft", wavelength="10 mm", amplitude="3.4 mm")
    assert "the closest of which (wavelength 10 mm, amplitude 3.5 mm, 1 mm thick, 60 mm long)" in said
    assert "by up to a factor of 1.03 (wavelength over amplitude 2.86, here 2.94)" in said
    np.testing.assert_allclose(_numbers(said), [271, 144, 12], atol=5.0)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"wire_diameter": "2 mm"}, "a factor of 1.6 (wire diameter over amplitude 0.5, here 0.8)"),
        ({"length": "30 mm"}, "a factor of 2 (length over amplitude 24, here 12)"),
        ({"taper": 0.1}, "a factor of 20.5 (mean envelope 0.99, here 0.0484)"),
        ({"taper": None}, "a factor of 1.01 (mean envelope 0.99, here 1)"),
    ],
)
def test_distance_to_the_closest_resolved_tail_is_stated(fields: dict[str, Any], words: str) -> None:
    assert words in _said("sbt", **fields)


def test_what_is_stated_is_continuous() -> None:
    """From 16 x 2.2 mm to 16.1 x 2.6 mm, and through a resolved tail, it changes little in small steps."""
    for ends in (([16, 2.2, 0.8], [16.1, 2.6, 0.8]), ([20, 2.3, 0.7], [30, 2.7, 1.3])):
        found = []
        for share in np.linspace(0.0, 1.0, 41):
            wavelength, amplitude, wire = (1.0 - share) * np.array(ends[0]) + share * np.array(ends[1])
            robot = sp.load("biorob2012-wide", **_tail(wavelength=f"{wavelength} mm", amplitude=f"{amplitude} mm"))
            tail = robot.tail.model_copy(update={"wire_diameter": 1e-3 * wire})
            said = validation_note(sp.RobotBatch.of(robot.model_copy(update={"tail": tail})), CHECKED["sbt"])
            found.append(_numbers(said))
        steps = np.abs(np.diff(found, axis=0))
        assert steps.max() <= 1.0 + 1e-9  # a torque is stated to one per cent


@pytest.mark.parametrize(("model", "margin"), [("sbt", 3.0), ("rft", 9.0), ("slender", 0.6)])
@pytest.mark.parametrize("tail", [(16, 2.2, 0.8), (16.1, 2.6, 0.8), (20, 2.5, 1.0), (20, 2.3, 0.9)])
def test_interpolated_errors_are_those_of_tails_in_between(
    model: str, margin: float, tail: tuple[float, float, float]
) -> None:
    """Against `slender` at accuracy `high`, which is within 0.4 % of resolved wires."""
    names = ("wavelength", "amplitude", "wire_diameter")
    fields = _tail(**{name: f"{value} mm" for name, value in zip(names, tail, strict=True)})
    robot = sp.load("biorob2012-wide", **fields)
    fine = sp.load("biorob2012-wide", **fields, **{"model.slender.accuracy": "high"})
    true, found = (
        sp.resistance(one, part="tail", model=name).matrix[[0, 0, 3], [0, 3, 3]]
        for one, name in ((fine, "slender"), (robot, model))
    )
    stated = _numbers(validation_note(sp.RobotBatch.of(robot), CHECKED[model]))
    np.testing.assert_allclose(stated, 100.0 * (found / true - 1.0), atol=margin)


def test_speed_errors_are_those_of_the_page() -> None:
    """Of the reference robot, in the tables of robots and of models of `docs/accuracy.md`."""
    robots = PAGE[PAGE.index("<!-- table: robot -->") :]
    rows = {line.split("|")[1].strip(): line.split("|")[2].strip() for line in robots.splitlines() if line[:2] == "| "}
    for model, error in SPEED_ERRORS.items():
        assert rows[NAMES[model]] == f"+{error} %"
        assert find_swimmer_model(model).known_speed_error == pytest.approx(0.01 * error)
        (row,) = re.findall(rf"^\| `{model}` \|.*$", PAGE, re.M)
        assert row.count(f"speed +{error} %") == 1
        for name, column in (("drag", 0), ("thrust", 1), ("torque", 2)):
            ends = [errors[column] for errors in CHECKED[model].values()]
            if name in row:
                assert f"{name} {_range(min(ends), max(ends))} %" in row
    assert rows["slender, high, without interaction"] == f"+{WITHOUT_INTERACTION} %"


def _range(low: float, high: float) -> str:
    """Ends of a range as the page writes them, to whole per cent."""
    return " to ".join(f"{round(end):+d}".replace("-", "−") for end in sorted((low, high), key=abs))


def test_walls_are_named_where_there_are_some() -> None:
    assert "the walls of its channel are not computed" in sp.predict("biorob2012-wide", model="sbt").known_error
    assert "channel" not in sp.predict("ecoli", model="sbt").known_error


def test_tube_names_what_nobody_gave() -> None:
    given = sp.predict("biorob2012-wide", placement={"gap": "0.5 mm"}, band=False).known_error
    assert "the body's pitch, not given here, decides" in given
    both = sp.predict("biorob2012-wide", placement={"gap": "0.5 mm", "pitch": "0 deg"}, band=False).known_error
    assert "taken as given" in both
