"""Robot descriptions for simulators: URDF, MuJoCo's MJCF, and a sidecar with masses and resistance."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from spirillum.envelope import envelope, quantity
from spirillum.errors import InputError
from spirillum.exports.meshes import MESH_SCALE, MeshFile
from spirillum.fluid.registry import SWIMMER_MODELS, find_swimmer_model
from spirillum.formats.templates import numbers, rendered
from spirillum.notes import Note
from spirillum.robot.batch import RobotBatch
from spirillum.robot.limits import broken
from spirillum.robot.links import Link, links_of
from spirillum.robot.robot import STANDARD_GRAVITY, Robot

FULL_MODELS = tuple(name for name, model in SWIMMER_MODELS.items() if not (model.axial_only or model.placed))
"""Models that give the whole 12x12 matrix in unbounded fluid, for any motion of the robot."""

_UNITS = [["N s/m", "N s"], ["N s", "N m s"]]
_CONVENTION = (
    "(F_body, T_body, F_rotor, T_rotor) = -R (U_body, Omega_body, U_rotor, Omega_rotor): force and torque of the fluid "
    "on each link against velocity and rotation of each link; torques and velocities at the origin, which is the "
    "body's mid-length on the motor axis; all in the axes of the body (x forward, z up) with the tail at phase 0; "
    "R is symmetric and positive definite, and units repeat in blocks of 3x3"
)
_TURNING = (
    "at joint angle q, positive about +x, the tail's phase is q + joint.phase_at_zero, and R is Q R Q' with Q four "
    "blocks of the rotation about x by that phase; the same without turning R: express all velocities in the axes of "
    "the rotor, and the wrenches come out in them. R does not change with place or attitude"
)


def sidecar_of(robot: Robot, model: str, phase: float) -> dict[str, Any]:
    """Masses, joint, buoyancy and 12x12 resistance of a robot, SI; the joint angle is zero at the tail's `phase`."""
    chosen = find_swimmer_model(model)
    if model not in FULL_MODELS:
        raise InputError(
            f"model = {model!r} does not give the whole resistance in unbounded fluid; allowed: "
            f"{', '.join(FULL_MODELS)}"
        )
    batch = RobotBatch.of(robot)
    outside = broken(chosen.domain(batch))
    if outside:
        raise InputError(f"{robot.name} with model '{model}': {outside[0].sentence()}")
    warnings = [limit.caution() for limit in broken(chosen.cautions(batch))]
    if robot.coupling.length > 0 and "coupling" not in chosen.parts:
        warnings.append(Note.named("links-without-coupling", model=model, models=", ".join(FULL_MODELS)))
    links = links_of(robot)
    content = {
        "robot": robot.name,
        "model": model,
        "known_error": chosen.stated_error(robot.model),
        "references": list(chosen.references),
        "viscosity": quantity(robot.fluid.viscosity, "Pa s"),
        "density": quantity(robot.fluid.density, "kg/m^3"),
        "gravity": quantity([0.0, 0.0, -STANDARD_GRAVITY], "m/s^2"),
        "joint": {
            "type": "fixed" if robot.drive is not None and robot.drive.joint == "fixed" else "revolute",
            "origin": quantity([0.0, 0.0, 0.0], "m"),
            "axis": [1.0, 0.0, 0.0],
            "phase_at_zero": quantity(phase, "rad"),
            "friction": quantity(joint_friction(robot), "N m s/rad"),
        },
        "links": {"body": _link_masses(links.body), "rotor": _link_masses(links.rotor)},
        "matrix": {**quantity(chosen.resistance(batch, np.zeros(1))[0], ""), "unit": _UNITS},
        "convention": _CONVENTION,
        "turning": _TURNING,
    }
    return envelope("links", content, warnings)


def joint_friction(robot: Robot) -> float:
    """Friction inside the joint, N m s/rad; what acts on body or rotor from outside is not in it."""
    own = robot.motor.joint_rotor_friction if robot.motor is not None else 0.0
    if robot.friction.reading == "rotor":
        return own if robot.friction.effective is None else robot.friction.effective
    return own if robot.friction.reading == "body" else 0.0


def _link_masses(link: Link) -> dict[str, Any]:
    """Inertia of one link, at phase 0 of the tail; null for an unknown mass."""
    return {
        "mass": quantity(link.mass, "kg"),
        "centre_of_mass": quantity(link.centre, "m"),
        "inertia": quantity(link.inertia, "kg m^2", about="centre_of_mass"),
        "displaced_volume": quantity(link.volume, "m^3"),
        "centre_of_buoyancy": quantity(link.centroid, "m"),
    }


_PLACES = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
_FULL_INERTIA = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


_FILTERS: dict[str, Callable[..., str]] = {
    "rgba": lambda colour: numbers([*np.asarray(colour).round(4), 1.0]),
    "inertia": lambda link: numbers(link.inertia[_PLACES[name]] for name in _FULL_INERTIA),
}


def urdf_text(robot: Robot, meshes: Iterable[MeshFile], folder: str, phase: float) -> str:
    """The description; lengths in m, the origin of both links on the motor axis at the body's mid-length."""
    return rendered(
        "exports/robot.urdf.jinja",
        filters=_FILTERS,
        robot=robot,
        links=list(zip(("body", "rotor"), links_of(robot), strict=True)),
        meshes=list(meshes),
        folder=folder,
        places=_PLACES,
        scale=numbers([MESH_SCALE] * 3),
        fixed=robot.drive is not None and robot.drive.joint == "fixed",
        phase=phase,
        friction=joint_friction(robot),
    )


_LEAST = 1e-15  # MuJoCo takes no smaller mass or moment of inertia, in its own unit-free numbers
_MOST_TRIANGLES = 200_000
_STEP = 1e-4


def check_inertia(robot: Robot) -> None:
    """Both links are heavy enough for MuJoCo."""
    for name, link in zip(("body", "rotor"), links_of(robot), strict=True):
        least = min(link.mass, float(np.min(np.linalg.eigvalsh(link.inertia))))
        if not least > _LEAST:
            raise InputError(
                f"{robot.name}: {name} has a mass of {link.mass:.3g} kg and a moment of inertia of "
                f"{np.min(np.linalg.eigvalsh(link.inertia)):.3g} kg m^2; allowed: more than {_LEAST:g} in both, the "
                "least that MuJoCo takes; .urdf has no such bound"
            )


def check_triangles(meshes: Iterable[MeshFile]) -> None:
    """No mesh has more triangles than MuJoCo reads."""
    most = max(meshes, key=lambda item: item.triangles)
    if most.triangles > _MOST_TRIANGLES:
        raise InputError(
            f"{most.name}.stl would have {most.triangles} triangles; allowed: at most {_MOST_TRIANGLES}, which is all "
            "that MuJoCo reads (a smaller fineness)"
        )


def mjcf_text(robot: Robot, meshes: Iterable[MeshFile], folder: str, phase: float) -> str:
    """The model; lengths in m, the origin of both bodies on the motor axis at the robot body's mid-length."""
    files = list(meshes)
    check_triangles(files)
    return rendered(
        "exports/robot.mjcf.jinja",
        filters=_FILTERS,
        robot=robot,
        links=links_of(robot),
        meshes=files,
        folder=folder,
        scale=numbers([MESH_SCALE] * 3),
        step=_STEP,
        gravity=STANDARD_GRAVITY,
        turns=robot.drive is None or robot.drive.joint == "revolute",
        phase=phase,
        friction=joint_friction(robot),
    )
