"""What a model says of a robot's own tail: the numbers of docs/accuracy.md, and of the tail that is most like it."""

import re
from pathlib import Path

import pytest

import spirillum as sp
from spirillum.fluid.stated import CHECKED

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


def test_sentence_is_about_the_robots_own_tail() -> None:
    said = sp.predict("biorob2012-wide", model="rft").known_error
    assert said.startswith("against a resolved wire of this tail (wavelength 25 mm, amplitude 2.5 mm): drag +56 %")
    wide = sp.load("biorob2012-wide", **{"tail.wavelength": "10 mm", "tail.amplitude": "3.4 mm"})
    said = sp.predict(wide, model="rft").known_error
    assert "much like this one (wavelength 10 mm, amplitude 3.5 mm" in said
    assert "+271 %" in said
    thick = sp.load("biorob2012-wide", **{"tail.wire_diameter": "2 mm"})
    assert "was not held against a resolved wire" in sp.predict(thick, model="sbt").known_error
    late = sp.load("biorob2012-wide", **{"tail.taper": 0.1})
    assert "on average 4.8 % of the amplitude) was not held" in sp.predict(late, model="sbt").known_error
    plain = sp.load("biorob2012-wide", **{"tail.taper": None})
    assert "much like this one" in sp.predict(plain, model="sbt").known_error


def test_walls_are_named_where_there_are_some() -> None:
    assert "the walls of its channel are not computed" in sp.predict("biorob2012-wide", model="sbt").known_error
    assert "channel" not in sp.predict("ecoli", model="sbt").known_error


def test_tube_names_what_nobody_gave() -> None:
    given = sp.predict("biorob2012-wide", placement={"gap": "0.5 mm"}, band=False).known_error
    assert "the body's pitch, not given here, decides" in given
    both = sp.predict("biorob2012-wide", placement={"gap": "0.5 mm", "pitch": "0 deg"}, band=False).known_error
    assert "taken as given" in both
