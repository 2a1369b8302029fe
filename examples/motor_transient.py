"""The motor's transient settles on the steady state, and its energy balance closes.

`simulate` integrates eq. (17) in time; `predict` finds its steady root. Both rest on the same force balance, so
that the end of a long run has to equal the prediction.
"""

import numpy as np

import spirillum as sp

steady = sp.predict("biorob2012-wide", model="sbt")
run = sp.simulate("biorob2012-wide", motion="held", model="sbt", timing={"duration": "2 s"})
end = run.isel(time=-1)

for name in ("forward_velocity", "tail_rotation_rate", "body_rotation_rate", "motor_current"):
    print(f"{name}: {float(end[name]):.9g} at the end of the run, {getattr(steady, name):.9g} in the steady state")
    assert np.isclose(float(end[name]), getattr(steady, name), rtol=1e-7)
mean = float(run["mean_forward_velocity"])  # over the last two thirds, as in the paper
assert np.isclose(mean, steady.forward_velocity, rtol=1e-7)

parts = ("resistive", "magnetic", "conversion", "friction", "dissipated")
spent = sum(run[f"{part}_energy"] for part in parts)
assert np.allclose(spent, run["electrical_energy"], rtol=1e-6, atol=1e-9)
shares = ", ".join(f"{part} {100 * float(end[f'{part}_energy'] / end['electrical_energy']):.2g} %" for part in parts)
print(f"{float(end['electrical_energy']):.3g} J went into: {shares}")
