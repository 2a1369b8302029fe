"""One hertz of rotation is 2 pi rad/s, and a rate without a unit is refused.

A factor of 6.28 in a rate is easy to overlook, since it stays within the range of sensible speeds.
"""

import math

import spirillum as sp

turning = sp.predict("biorob2012-wide", model="sbt", tail_rate="1 Hz")
for same in ("1 turn/s", "60 rpm", "6.283185307179586 rad/s", 2 * math.pi):  # a bare float is rad/s
    again = sp.predict("biorob2012-wide", model="sbt", tail_rate=same)
    assert math.isclose(again.forward_velocity, turning.forward_velocity, rel_tol=1e-12)
assert math.isclose(turning.tail_rotation_rate, 2 * math.pi)

per_turn = 2 * math.pi * turning.advance_per_radian
print(f"{1e3 * turning.forward_velocity:.4f} mm/s at one turn per second, {1e3 * per_turn:.4f} mm per turn")
assert math.isclose(turning.forward_velocity, per_turn * 1.0)  # times one turn per second

try:
    sp.predict("biorob2012-wide", tail_rate="6.28 1/s")
except sp.InputError as error:
    print(error)
else:
    raise AssertionError("1/s does not say what turns")
