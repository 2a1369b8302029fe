"""A number is shown to the second digit of its interval's half width, in the units that people read."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from spirillum.measurement.statistics import rounded_with_ends


@pytest.mark.parametrize(
    ("value", "low", "high", "unit", "texts"),
    [
        (1.1191234e-3, 1.1178e-3, 1.1204e-3, "m/s", ("1.1191", "1.1178", "1.1204", "mm/s")),
        (
            2 * math.pi * 1.21729,
            2 * math.pi * 1.21711,
            2 * math.pi * 1.21747,
            "rad/s",
            ("1.21729", "1.21711", "1.21747", "Hz"),
        ),
        (0.123, 0.0, 0.246, "m", ("123", "0", "246", "mm")),
        (-2e-9, -1e-6, 1e-6, "m", ("0.0000", "-0.0010", "0.0010", "mm")),
        (1.23456e-3, None, None, "m/s", ("1.235", "-", "-", "mm/s")),
        (1.5e-3, math.nan, math.nan, "m/s", ("1.5", "-", "-", "mm/s")),
        (None, None, None, "m/s", ("-", "-", "-", "")),
        (1e-3, 1e-3, 1e-3, "m/s", ("1.000000", "1.000000", "1.000000", "mm/s")),
    ],
)
def test_texts(value: float | None, low: float | None, high: float | None, unit: str, texts: tuple[str, ...]) -> None:
    assert rounded_with_ends(value, low, high, unit) == texts


@given(st.floats(-1e3, 1e3), st.floats(1e-4, 1e2))
def test_rounding_is_small_against_the_interval_and_no_digit_is_idle(value: float, half_width: float) -> None:
    """In seconds, which are read as they are: an error of 5 % of the half width at most."""
    found = rounded_with_ends(value, value - half_width, value + half_width, "s")
    if abs(value) < 1e5 * half_width:  # else seven digits are enough
        assert abs(float(found.value) - value) <= 0.0501 * half_width
    decimals = len(found.value.partition(".")[2])
    assert decimals == 0 or 10.0**-decimals > 0.0099 * half_width
