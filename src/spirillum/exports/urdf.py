"""The robot as a robot description (URDF): two links and their joint, with mesh files beside it."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree as ET

import numpy as np

from spirillum.exports.parts import MESH_SCALE, MeshFile
from spirillum.exports.sidecar import joint_friction
from spirillum.robot.links import Link, links_of
from spirillum.robot.robot import Robot


def urdf_text(robot: Robot, meshes: Iterable[MeshFile], folder: str, phase: float) -> str:
    """The description; lengths in m, the origin of both links on the motor axis at the body's mid-length.

    Args:
        robot: a checked robot whose masses are known.
        meshes: the mesh files.
        folder: where they lie, relative to the description.
        phase: phase of the tail at joint angle zero, rad.
    """
    root = ET.Element("robot", name=robot.name)
    root.append(
        ET.Comment(
            " Lengths in m, x forward, z up. A URDF holds no fluid: forces come from the resistance matrix beside it. "
        )
    )
    files = list(meshes)
    for name, link in zip(("body", "rotor"), links_of(robot), strict=True):
        own = [item for item in files if item.part == name]
        root.append(_link(name, link, own, folder))
    fixed = robot.drive is not None and robot.drive.joint == "fixed"
    joint = ET.SubElement(root, "joint", name="motor", type="fixed" if fixed else "continuous")
    ET.SubElement(joint, "parent", link="body")
    ET.SubElement(joint, "child", link="rotor")
    ET.SubElement(joint, "origin", xyz="0 0 0", rpy=numbers((phase, 0.0, 0.0)))
    if not fixed:
        ET.SubElement(joint, "axis", xyz="1 0 0")
        ET.SubElement(joint, "dynamics", damping=numbers([joint_friction(robot)]), friction="0")
    ET.indent(root)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _link(name: str, link: Link, meshes: Iterable[MeshFile], folder: str) -> ET.Element:
    element = ET.Element("link", name=name)
    inertial = ET.SubElement(element, "inertial")
    ET.SubElement(inertial, "origin", xyz=numbers(link.centre), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=numbers([link.mass]))
    places = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
    ET.SubElement(inertial, "inertia", {key: numbers([link.inertia[at]]) for key, at in places.items()})
    for item in meshes:
        shown = ET.SubElement(element, "collision" if item.colour is None else "visual", name=item.name)
        ET.SubElement(shown, "origin", xyz="0 0 0", rpy="0 0 0")
        geometry = ET.SubElement(shown, "geometry")
        ET.SubElement(geometry, "mesh", filename=f"{folder}/{item.name}.stl", scale=numbers([MESH_SCALE] * 3))
        if item.colour is not None:
            material = ET.SubElement(shown, "material", name=f"{name} {item.name}")
            ET.SubElement(material, "color", rgba=numbers([*np.round(item.colour, 4), 1.0]))
    return element


def numbers(values: Iterable[float]) -> str:
    """Numbers as XML has them, to the last digit."""
    return " ".join(repr(float(value)) for value in values)
