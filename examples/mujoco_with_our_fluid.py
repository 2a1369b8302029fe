"""The paper's robot in MuJoCo, moved by our resistance matrix in place of MuJoCo's own fluid.

MuJoCo's fluid takes every body for an ellipsoid, and an ellipsoid that spins about its axis has no thrust. So its fluid
stays off, and the program below applies at every step what the fluid does: F = -R V on both links, with the 12x12 that
`spirillum export` writes beside the model, and buoyancy.

Viscosity beats inertia within a millisecond about the motor axis and within some 15 ms along it, so explicit forces
need steps well below a millisecond; the model's own step is 0.1 ms. A floor carries the weight and keeps the robot
straight in `spirillum.predict`; here a very large damping across the axis does, which MuJoCo treats implicitly.

Truth: driven by a constant torque in the joint, without the weight that swings the tail, the robot settles at the speed
per radian, the rates and the torque that the force balance of `spirillum.predict` gives for the same matrix. With
weight and the motor off, the damping carries weight less buoyancy.
"""

import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import spirillum as sp

ROBOT = sp.load("biorob2012-wide")
TORQUE = 4e-5  # in the joint, before its friction, N m
HELD = 1e4  # damping across the axis, N s/m and N m s
LINKS = ((0, "body"), (6, "rotor"))  # place in the 12x12, and name


def apply_fluid(model: Any, data: Any, beside: Any) -> None:
    """Replace the applied forces by those of the fluid at the present velocities."""
    import mujoco

    gravity = model.opt.gravity
    body_axes, rotor_axes = (data.body(name).xmat.reshape(3, 3) for _, name in LINKS)
    twist, local = np.zeros(12), np.zeros(6)
    for first, name in LINKS:  # in the axes of the rotor, where R is the same at every angle of the joint
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, data.body(name).id, local, 1)
        turn = np.eye(3) if name == "rotor" else rotor_axes.T @ body_axes
        twist[first : first + 3], twist[first + 3 : first + 6] = turn @ local[3:], turn @ local[:3]
    wrench = -np.array(beside["matrix"]["value"]) @ twist
    data.qfrc_applied[:] = 0.0
    for first, name in LINKS:
        link, body = beside["links"][name], data.body(name)
        force, torque = rotor_axes @ wrench[first : first + 3], rotor_axes @ wrench[first + 3 : first + 6]
        mujoco.mj_applyFT(model, data, force, torque, body.xpos, body.id, data.qfrc_applied)
        lift = -beside["density"]["value"] * link["displaced_volume"]["value"] * gravity
        centre = body.xpos + body.xmat.reshape(3, 3) @ np.array(link["centre_of_buoyancy"]["value"])
        mujoco.mj_applyFT(model, data, lift, np.zeros(3), centre, body.id, data.qfrc_applied)


def run(folder: Path, torque: float, duration: float, *, weight: bool) -> np.ndarray:
    """Velocities at the end: of the body along x, y, z, its rates about them, and the joint's rate; SI."""
    import mujoco

    beside = json.loads((folder / "robot.resistance.json").read_text())
    model = mujoco.MjModel.from_xml_path(str(folder / "robot.mjcf"))
    assert model.opt.density == 0
    assert model.opt.viscosity == 0
    model.dof_damping[[1, 2, 4, 5]] = HELD
    if not weight:
        model.opt.gravity[:] = 0.0
    data = mujoco.MjData(model)
    data.ctrl[0] = torque
    for _ in range(round(duration / model.opt.timestep)):
        mujoco.mj_forward(model, data)
        apply_fluid(model, data, beside)
        mujoco.mj_step(model, data)
    return np.array(data.qvel)


def main() -> None:
    """Run the model and compare it with the force balance."""
    try:
        import mujoco  # noqa: F401 - asked for before anything is written
    except ImportError:
        print("MuJoCo is not installed: pip install mujoco")
        return
    with tempfile.TemporaryDirectory() as name:
        sp.export(ROBOT, Path(name) / "robot.mjcf")
        speed, body, joint = run(Path(name), TORQUE, 0.25, weight=False)[[0, 3, 6]]
        sinking = run(Path(name), 0.0, 1e-3, weight=True)[2]
    tail = body + joint
    wanted = sp.predict(ROBOT, model="slender", tail_rate=tail)
    print(f"advance per radian: {1e6 * speed / tail:.4f} um, by the balance {1e6 * wanted.advance_per_radian:.4f} um")
    print(f"body against tail:  {body / tail:.6f}, by the balance {wanted.body_rotation_rate / tail:.6f}")
    # After 0.25 s, seventeen times the slowest decay, nothing is left of the start.
    assert abs(speed / tail / wanted.advance_per_radian - 1) < 1e-6
    assert abs(body / wanted.body_rotation_rate - 1) < 1e-6
    assert abs(wanted.drive_torque + ROBOT.motor.rotor_friction * joint - TORQUE) < 1e-6 * TORQUE
    held = -HELD * sinking
    weight = ROBOT.derived()["submerged_weight"].value
    print(f"weight less buoyancy: {1e3 * held:.3f} mN, from the volumes {1e3 * weight:.3f} mN")
    assert abs(held / weight - 1) < 1e-3


if __name__ == "__main__":
    main()
