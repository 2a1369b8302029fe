"""Shades of a plain seal are no four colours; the named colours under any lamp are."""

import numpy as np
import pytest

from spirillum.vision.track.colours import are_distinguishable, colour_classes, named_colours

NAMES = ("red", "yellow", "green", "blue")


def samples(colours: np.ndarray, lamp: np.ndarray) -> np.ndarray:
    """Pixels of some colours in light and shade, with noise."""
    rng = np.random.default_rng(3)
    shade = rng.uniform(0.5, 1.0, (400, len(colours), 1))
    return (shade * colours * lamp + rng.normal(0.0, 6.0, (400, len(colours), 3))).reshape(-1, 3)


@pytest.mark.parametrize("lamp", [(1.0, 1.0, 1.0), (1.0, 0.85, 0.6), (0.4, 0.4, 0.4)])
def test_painted_stripes_are_told_apart(lamp: tuple[float, ...]) -> None:
    seen = samples(named_colours(NAMES), np.array(lamp))
    assert are_distinguishable(seen, colour_classes(seen, NAMES))


@pytest.mark.parametrize("name", ["white", "green", "black", "blue"])
def test_a_seal_of_one_colour_is_not(name: str) -> None:
    seen = samples(named_colours([name]), np.ones(3))
    assert not are_distinguishable(seen, colour_classes(seen, NAMES))


def test_stripes_under_a_mirrored_lamp_are_no_glare() -> None:
    painted = samples(named_colours(NAMES), np.full(3, 0.4))
    bare = colour_classes(painted, NAMES)[0]
    palette, _, glare = colour_classes(painted + 105.0, NAMES)
    np.testing.assert_allclose(palette - 105.0, bare, atol=8.0)
    assert are_distinguishable(painted + 105.0, (palette, palette, glare))
    grey = samples(named_colours(["white"]), np.full(3, 0.4)) + 105.0
    assert not are_distinguishable(grey, colour_classes(grey, NAMES))
