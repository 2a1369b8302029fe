"""The motor's current (17) of robots in axial motion, many at a time; compiled.

While duty and flow stay, the current I obeys one equation of its own,

    L dI/dt = p d V(|I|) - R(|I|) I - K_b (s K_m I + c U_m),

with duty d, polarity p, the motor rates s per torque and c per imposed flow U_m. Position, angles, charge and energies
are linear in its integrals and those of I^2 and R I^2. A step is cut into pieces of the classical Runge-Kutta method of
order 4, whose lengths grow evenly: what is fast lies behind a change of the inputs, hence at the start of a step. From
where the current is steady to 1e-12 on, the rest of a step is exact. Robots are advanced in blocks whose loops the
processor's vector units take, which is why the exponentials of R(I) are polynomials here.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from spirillum.arrays import Samples

# Parameters of one robot, SI; torques and rates at the joint.
TORQUE, EMF, INDUCTANCE = 0, 1, 2  # K_m, N m/A; K_b, V s/rad; L, H
CONSTANT, DECAY, DECAY_RATE, GROWTH, GROWTH_RATE, SLOPE = 3, 4, 5, 6, 7, 8  # R(I) of Table II
VOLTAGE, INTERNAL, POLARITY = 9, 10, 11  # V(I) of Table II; sign of the driven rate about +x
SPEED, BODY, TAIL = 12, 13, 14  # U, Omega, omega per joint torque
SPEED_FLOW, BODY_FLOW, TAIL_FLOW = 15, 16, 17  # U, Omega, omega per imposed mean flow
PARAMETERS = 18

# The state of one robot.
CURRENT, POSITION, TAIL_ANGLE, BODY_ANGLE, CHARGE = 0, 1, 2, 3, 4
SQUARE, HEAT = 5, 6  # integrals of I^2, A^2 s, and of R I^2, J
STATES = 7

_BLOCK = 64
"""Robots of one block: their columns stay in the processor's cache."""
_PIECES, _FEWEST, _MOST = 2.0, 28, 1e12
"""Pieces of a step: for each time constant L/R of the motor at rest, and besides; errors below 1e-6 (tested), also of
drives that are switched at every step."""
_GROWTH, _GROWTH_PER = 3.0, 0.25
"""How much longer the last piece is than the first, in lengths of the first: at most, and for each time constant."""
_LOOK = 8
"""Pieces between two looks whether the currents are steady."""
_STEADY, _LEAST = 1e-12, 1e-3
"""Relative change of a current within the shortest time constant below which it is steady; a current is at least so
large here, A."""
_C2, _C3, _C4, _C5, _C6 = 1 / 2, 1 / 6, 1 / 24, 1 / 120, 1 / 720
_C7, _C8, _C9, _C10, _C11 = 1 / 5040, 1 / 40320, 1 / 362880, 1 / 3628800, 1 / 39916800


@numba.njit(inline="always")
def _exponential(x: float) -> float:
    """exp(x) for -40 < x < 30, to 2e-8 of the larger of it and 1, as the 32nd power of a polynomial."""
    z = min(max(x, -40.0), 30.0) * 0.03125
    y = _C6 + z * (_C7 + z * (_C8 + z * (_C9 + z * (_C10 + z * _C11))))
    y = 1.0 + z * (1.0 + z * (_C2 + z * (_C3 + z * (_C4 + z * (_C5 + z * y)))))
    y *= y
    y *= y
    y *= y
    y *= y
    return y * y


@numba.njit(inline="always")
def _rate(i: float, always: float, c: tuple[float, float, float, float, float, float, float]) -> tuple[float, float]:
    """dI/dt of (17), all coefficients over L; the resistance that it rests on, back-emf included, over L."""
    falling, fall, rising, rise, bend, supply, sag = c
    size = abs(i)
    r = always + falling * _exponential(fall * size) + rising * _exponential(rise * size) + bend * size
    return supply - sag * size - r * i, r


@numba.njit(inline="always")
def _add(p: Samples, state: Samples, duty: float, carried: float, charge: float, square: float, loss: float) -> None:
    """Add a step to a robot: integrals of U_m, I, I^2 and, as `loss`, of all resistance times I^2 over L."""
    impulse, emf = p[TORQUE] * charge, p[EMF] * (p[TAIL] - p[BODY]) * p[TORQUE]
    state[POSITION] += p[SPEED] * impulse + p[SPEED_FLOW] * carried
    state[TAIL_ANGLE] += p[TAIL] * impulse + p[TAIL_FLOW] * carried
    state[BODY_ANGLE] += p[BODY] * impulse + p[BODY_FLOW] * carried
    state[CHARGE] += p[POLARITY] * duty * charge
    state[SQUARE] += square
    state[HEAT] += p[INDUCTANCE] * loss - emf * square


@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def advance(  # noqa: PLR0915 - one loop over the pieces of a step
    parameters: Samples, states: Samples, dt: float, duty: Samples, flow: Samples, fineness: float = 1.0
) -> None:
    """Take robots over a time, each at its own duty and flow.

    Args:
        parameters: (n, `PARAMETERS`).
        states: (n, `STATES`), changed in place; NaN where duty, flow or parameters are none.
        dt: s, positive.
        duty: 0 to 1, (n,).
        flow: imposed mean flow, m/s, (n,).
        fineness: number of pieces, relative to the normal one.
    """
    # Columns of a block, each an array of its own, so that the compiler knows that none lies in another.
    always, falling, fall, rising = np.empty(_BLOCK), np.empty(_BLOCK), np.empty(_BLOCK), np.empty(_BLOCK)
    rise, bend, supply, sag = np.empty(_BLOCK), np.empty(_BLOCK), np.empty(_BLOCK), np.empty(_BLOCK)
    current, charge, square, heat = np.empty(_BLOCK), np.empty(_BLOCK), np.empty(_BLOCK), np.empty(_BLOCK)
    for low in range(0, states.shape[0], _BLOCK):
        width = min(_BLOCK, states.shape[0] - low)
        fastest = 0.0
        for k in range(width):
            n = low + k
            p = parameters[n]
            over, slip, driven = 1.0 / p[INDUCTANCE], p[TAIL] - p[BODY], p[POLARITY] * duty[n] / p[INDUCTANCE]
            always[k] = (p[CONSTANT] + p[EMF] * slip * p[TORQUE]) * over
            falling[k], fall[k] = p[DECAY] * over, -p[DECAY_RATE]
            rising[k], rise[k] = p[GROWTH] * over, p[GROWTH_RATE]
            bend[k], sag[k] = p[SLOPE] * over, driven * p[INTERNAL]
            supply[k] = driven * p[VOLTAGE] - p[EMF] * (p[TAIL_FLOW] - p[BODY_FLOW]) * flow[n] * over
            current[k], charge[k], square[k], heat[k] = states[n, CURRENT], 0.0, 0.0, 0.0
            fastest = max(fastest, always[k] + falling[k] + rising[k] + abs(sag[k]))
        constants = dt * fastest
        pieces = int(min(math.ceil(fineness * (_PIECES * constants + _FEWEST)), _MOST))
        growth = min(_GROWTH, _GROWTH_PER * constants)
        first = dt / (pieces + 0.5 * growth * (pieces - 1))
        done, rest = 0.0, 0.0
        for piece in range(pieces):
            if piece % _LOOK == 0:
                steady = 0
                while steady < width:
                    k = steady
                    c = (falling[k], fall[k], rising[k], rise[k], bend[k], supply[k], sag[k])
                    if abs(_rate(current[k], always[k], c)[0]) > _STEADY * fastest * max(abs(current[k]), _LEAST):
                        break
                    steady += 1
                if steady == width:
                    rest = dt - done
                    break
            h = first * (1.0 + growth * piece / pieces)
            half, sixth = 0.5 * h, h / 6.0
            done += h
            for k in range(width):
                c = (falling[k], fall[k], rising[k], rise[k], bend[k], supply[k], sag[k])
                i = current[k]
                k1, r1 = _rate(i, always[k], c)
                i2 = i + half * k1
                k2, r2 = _rate(i2, always[k], c)
                i3 = i + half * k2
                k3, r3 = _rate(i3, always[k], c)
                i4 = i + h * k3
                k4, r4 = _rate(i4, always[k], c)
                charge[k] += sixth * (i + 2.0 * (i2 + i3) + i4)
                i_2, i2_2, i3_2, i4_2 = i * i, i2 * i2, i3 * i3, i4 * i4
                square[k] += sixth * (i_2 + 2.0 * (i2_2 + i3_2) + i4_2)
                heat[k] += sixth * (r1 * i_2 + 2.0 * (r2 * i2_2 + r3 * i3_2) + r4 * i4_2)
                current[k] = i + sixth * (k1 + 2.0 * (k2 + k3) + k4)
        for k in range(width):
            n, i = low + k, current[k]
            c = (falling[k], fall[k], rising[k], rise[k], bend[k], supply[k], sag[k])
            loss = heat[k] + _rate(i, always[k], c)[1] * i * i * rest
            states[n, CURRENT] = i
            _add(parameters[n], states[n], duty[n], flow[n] * dt, charge[k] + i * rest, square[k] + i * i * rest, loss)
