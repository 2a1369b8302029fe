"""A robot without weight and walls moves on a screw; on the floor of its tube it swims nearly as one that is held.

`predict` finds both steady motions, `simulate` comes to them in time.
"""

import numpy as np

import spirillum as sp

robot = sp.load("biorob2012-wide", **{"friction.effective": "1.1e-5 N m s/rad"})
held = sp.predict(robot, model="rft")
free = sp.predict(robot, model="rft", motion="free")

afloat = sp.simulate(robot, model="rft", weight=False, placement={"eccentricity": 0.0}, timing={"turns": 20.0})
lying = sp.simulate(robot, model="rft", timing={"turns": 20.0})
mean = {name: 1e3 * float(run["mean_forward_velocity"]) for name, run in (("afloat", afloat), ("lying", lying))}
print(f"held {1e3 * held.forward_velocity:.4f}, lying {mean['lying']:.4f}, free {1e3 * free.forward_velocity:.4f} mm/s")

# Afloat, the axis of the screw hardly leaves that of the channel.
assert np.isclose(mean["afloat"], 1e3 * free.forward_velocity, rtol=1e-3)
assert free.forward_velocity < 1e-3 * mean["lying"] < held.forward_velocity
print(f"the axis circles at {np.degrees(free.wobble_angle):.2f} deg on a helix of {1e6 * free.path_radius:.0f} um")

spent = lying["friction_energy"] + lying["dissipated_energy"]
fallen = lying["potential_energy"][0] - lying["potential_energy"]
assert np.allclose(lying["drive_energy"] + fallen, spent, rtol=1e-6, atol=1e-9)
