"""The motor's steady current against eq. (17) itself, with Table II's numbers and with motors of all kinds."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize.elementwise import find_root

from spirillum.errors import InputError
from spirillum.swimming.balance import battery_voltage, run_time, steady_current, winding_resistance


def table_ii_resistance(current: np.ndarray) -> np.ndarray:
    return 10.4 + 30 * np.exp(-54.6 * current) + np.exp(current) - 1.555 * current


@pytest.mark.parametrize("current", [0.0, 1e-3, 0.02, 0.1, 0.3])
def test_table_ii(wide: Any, current: float) -> None:
    """R(I) and V(I) as printed; both take the magnitude of the current."""
    i = np.array([current])
    motor = wide.electrics
    assert winding_resistance(motor, i)[0] == pytest.approx(table_ii_resistance(i)[0], rel=1e-14)
    assert battery_voltage(motor, i)[0] == pytest.approx(3.7 - 0.8 * current, rel=1e-14)
    np.testing.assert_array_equal(winding_resistance(motor, -i), winding_resistance(motor, i))
    np.testing.assert_array_equal(battery_voltage(motor, -i), battery_voltage(motor, i))


@pytest.mark.parametrize("duty", [1.0, 0.3, 0.0])
@pytest.mark.parametrize("per_current", [0.0, 0.5, 40.0])
def test_current_solves_17_for_the_papers_motor(wide: Any, duty: float, per_current: float) -> None:
    """Back-emf from helping (the tail turns against the voltage) to well above the battery (the tail drives)."""
    back_emf = np.linspace(-6, 9, 61)
    motor = replace(wide.electrics, duty=np.array([duty]))
    current = steady_current(motor, back_emf, np.array([per_current]))
    drop = table_ii_resistance(np.abs(current)) * current
    supply = duty * (3.7 - 0.8 * np.abs(current)) - back_emf - per_current * current
    np.testing.assert_allclose(drop, supply, atol=1e-12 * 10)
    # The sign is that of the voltage that is left over.
    left_over = duty * 3.7 - back_emf
    np.testing.assert_array_equal(np.sign(current), np.sign(np.where(np.abs(left_over) < 1e-300, 0.0, left_over)))
    assert np.all(np.diff(current) < 0)


def test_every_current_of_many_is_as_good_as_rounding(wide: Any) -> None:
    """Against Chandrupatla's method, for loads at which the search ends by halving its bracket, too."""
    per_current = np.random.default_rng(0).uniform(0.5, 40, 4096)

    def excess(i: np.ndarray, load: np.ndarray) -> np.ndarray:
        return (table_ii_resistance(i) + load) * i - (3.7 - 0.8 * i)

    root = find_root(excess, (np.zeros(4096), np.full(4096, 3.0)), args=(per_current,)).x
    current = steady_current(wide.electrics, np.zeros(1), per_current)
    np.testing.assert_allclose(current, root, rtol=1e-13)


motors = st.fixed_dictionaries(
    {
        "constant": st.floats(0.0, 50),
        "decay": st.floats(0, 60),
        "decay_rate": st.floats(0, 100),
        "growth": st.floats(0, 5),
        "growth_rate": st.floats(0, 60),
        "slope": st.floats(-3, 3),
        "voltage": st.floats(0.5, 24),
        "internal_resistance": st.floats(0, 5),
        "duty": st.floats(0, 1),
    }
)
_UNITS = {"decay_rate": "1/A", "growth_rate": "1/A", "slope": "ohm/A", "voltage": "V"}


def electrics(batch_of: Callable[..., Any], motor: dict[str, float]) -> Any:
    """Motor and battery as the robot file accepts them, or the example is given up."""
    fields = {
        name: value if name == "duty" else f"{value!r} {_UNITS.get(name, 'ohm')}" for name, value in motor.items()
    }
    places = {"voltage": "battery__", "internal_resistance": "battery__", "duty": "drive__"}
    try:
        batch = batch_of(**{places.get(name, "motor__resistance__") + name: text for name, text in fields.items()})
    except InputError:
        assume(False)
    return batch.electrics


@settings(max_examples=25)
@given(motor=motors, back_emf=st.floats(-30, 30), per_current=st.one_of(st.just(0.0), st.floats(1e-6, 1e3)))
def test_current_solves_17_for_every_motor_that_a_file_may_describe(
    batch_of: Callable[..., Any], motor: dict[str, float], back_emf: float, per_current: float
) -> None:
    chosen = electrics(batch_of, motor)
    left_over = motor["duty"] * motor["voltage"] - back_emf
    # Driven by the tail, a battery with more resistance than the winding has no steady current at all.
    assume(left_over >= 0 or motor["constant"] + motor["slope"] > motor["internal_resistance"] + 1)
    # Above the stall current R(I) is the fit's extrapolation, which need not rise.
    assume(abs(left_over) <= motor["voltage"])
    with np.errstate(all="ignore"):  # as `swim` calls it: what counts is the root
        i = steady_current(chosen, np.array([back_emf]), np.array([per_current]))
    drop = winding_resistance(chosen, i) * i
    supply = chosen.duty * battery_voltage(chosen, i) - back_emf - per_current * i
    size = max(1.0, abs(back_emf), motor["voltage"])
    assert drop[0] == pytest.approx(supply[0], abs=1e-11 * size)


def test_a_winding_almost_without_resistance_at_rest(batch_of: Callable[..., Any]) -> None:
    """R(I) = slope I and a vanishing rest: slope I^2 = V."""
    motor = {"constant": 0.0, "decay": 5e-199, "growth": 0.0, "slope": 4.0, "voltage": 1.0, "internal_resistance": 0.0}
    chosen = electrics(batch_of, motor)
    assert steady_current(chosen, np.zeros(1), np.zeros(1))[0] == pytest.approx(0.5, rel=1e-12)


def test_ohmic_motor_in_closed_form(batch_of: Callable[..., Any]) -> None:
    """With constant resistances (17) is linear: I = duty V/(R + duty r + K_b d omega_m/dI)."""
    motor = {"constant": 12.0, "decay": 0.0, "growth": 0.0, "slope": 0.0, "voltage": 3.7, "internal_resistance": 0.8}
    chosen = electrics(batch_of, {**motor, "duty": 0.7})
    for back_emf, per_current in ((0.0, 0.0), (0.4, 0.0), (0.4, 3.0), (-1.0, 3.0)):
        current = steady_current(chosen, np.array([back_emf]), np.array([per_current]))[0]
        assert current == pytest.approx((0.7 * 3.7 - back_emf) / (12 + 0.7 * 0.8 + per_current), rel=1e-12)


def test_resistance_that_is_all_in_one_term(batch_of: Callable[..., Any]) -> None:
    """The same ohmic motor, its resistance written as the amplitude of a decay at rate zero."""
    motor = {"constant": 0.0, "decay": 12.0, "decay_rate": 0.0, "growth": 0.0, "slope": 0.0}
    chosen = electrics(batch_of, {**motor, "voltage": 3.7, "internal_resistance": 0.0, "duty": 1.0})
    with np.errstate(all="ignore"):
        current = steady_current(chosen, np.zeros(1), np.zeros(1))[0]
    assert current == pytest.approx(3.7 / 12, rel=1e-12)


def test_resistance_that_grows_beyond_all_numbers(batch_of: Callable[..., Any]) -> None:
    """The search for the root may not stop where exp(growth_rate I) overflows, far beyond the root."""
    motor = {"constant": 1.0, "decay": 12.0, "decay_rate": 1e-3, "growth": 1e-3, "growth_rate": 50.0, "slope": 0.0}
    chosen = electrics(batch_of, {**motor, "voltage": 24.0, "internal_resistance": 0.0, "duty": 1.0})
    with np.errstate(all="ignore"):
        i = steady_current(chosen, np.array([0.02]), np.zeros(1))[0]
    drop = (1 + 12 * np.exp(-1e-3 * i) + 1e-3 * np.exp(min(50 * i, 700.0))) * i
    assert drop == pytest.approx(24 - 0.02, rel=1e-11)


def test_no_current_where_17_has_no_root(batch_of: Callable[..., Any]) -> None:
    """A tail that drives the motor through a battery with more resistance than the winding: 0.1 I = -4.3 + 5 I, I < 0.

    V(I) takes |I|, so both sides move apart; any number would be a wrong answer.
    """
    motor = {"constant": 0.1, "decay": 0.0, "growth": 0.0, "slope": 0.0, "voltage": 3.7, "internal_resistance": 5.0}
    chosen = electrics(batch_of, {**motor, "duty": 1.0})
    with np.errstate(all="ignore"):
        current = steady_current(chosen, np.array([8.0]), np.zeros(1))
    assert np.isnan(current[0])


def test_run_time_is_charge_over_the_batterys_current(wide: Any) -> None:
    """70 mA h at a motor current of 0.2 A and half duty: 252 C/(0.1 A)."""
    motor = replace(wide.electrics, duty=np.array([0.5]))
    assert run_time(motor, np.array([0.2]))[0] == pytest.approx(2520, rel=1e-12)
    assert run_time(motor, np.array([-0.2]))[0] == pytest.approx(2520, rel=1e-12)
    assert np.isinf(run_time(motor, np.zeros(1))[0])
    assert np.isnan(run_time(replace(motor, capacity=np.array([np.nan])), np.array([0.2]))[0])
