"""Notes are broken at the right edge of a figure, also those in which some words stay together."""

import pytest

from spirillum.view.figures.sheet import PAGE, Sheet
from spirillum.view.figures.style import DPI, styled


@pytest.mark.parametrize("space", [" ", "\u00a0"])
def test_no_note_is_cut(space: str) -> None:
    note = ", ".join(f"body_rotation[{number} mm] 0.604".replace(" ", space) for number in range(30, 40))
    with styled():
        figure = Sheet("Title", "subtitle", width=PAGE, heights=[1.0], columns=1, notes=[note]).finished()
        figure.set_dpi(DPI)
        texts = [item for item in figure.findobj() if getattr(item, "get_text", str)().startswith("body_rotation")]
        assert texts[0].get_text().count("\n") >= 2
        assert texts[0].get_window_extent().x1 <= figure.bbox.width
