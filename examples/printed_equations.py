"""Eqs (1) to (7), written out by hand, against the force balance that `predict` solves.

The program has no code for (1), (2), (4) and (5): it inverts Lighthill's averaged relation into an axial
resistance block and balances forces and torques. Both have to give the same speed and body rate.
"""

import math

import spirillum as sp
from spirillum.fluid.closed.perrin import body_axial
from spirillum.fluid.closed.sbt import lighthill_integrals

robot = sp.load("biorob2012-wide")
answer = sp.predict(robot, model="sbt", tail_rate="1.2 Hz", calibrated=False)

mu, tail, D_b = robot.fluid.viscosity, robot.tail, robot.body.diameter
lam, b, omega = tail.wavelength, tail.amplitude, answer.tail_rotation_rate
drag, rotation = (float(entry[0]) for entry in body_axial(sp.RobotBatch.of(robot)))
D_x = drag / (3 * math.pi * mu * D_b)  # dimensionless in (4) and (5)
E_x = rotation  # N m s in (2)

alpha = 1 / math.hypot(1, 2 * math.pi * b / lam)
a2 = alpha**2
A1, A2, A3 = (float(value) for value in lighthill_integrals(alpha))
log_eps = math.log(2.6 * alpha * tail.wire_diameter / lam)
arc = tail.length / alpha  # the wire's arc length stands for L_t in (2), (4), (5)
q = -1 - log_eps + A1

chi = 1 / (-(1 - a2) - (2 - a2) * log_eps + a2 * A1 + 2 * (1 - a2) * A2)  # (3)
log_turns = math.log(2 * math.pi * tail.length / lam)
Psi = 1.5 * (2 - a2 - 3 / alpha + 2 / alpha * log_turns - (1 + a2) * log_eps - 2 * A3 - (1 - a2) * A1)  # (6)
psi = Psi - 1.5 * a2 * (1 - a2) * q**2 * chi  # (7)
C_U = 1 / (1 + 0.5 * D_x * psi * D_b / arc)  # (4)
C_Omega = (1 + 0.5 * D_x * Psi * D_b / arc) * C_U  # (5)
U = lam * C_U * (1 - a2) * q * chi * omega / (2 * math.pi)  # (1)
Omega = 4 * math.pi * mu * b**2 * omega * chi * C_Omega * arc / E_x  # (2), a magnitude

print(f"U:     {U:.9g} m/s by (1), {answer.forward_velocity:.9g} m/s by the balance")
print(f"Omega: {Omega:.9g} rad/s by (2), {answer.body_rotation_rate:.9g} rad/s by the balance")
assert math.isclose(answer.forward_velocity, U, rel_tol=1e-12)
assert math.isclose(answer.body_rotation_rate, -Omega, rel_tol=1e-12)
