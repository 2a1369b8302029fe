"""The robot's surface as a VTK file of polygons (.vtp), which ParaView and VisIt read."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.files import scratch_folder
from spirillum.formats.vtk_image import add_comment
from spirillum.robot.mesh import RobotMesh


def vtp_bytes(pieces: Sequence[RobotMesh], attributes: Mapping[str, Any]) -> bytes:
    """All pieces as one surface; lengths in m.

    Cell arrays: `part` (0 body, 1 rotor), `piece` and `region` (numbers, named in the comment at the head of the
    file), `colour` (sRGB, 0 to 255).
    """
    offset = np.cumsum([0, *(len(piece.vertices) for piece in pieces)])
    points = np.concatenate([piece.vertices for piece in pieces])
    faces = np.concatenate([piece.faces + start for piece, start in zip(pieces, offset[:-1], strict=True)])
    colours = np.round(255.0 * np.concatenate([piece.colours for piece in pieces])).astype(np.uint8)
    names = list(dict.fromkeys(name for piece in pieces for name in piece.regions))
    number = [np.array([names.index(name) for name in piece.regions])[piece.region] for piece in pieces]
    size = [len(piece.faces) for piece in pieces]
    cells: dict[str, Any] = {
        "part": np.repeat([0 if piece.part == "body" else 1 for piece in pieces], size).astype(np.uint8),
        "piece": np.repeat(np.arange(len(pieces)), size).astype(np.uint8),
        "region": np.concatenate(number).astype(np.uint8),
        "colour": tuple(np.ascontiguousarray(colours[:, channel]) for channel in range(3)),
    }
    place = tuple(np.ascontiguousarray(points[:, axis]) for axis in range(3))
    corners = np.ascontiguousarray(faces.ravel().astype(np.int32))
    ends = np.arange(3, corners.size + 1, 3, dtype=np.int32)
    words = {"unit": "m", "part": ["body", "rotor"], "piece": [piece.name for piece in pieces], "region": names}
    with scratch_folder() as folder:
        path = folder / "robot.vtp"
        _write(path, place, corners, ends, cells)
        add_comment(path, json.dumps({**words, **attributes}, sort_keys=True))
        return path.read_bytes()


def _write(
    path: Path, place: tuple[Samples, ...], corners: np.ndarray, ends: np.ndarray, cells: Mapping[str, Any]
) -> None:
    """The file as the library writes it: first what is where, then the data in the same order."""
    from pyevtk.vtk import VtkFile, VtkPolyData

    file = VtkFile(str(path.with_suffix("")), VtkPolyData)  # the library adds the suffix
    file.openGrid()
    file.openPiece(npoints=place[0].size, npolys=ends.size)
    file.openElement("Points")
    file.addData("points", place)
    file.closeElement("Points")
    file.openElement("Polys")
    file.addData("connectivity", corners)
    file.addData("offsets", ends)
    file.closeElement("Polys")
    file.openData("Cell")
    for name, values in cells.items():
        file.addData(name, values)
    file.closeData("Cell")
    file.closePiece()
    file.closeGrid()
    for values in (place, corners, ends, *cells.values()):
        file.appendData(values)
    file.save()
