"""Step-out of a one-piece swimmer: the closed form of a held robot, and a free one in time.

Its moment lags behind the field until m B no longer suffices; beyond, it slips.
"""

import numpy as np

import spirillum as sp

held = sp.predict("magnetic-helix")
step_out = held.step_out_rate / (2 * np.pi)
print(f"step-out at {step_out:.3f} Hz, lag {np.degrees(held.phase_lag):.1f} deg at 1 Hz")
assert np.isclose(np.sin(held.phase_lag), 1.0 / step_out)

sweep = sp.magnetic_sweep("magnetic-helix", [f"{share * step_out} Hz" for share in (0.5, 0.9, 1.2)], turns=40.0)
for rate, speed, lag in zip(sweep["field_rate"], sweep["forward_velocity"], sweep["phase_lag"], strict=True):
    follows = f"lag {float(np.degrees(lag)):.0f} deg" if np.isfinite(lag) else "slips"
    print(f"{float(rate) / (2 * np.pi):.2f} Hz: {1e3 * float(speed):.3f} mm/s, {follows}")
assert np.isfinite(sweep["phase_lag"].values).tolist() == [True, True, False]
assert np.isclose(sweep["phase_lag"][0], np.pi / 6, rtol=0.02)
