"""Notes are broken at the right edge of a figure, also those in which some words stay together."""

import pytest

from spirillum.view.figures.sheet import Sheet
from spirillum.view.figures.style import DPI, PAGE, styled


@pytest.mark.parametrize("space", [" ", "\u00a0"])
def test_no_note_is_cut(space: str) -> None:
    note = ", ".join(f"body_rotation[{number} mm] 0.604".replace(" ", space) for number in range(30, 40))
    with styled():
        figure = Sheet("Title", "subtitle", width=PAGE, heights=[1.0], columns=1, notes=[note]).finished()
        figure.set_dpi(DPI)
        texts = [item for item in figure.findobj() if getattr(item, "get_text", str)().startswith("body_rotation")]
        assert texts[0].get_text().count("\n") >= 2
        assert texts[0].get_window_extent().x1 <= figure.bbox.width


@pytest.mark.parametrize("length", range(3, 12))
def test_no_line_begins_with_the_point_between_two_items(length: int) -> None:
    subtitle = " · ".join("n" * (length + number % 3) for number in range(40))
    with styled():
        figure = Sheet("Title", subtitle, width=PAGE, heights=[1.0], columns=1).finished()
        lines = next(
            item.get_text().split("\n") for item in figure.findobj() if "·" in getattr(item, "get_text", str)()
        )
        assert len(lines) > 2
        assert not any(line.startswith("·") for line in lines)
