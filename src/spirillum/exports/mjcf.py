"""The robot as a MuJoCo model (MJCF): two bodies, a motor, no fluid of MuJoCo's own."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree as ET

import numpy as np

from spirillum.errors import InputError
from spirillum.exports.parts import MESH_SCALE, MeshFile
from spirillum.exports.sidecar import joint_friction
from spirillum.exports.urdf import numbers
from spirillum.notes import Note
from spirillum.robot.links import Link, links_of
from spirillum.robot.robot import STANDARD_GRAVITY, Robot

FLUID_WARNING = Note(
    "physics-engine-fluid",
    "MuJoCo's own fluid gives a helix no thrust and must stay off; apply the forces of the resistance matrix at "
    "each step",
)
_LEAST = 1e-15
"""MuJoCo takes no smaller mass or moment of inertia, in its own unit-free numbers."""
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
    """The model; lengths in m, the origin of both bodies on the motor axis at the robot body's mid-length.

    Args:
        robot: a checked robot whose masses are known.
        meshes: the mesh files.
        folder: where they lie, relative to the model.
        phase: phase of the tail at joint angle zero, rad.
    """
    files = list(meshes)
    check_triangles(files)
    root = ET.Element("mujoco", model=robot.name)
    root.append(
        ET.Comment(
            "\n  WARNING: keep density and viscosity at 0. MuJoCo's own fluid gives a helix no thrust.\n"
            "  The fluid's forces come from the resistance matrix in the JSON file beside this model; a program has\n"
            "  to apply them, and buoyancy, at every step. Without it the robot falls as in a vacuum.\n"
            "  Lengths in m, x forward, z up.\n  "
        )
    )
    ET.SubElement(root, "compiler", angle="radian", meshdir=folder, autolimits="true")
    ET.SubElement(
        root,
        "option",
        timestep=numbers([_STEP]),
        integrator="implicitfast",
        gravity=numbers([0.0, 0.0, -STANDARD_GRAVITY]),
        density="0",
        viscosity="0",
    )
    asset = ET.SubElement(root, "asset")
    for item in files:
        # A surface to look at need not be closed: `shell` lets it be one.
        mesh = {"name": item.name, "file": f"{item.name}.stl", "scale": numbers([MESH_SCALE] * 3), "inertia": "shell"}
        ET.SubElement(asset, "mesh", mesh)
    world = ET.SubElement(root, "worldbody")
    ET.SubElement(world, "light", pos="0 0 1", dir="0 0 -1", directional="true")
    links = links_of(robot)
    body = _body(world, "body", links.body, files)
    body.insert(0, ET.Element("freejoint", name="body"))
    rotor = _body(body, "rotor", links.rotor, files)
    rotor.set("euler", numbers([phase, 0.0, 0.0]))
    if robot.drive is None or robot.drive.joint == "revolute":
        hinge = ET.Element(
            "joint", name="motor", type="hinge", axis="1 0 0", pos="0 0 0", damping=numbers([joint_friction(robot)])
        )
        rotor.insert(0, hinge)
        actuator = ET.SubElement(root, "actuator")
        actuator.append(ET.Comment(" Control: torque in the joint before friction, N m. "))
        ET.SubElement(actuator, "motor", name="motor", joint="motor")
    ET.indent(root)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _body(parent: ET.Element, name: str, link: Link, files: list[MeshFile]) -> ET.Element:
    element = ET.SubElement(parent, "body", name=name)
    order = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
    inertia = numbers(link.inertia[at] for at in order)
    ET.SubElement(element, "inertial", pos=numbers(link.centre), mass=numbers([link.mass]), fullinertia=inertia)
    for item in (item for item in files if item.part == name):
        geom = {"name": item.name, "type": "mesh", "mesh": item.name}
        if item.colour is None:
            geom |= {"group": "3"}  # closed bodies collide and are hidden by default
        else:
            rgba = numbers([*np.round(item.colour, 4), 1.0])
            geom |= {"group": "1", "contype": "0", "conaffinity": "0", "rgba": rgba}
        ET.SubElement(element, "geom", geom)
    return element
