"""Units at the edge: exact conversions, rates that say what turns, and text of any kind refused in one sentence."""

import math
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import spirillum as sp
from spirillum.errors import InputError
from spirillum.units import KINDS, USUAL, _factor, _registry, among, display_unit, parse_quantity, show, shown_in


@pytest.mark.parametrize(
    ("text", "rad_per_s"),
    [
        ("1.5 rad/s", 1.5),
        ("1.5 Hz", 3 * math.pi),
        ("90 rpm", 3 * math.pi),
        ("1.5 turn/s", 3 * math.pi),
        ("1.5 rev/s", 3 * math.pi),
        ("1.5 rps", 3 * math.pi),
        ("540 deg/s", 3 * math.pi),
        ("540 °/s", 3 * math.pi),
        ("1500 mHz", 3 * math.pi),
        ("90 turn/min", 3 * math.pi),
        ("-2 Hz", -4 * math.pi),
        ("0 Hz", 0.0),
    ],
)
def test_rates_count_turns(text: str, rad_per_s: float) -> None:
    """1 Hz of a rotating part is 2 pi rad/s."""
    assert parse_quantity(text, KINDS["rate"]) == pytest.approx(rad_per_s, rel=1e-15, abs=0)


@pytest.mark.parametrize(
    ("kind", "unit"), [(name, unit) for name, kind in KINDS.items() for unit in (kind.unit, *USUAL.get(kind.unit, ()))]
)
def test_usual_units_are_those_of_pint(kind: str, unit: str) -> None:
    found = _registry().Quantity(1.0, unit)
    assert _factor(unit, KINDS[kind]) == found.to(KINDS[kind].unit).magnitude


@pytest.mark.parametrize("unit", ["1/s", "/s", "s^-1", "s**-1", "s⁻¹", "1/min"])
def test_a_bare_reciprocal_second_is_no_rate(unit: str) -> None:
    with pytest.raises(InputError, match=r"does not say what turns.*rad/s, Hz, rpm"):
        parse_quantity(f"3 {unit}", KINDS["rate"])


@pytest.mark.parametrize("unit", ["cSt", "mm^2/s", "St", "m**2/s"])
def test_kinematic_viscosity_is_no_viscosity(unit: str) -> None:
    """The labels of silicone oils give it."""
    with pytest.raises(InputError, match=r"is a unit of kinematic viscosity; allowed: .*970 kg/m\^3 are 0\.97 Pa s"):
        parse_quantity(f"1000 {unit}", KINDS["viscosity"])
    with pytest.raises(InputError, match="is not a unit of length"):
        parse_quantity(f"1000 {unit}", KINDS["length"])


@pytest.mark.parametrize(
    ("kind", "text", "si"),
    [
        ("length", "18 mm", 0.018),
        ("length", "18mm", 0.018),
        ("length", " 1.8 cm ", 0.018),
        ("length", "+18e-3 m", 0.018),
        ("length", ".5 um", 5e-7),
        ("length", "18 µm", 18e-6),  # micro sign
        ("length", "18 μm", 18e-6),  # Greek mu
        ("length", "1 in", 0.0254),
        ("length or zero", "0 mm", 0.0),
        ("mass", "10.7 g", 0.0107),
        ("density", "985 kg/m^3", 985.0),
        ("density", "985 kg/m³", 985.0),
        ("density", "0.985 g/cm^3", 985.0),
        ("viscosity", "3.5 Pa s", 3.5),
        ("viscosity", "3500 cP", 3.5),
        ("viscosity", "3.5 N s/m^2", 3.5),
        ("torque", "0.1 mN m", 1e-4),
        ("rotary friction", "7e-7 N m s/rad", 7e-7),
        ("rotary friction", "7e-7 N m s", 7e-7),
        ("back-emf constant", "0.004 V s/rad", 0.004),
        ("back-emf constant", "0.004 V s", 0.004),
        ("back-emf constant", "1 mV/rpm", 0.03 / math.pi),
        ("torque constant", "0.45 mN m/A", 4.5e-4),
        ("charge", "70 mA h", 252.0),
        ("charge", "70 mAh", 252.0),
        ("charge", "252 C", 252.0),
        ("resistance", "10.4 ohm", 10.4),
        ("resistance", "10.4 \u03a9", 10.4),  # Greek capital omega
        ("resistance", "10.4 \u2126", 10.4),  # ohm sign
        ("inductance", "82 mH", 0.082),
        ("inverse current", "54.6 1/A", 54.6),
        ("inverse current", "54.6 /A", 54.6),
        ("resistance per current", "-1.555 ohm/A", -1.555),
        ("voltage", "3.7 V", 3.7),
        ("time", "2 min", 120.0),
    ],
)
def test_si_values(kind: str, text: str, si: float) -> None:
    assert parse_quantity(text, KINDS[kind]) == pytest.approx(si, rel=1e-14, abs=0)


@pytest.mark.parametrize(
    ("kind", "texts", "si"),
    [
        ("length", "um|µm|μm|㎛|micron|microns|micrometer|Micrometre|UM", 1e-6),
        ("length", "mm|㎜|mm.|millimeters|Millimetre", 1e-3),
        ("length", "in|inch|inches|Inch|IN", 0.0254),
        ("length", "ft|feet|foot", 0.3048),
        ("velocity", "mm/s|mm/sec|mm/Sec|mm s^-1|mm s-1|mm·s⁻¹|mm⋅s⁻¹|mm.s-1|mm*s**-1|mm per second", 1e-3),
        ("rate", "Hz|hz|HZ|rps|RPS|turn/s|turns/s|rev/s|r/s", 2 * math.pi),
        ("rate", "rpm|RPM|Rpm|r/min|rev/min|U/min|turns per minute", math.pi / 30),
        ("rate", "deg/s|Deg/s|°/s|º/s|degrees/sec", math.pi / 180),
        ("angle", "deg|DEG|°|º|degree|Degrees", math.pi / 180),
        ("viscosity", "Pa s|Pa·s|Pa.s|Pa-s|Pas|pa s|PA S|N s/m2|N·s/m²|kg/(m s)|kg m^-1 s^-1", 1.0),
        ("viscosity", "mPa s|mPas|mPa.s|mPa·s|mPa-s|mpa s|cP|CP|cp|cps|cPs|centipoise|Centipoise", 1e-3),
        ("density", "g/cm3|g/cm³|g cm-3|g/cc|g/ml|g/mL|kg/dm3|kg/L", 1e3),
        ("mass", "kg|Kg|KG|kilogram|kilograms", 1.0),
        ("mass", "ug|µg|mcg", 1e-9),
        ("torque", "mN m|mNm|mN·m|mN.m|mN-m|N mm|Nmm", 1e-3),
        ("torque", "pN nm|pNnm|pN·nm", 1e-21),
        ("torque", "gf cm|gf.cm|gf·cm|gfcm", 9.80665e-5),
        ("torque", "ozf in|ozf-in", 0.45359237 / 16 * 9.80665 * 0.0254),
        ("viscosity", "psi s", 0.45359237 * 9.80665 / 0.0254**2),
        ("magnetic field", "G|Gs|gauss|Gauss", 1e-4),
        ("magnetic field", "mT|mt|millitesla", 1e-3),
        ("magnetic moment", "A m^2|A m2|A·m²|Am2|Am²|A.m^2|J/T", 1.0),
        ("magnetic moment", "emu|EMU|erg/G|mA m2", 1e-3),
        ("charge", "mAh|mA h|mah|mA·h|mA hr", 3.6),
        ("current", "mA|ma|milliamps", 1e-3),
        ("voltage", "V|v|Volt|volts", 1.0),
        ("resistance", "kohm|kOhm|kΩ|k\u2126", 1e3),
        ("torque constant", "mN m/A|mNm/A|mN·m/A|mNm/amp", 1e-3),
        ("back-emf constant", "mV/rpm|mV/RPM|V/krpm|V/kRPM", 0.03 / math.pi),
        ("back-emf constant", "Vs/rad|V s/rad|V/(rad/s)|Vs", 1.0),
        ("rotary friction", "Nms|Nms/rad|N m/(rad/s)|N·m·s", 1.0),
        ("time", "min|MIN|mins|minutes", 60.0),
    ],
)
def test_units_as_people_write_them(kind: str, texts: str, si: float) -> None:
    for unit in texts.split("|"):
        value = parse_quantity(f"0.5 {unit}", KINDS[kind])
        assert value == pytest.approx(0.5 * si, rel=1e-12, abs=0), unit


@pytest.mark.parametrize("sign", ["\u2212", "\u2013", "\u2010"])
def test_minus_signs_of_unicode(sign: str) -> None:
    assert parse_quantity(f"{sign}2e{sign}1 mm/s", KINDS["velocity"]) == -2e-4


@pytest.mark.parametrize(
    ("kind", "unit", "words"),
    [
        ("magnetic field", "Oe", "field strength; allowed: the flux density in T: .* 1 Oe is 0.1 mT"),
        ("magnetic field", "kA/m", "field strength; allowed: the flux density in T"),
        ("torque", "kg cm", "is mass times length; allowed: .* N m"),
        ("torque", "oz-in", "is mass times length"),
        ("magnetic moment", "emu/g", r"is a moment per mass; allowed: .* A m\^2"),
        ("length", "MM", "may mean Mm or mm; allowed: a unit of length"),
        ("viscosity", "MPA S", "may mean MPa s or mPa s"),
        ("viscosity", "CST", "kinematic viscosity"),
        ("mass", "gr", r"is not a known unit; .* \(SI: kg\)"),  # gram or grain
        ("length", "ms", r"is not a unit of length; .* \(SI: m\)"),
        ("length", "s", "is not a unit of length"),
        ("mass", "G", "is not a unit of mass"),
        ("torque", "mN", "is not a unit of torque"),
        ("viscosity", "kg/ms", "is not a unit of viscosity"),
        ("length", "mil", "is not a known unit"),
    ],
)
def test_ambiguous_and_other_units_name_what_is_allowed(kind: str, unit: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        parse_quantity(f"1 {unit}", KINDS[kind])


def test_a_decimal_comma_is_named() -> None:
    with pytest.raises(InputError, match=r"is not a unit; .* a decimal point in the number"):
        parse_quantity("18,5 mm", KINDS["length"])


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_every_kinds_own_words_are_true(kind: str) -> None:
    """The example of a sentence is accepted, the ends of the range too, and what lies beyond is not."""
    chosen = KINDS[kind]
    parse_quantity(chosen.example, chosen)
    for end in (chosen.low, chosen.high):
        value = parse_quantity(end, chosen)
        number, unit = end.split(" ", 1)
        outward = -1 if end == chosen.low else 1
        beyond = float(number) + outward * (abs(float(number)) * 1e-6 or 1e-12)
        assert value == float(number) * parse_quantity(f"1 {unit}", chosen) if 0 < value < 1e3 else True
        with pytest.raises(InputError, match="out of range; allowed: "):
            parse_quantity(f"{beyond!r} {unit}", chosen)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("18", "has no unit"),
        (18, "has no unit"),
        (18.0, "has no unit"),
        (10**400, "has no unit"),
        ("18 kg", '"kg" is not a unit of length'),
        ("18 Hz", '"Hz" is not a unit of length'),
        ("18 parsnip", '"parsnip" is not a known unit'),
        ("18 m m", '"m m" is not a unit of length'),
        ("18 m; 3", "is not a unit"),
        ("18 mm 20 mm", "is not a unit"),
        ("nan mm", "is not finite"),
        ("-inf mm", "is not finite"),
        ("1e999 mm", "is not finite"),
        (math.nan, "is not finite"),
        (math.inf, "is not finite"),
        ("mm", "is not a length"),
        ("", "is not a length"),
        ("18,5 mm", "is not a unit"),
        (True, "is not a length"),
        (None, "is not a length"),
        (["18 mm"], "is not a length"),
        ({"value": 18}, "is not a length"),
        ("1" * 300 + " mm", "is not a length"),
        ("1 " + "m" * 100, "is not a unit"),
        ("0 mm", "is out of range; allowed: 1 nm to 100 m"),
        ("-18 mm", "is out of range; allowed: 1 nm to 100 m"),
        ("1 m^99999999", "is not a unit"),
        ("1 __import__('os')", "is not a unit"),
    ],
)
def test_what_is_refused(text: Any, complaint: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_quantity(text, KINDS["length"])
    sentence = str(caught.value)
    assert complaint in sentence
    assert "\n" not in sentence
    assert len(sentence) < 400


def test_towers_of_powers_are_refused_at_once() -> None:
    """In a process of its own: 9**9**9**9 would never be done."""
    program = """
from spirillum.errors import InputError
from spirillum.units import KINDS, USUAL, _factor, _registry, parse_quantity
for text in ("1 m**9**9**9**9", "1 m^9^9^9^9", "1 m**9 **9 **9 **9", "1 m^-9^9^9^9", "1 m**9^9**9^9", "1 m²**9**9**9"):
    try:
        parse_quantity(text, KINDS["length"])
    except InputError:
        continue
    raise SystemExit(text)
"""
    subprocess.run([sys.executable, "-c", program], check=True, timeout=600)


def test_angle_is_no_number() -> None:
    """A torque per radian is no torque, and a length times a radian no length."""
    for kind, text in (
        ("torque", "1 N m/rad"),
        ("length", "1 mm rad"),
        ("rate", "1 rad"),
        ("rotary friction", "1 N m"),
    ):
        with pytest.raises(InputError, match="is not a unit of"):
            parse_quantity(text, KINDS[kind])


def test_quantities_of_pint_come_with_their_unit() -> None:
    import pint

    registry = pint.UnitRegistry()
    assert parse_quantity(registry.Quantity(18, "mm"), KINDS["length"]) == pytest.approx(0.018, rel=1e-14)
    assert parse_quantity(registry.Quantity(90, "rpm"), KINDS["rate"]) == pytest.approx(3 * math.pi, rel=1e-14)


@pytest.mark.parametrize(("value", "unit", "shown"), [(0.025, "mm", 25), (2 * math.pi, "Hz", 1), (math.pi, "deg", 180)])
def test_shown_in_display_units(value: float, unit: str, shown: float) -> None:
    assert shown_in(value, unit) == pytest.approx(shown, rel=1e-14)
    assert show(value, unit) == f"{shown:g} {unit}"


@pytest.mark.parametrize(
    "unit",
    [
        *("mm", "um", "m/s", "mm/s", "nm/s", "rad/s", "Hz", "kg", "g", "mg", "ug", "pg", "mN", "uN", "nN", "pN", "fN"),
        *("mN m", "uN m", "nN m", "pN m", "pN um", "pN nm", "mW", "uW", "nW", "pW", "fW", "aW", "mA", "deg", "min"),
    ],
)
def test_display_units_agree_with_units_that_are_read(unit: str) -> None:
    """The table of display units and the registry give the same factor where both know the unit."""
    for kind in KINDS.values():
        try:
            si = parse_quantity(f"0.5 {unit}", kind)
        except InputError:
            continue
        assert shown_in(si, unit) == pytest.approx(0.5, rel=1e-14)


@pytest.mark.parametrize(
    ("value", "unit", "shown"),
    [(1e-4, "N m", "0.1 mN m"), (6.5e-19, "N m", "650 pN nm"), (5.57e-16, "W", "0.557 fW"), (2e-8, "W", "0.02 uW")],
)
def test_units_scale_with_the_robot(value: float, unit: str, shown: str) -> None:
    assert show(value, display_unit(value, unit)) == shown


def test_a_zero_has_the_unit_of_what_stands_beside_it() -> None:
    assert among(0.0, "W", [5.57e-16, None, 0.0]) == "fW"
    assert among(0.0, "W", []) == "mW"
    assert among(2.0, "W", [5.57e-16]) == "mW"


NUMBERS = ["1", "2", "18", "-3.5", "1e5", "1e-300", "99999", ".", "nan", "inf", "٣"]
WORDS = ["m", "mm", "rad", "s", "Hz", "kg", "°", "µ", "㎜", "é", "if", "lambda", "delta_"]
SIGNS = ["/", "*", "**", "^", "-", "(", ")", "²", "·", "_", "[", "{", "}", "%", " ", "\n", "\r", "\x00", "\u2028"]
pieces = st.sampled_from(NUMBERS + WORDS + SIGNS)
anything = st.one_of(
    st.text(max_size=60),
    st.lists(pieces, max_size=14).map("".join),
    st.lists(pieces, max_size=14).map(" ".join),
    st.lists(pieces, max_size=10).map(lambda parts: "2 " + "".join(parts)),
    st.integers(),
    st.floats(),
    st.none(),
    st.binary(max_size=10),
)


@given(text=anything, kind=st.sampled_from(sorted(KINDS)))
@example(text="2 m\nm", kind="length")
@example(text="18 m\nnonsense", kind="length")
@example(text="18\x00", kind="length")
@example(text="18 " + "(" * 39, kind="length")
@example(text="1 " + "/m" * 20, kind="length")
@example(text="9" * 199 + " mm", kind="length")
def test_any_text_is_a_quantity_or_an_input_error(text: Any, kind: str) -> None:
    is_a_quantity_or_an_input_error(text, kind)


@pytest.mark.slow
@settings(max_examples=2000)
@given(text=anything, kind=st.sampled_from(sorted(KINDS)))
def test_of_many_texts_each_is_a_quantity_or_an_input_error(text: Any, kind: str) -> None:
    is_a_quantity_or_an_input_error(text, kind)


def is_a_quantity_or_an_input_error(text: Any, kind: str) -> None:
    started = time.process_time()
    try:
        value = parse_quantity(text, KINDS[kind])
    except InputError as error:
        sentence = str(error)
    else:
        sentence = ""
        assert math.isfinite(value)
    assert len(sentence.splitlines()) < 2
    assert len(sentence) < 400
    assert time.process_time() - started < 2  # the first call builds the registry


@pytest.mark.parametrize(
    ("ask", "unit"),
    [
        (lambda text: sp.predict("biorob2012-wide", tail_rate=text), "rad/s"),
        (lambda text: sp.predict("biorob2012-wide", placement={"gap": text}), "m"),
        (lambda text: sp.predict("biorob2012-wide", placement={"pitch": text}), "rad"),
        (lambda text: sp.simulate("biorob2012-wide", timing={"duration": text}), "s"),
        (lambda text: sp.resistance("biorob2012-wide", phase=text), "rad"),
    ],
)
def test_text_without_a_unit_is_refused_with_what_a_float_means(ask: Callable[[Any], object], unit: str) -> None:
    with pytest.raises(InputError, match=rf' = "0\.2" has no unit; .*; in Python a float is in {unit}$'):
        ask("0.2")


def test_a_float_is_what_the_first_line_of_the_docstring_says() -> None:
    assert "rates in rad/s" in str(sp.predict.__doc__).splitlines()[0]
    one, other = (sp.predict("biorob2012-wide", model="rft", tail_rate=rate) for rate in (1.2, "1.2 rad/s"))
    assert one.forward_velocity == other.forward_velocity


def test_fields_of_a_file_take_no_float() -> None:
    """Where a number without unit is refused, nothing is said of what it would mean."""
    with pytest.raises(InputError, match=r'has no unit; allowed: a number with its unit, for example "18 mm"$'):
        sp.load("biorob2012-wide", **{"tail.wavelength": 0.02})


def test_slow_and_fast_runs_of_a_robot_have_one_unit() -> None:
    from spirillum.units import Hz, speed_unit

    assert {speed_unit(speed, 1.4 * Hz) for speed in (1e-5, 4e-5, -5e-4)} == {"mm/s"}
    assert speed_unit(2e-5, 110 * Hz) == "um/s"  # a bacterium
    assert speed_unit(2e-5, None) == speed_unit(2e-5, 0.0) == "um/s"
