"""A one-piece magnetic swimmer in two tubes: closed and open ends, flow with it and against it.

A filleted cylindrical head with a helical tail, turned from outside (`drive.joint = "fixed"`). The geometry is made
up, of the size of millimetre swimmers that rotating fields drive. Nothing couples head and tail but rigidity, so the
coupling has no diameter; its length is the gap in which the wire's neck is left out, a little more than the wire's
radius. Lateral motion and tilt are held, coaxially or 0.1 mm above the wall.
"""

import math

import spirillum as sp

SWIMMER = {
    "name": "one-piece-swimmer",
    "description": "made up: filleted cylindrical head with a helical tail",
    "body": {
        "shape": "cylinder",
        "diameter": "0.8 mm",
        "length": "1.6 mm",
        "front": "fillet",
        "rear": "fillet",
        "fillet": "0.15 mm",
    },
    "coupling": {"diameter": "0 mm", "length": "0.1 mm", "clearance": "0 mm"},
    "tail": {"wavelength": "1.5 mm", "amplitude": "0.3 mm", "length": "4.5 mm", "wire_diameter": "0.15 mm"},
    "fluid": {"viscosity": "1 Pa s", "density": "1260 kg/m^3"},
    "drive": {"kind": "rate", "joint": "fixed", "rate": "10 Hz"},
}
PLACES = {"coaxial": {"eccentricity": 0.0}, "lying": {"gap": "0.1 mm", "pitch": "0 deg"}}
FLOW = 0.5e-3  # m/s


def swims(diameter: str, place: str, tolerance: float = 0.02, **ends: str | float) -> sp.Prediction:
    """The swimmer in a tube 40 mm long."""
    robot = {**SWIMMER, "channel": {"diameter": diameter, "length": "40 mm"}}
    return sp.predict(robot, model="tube", placement={**PLACES[place], **ends}, resolution={"tolerance": tolerance})


print("tube     place     closed    open   with flow  against (mm/s)   torque (N m)   error")
for diameter in ("1.2 mm", "3 mm"):
    for place in PLACES:
        closed, opened = (swims(diameter, place, ends=ends) for ends in ("closed", "open"))
        along, against = (swims(diameter, place, flow=flow) for flow in (FLOW, -FLOW))
        speeds = [1e3 * answer.forward_velocity for answer in (closed, opened, along, against)]
        row = "  ".join(f"{speed:7.4f}" for speed in speeds)
        print(f"{diameter:8} {place:8} {row}         {closed.drive_torque:.4g}      {closed.error_estimate:.1%}")
        # The flow carries the swimmer by the same amount both ways, and by less than the fluid's fastest, 2 U_m.
        carried = along.forward_velocity - closed.forward_velocity
        assert math.isclose(carried, closed.forward_velocity - against.forward_velocity, rel_tol=1e-9)
        assert 0 < carried < 2 * FLOW
        assert closed.body_rotation_rate == closed.tail_rotation_rate
        assert closed.plug_velocity == 0.0

# The torque that this rate takes drives the swimmer alike.
rated = swims("1.2 mm", "lying")
driven = {**SWIMMER, "drive": {"kind": "torque", "joint": "fixed", "torque": f"{rated.drive_torque!r} N m"}}
driven["channel"] = {"diameter": "1.2 mm", "length": "40 mm"}
turned = sp.predict(driven, model="tube", placement=PLACES["lying"], resolution={"tolerance": 0.02})
assert math.isclose(turned.forward_velocity, rated.forward_velocity, rel_tol=1e-9)
assert math.isclose(turned.tail_rotation_rate, rated.tail_rotation_rate, rel_tol=1e-9)

# Finer tolerances change the answer by less than the coarser ones promise.
tolerances = (0.05, 0.02, 0.005)
converging = [swims("1.2 mm", "lying", tolerance, ends="closed").forward_velocity for tolerance in tolerances]
for tolerance, speed in zip(tolerances, converging, strict=True):
    print(f"tolerance {tolerance:5}: {1e3 * speed:.5f} mm/s, {speed / converging[-1] - 1:+.2%} from the finest")
    assert abs(speed / converging[-1] - 1) < tolerance

# A tube fifty times as wide as the swimmer's head is nearly none.
wide = swims("40 mm", "coaxial", ends="closed")
unbounded = sp.predict({**SWIMMER, "channel": "none"}, model="slender", calibrated=False)
print(
    f"in a tube of 40 mm {1e3 * wide.forward_velocity:.4f} mm/s, unbounded {1e3 * unbounded.forward_velocity:.4f} mm/s"
)
assert math.isclose(wide.forward_velocity, unbounded.forward_velocity, rel_tol=0.01)
assert math.isclose(wide.drive_torque, unbounded.drive_torque, rel_tol=0.01)
