"""The resistance matrix of a plain helix: quadrature along the wire against the closed form.

Without the taper at its root every piece of the tail looks alike, and the axial entries of eq. (12) are
    B11 = l [c_n + (c_t - c_n) alpha^2],  B14 = h l b (c_t - c_n) alpha beta,  B44 = l b^2 [c_n + (c_t - c_n) beta^2]
with arc length l = L_t/alpha, b = B_o, beta^2 = 1 - alpha^2 and the coefficients of (13) and (14).
"""

import math

import spirillum as sp

robot = sp.load("biorob2012-wide", **{"tail.taper": "none"})
matrix = sp.resistance(robot, part="tail", model="rft").matrix

mu, tail = robot.fluid.viscosity, robot.tail
log = math.log(tail.wavelength / tail.wire_diameter)
c_t, c_n = 2 * math.pi * mu / (log - 0.5), 4 * math.pi * mu / (log + 0.5)  # (13), (14) as printed

b = tail.amplitude
alpha = 1 / math.hypot(1, 2 * math.pi * b / tail.wavelength)
beta = math.sqrt(1 - alpha**2)
arc = tail.length / alpha

expected = {
    "B11": (matrix[0, 0], arc * (c_n + (c_t - c_n) * alpha**2), "N s/m"),
    "B14": (matrix[0, 3], arc * b * (c_t - c_n) * alpha * beta, "N s"),
    "B44": (matrix[3, 3], arc * b**2 * (c_n + (c_t - c_n) * beta**2), "N m s"),
}
for name, (computed, closed_form, unit) in expected.items():
    print(f"{name}: {computed:.9g} {unit}, closed form {closed_form:.9g} {unit}")
    assert math.isclose(computed, closed_form, rel_tol=1e-10)
