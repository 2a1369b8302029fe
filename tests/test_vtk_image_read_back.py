"""A VTK image file holds the box that it was written from; read here from its bytes, as the format describes them."""

import json
import re
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import xarray as xr

import spirillum as sp
from spirillum.fields.flow import Flow
from spirillum.formats.array_files import write_vti

_TYPES = {"Float64": np.float64, "UInt8": np.uint8}


class Image(NamedTuple):
    """What a reader finds in a file."""

    comment: dict[str, Any]
    extent: list[int]
    origin: list[float]
    spacing: list[float]
    arrays: dict[str, np.ndarray]


def read(path: Path) -> Image:
    """Read an image file with appended raw data; arrays are (points, components), x fastest."""
    head, data = path.read_bytes().split(b'<AppendedData encoding="raw">', 1)
    data = data[data.index(b"_") + 1 :]
    comment = re.search(rb"<!-- (.*?) -->", head)
    assert comment is not None
    root = ET.fromstring(head + b"</VTKFile>")
    assert root.attrib["byte_order"] == "LittleEndian"
    assert root.attrib["header_type"] == "UInt64"
    image = root[0]
    arrays = {}
    for item in image.iter("DataArray"):
        start = int(item.attrib["offset"])
        size = int(np.frombuffer(data, np.uint64, 1, start)[0])
        kind = _TYPES[item.attrib["type"]]
        values = np.frombuffer(data, kind, size // np.dtype(kind).itemsize, start + 8)
        arrays[item.attrib["Name"]] = values.reshape(-1, int(item.attrib["NumberOfComponents"]))

    def numbers(name: str) -> list[float]:
        return [float(word) for word in image.attrib[name].split()]

    extent = [int(number) for number in numbers("WholeExtent")]
    return Image(json.loads(comment[1]), extent, numbers("Origin"), numbers("Spacing"), arrays)


@pytest.fixture(scope="module")
def box(sphere: Any) -> xr.Dataset:
    """The flow around a sphere in a box with a different number of points along x than across."""
    flow = Flow(sp.predict("biorob2012-wide", tail_rate="1.2 Hz", model="sbt"), sphere, 0.5, "lab")
    return flow.volume(resolution=21)


def test_arrays_stand_at_their_points(box: xr.Dataset, tmp_path: Path) -> None:
    write_vti(box, tmp_path / "flow.vti")
    found = read(tmp_path / "flow.vti")
    shape = [found.extent[2 * axis + 1] - found.extent[2 * axis] + 1 for axis in range(3)]
    assert shape == [box.sizes[axis] for axis in "xyz"]
    assert shape[0] != shape[1]
    for number, axis in enumerate("xyz"):
        places = found.origin[number] + found.spacing[number] * np.arange(shape[number])
        np.testing.assert_allclose(places, box[axis], rtol=0, atol=1e-15)
        stored = found.arrays["velocity"][:, number].reshape(shape, order="F")
        np.testing.assert_array_equal(stored, box[f"velocity_{axis}"].transpose("x", "y", "z"))
    for name in ("pressure", "inside"):
        np.testing.assert_array_equal(found.arrays[name][:, 0].reshape(shape, order="F"), box[name])
    np.testing.assert_array_equal(np.isnan(found.arrays["pressure"]), found.arrays["inside"] == 1)


def test_order_of_dimensions_does_not_matter(box: xr.Dataset, tmp_path: Path) -> None:
    write_vti(box, tmp_path / "a.vti")
    write_vti(box.transpose("z", "x", "y"), tmp_path / "b.vti")
    assert (tmp_path / "a.vti").read_bytes() == (tmp_path / "b.vti").read_bytes()


def test_settings_stand_in_a_comment_whatever_they_hold(box: xr.Dataset, tmp_path: Path) -> None:
    strange = box.assign_attrs(title="a -- b --- c ---> <x>", robot="µ & ü")
    write_vti(strange, tmp_path / "flow.vti")
    comment = read(tmp_path / "flow.vti").comment
    assert comment["title"] == "a -- b --- c ---> <x>"
    assert comment["robot"] == "µ & ü"
    assert comment["phase"] == 0.5
    assert json.loads(comment["settings"])["body"]["diameter"] == 0.018


def test_written_whole_or_not_at_all(box: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from pyevtk import hl

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    (tmp_path / "flow.vti").write_text("earlier, written by spirillum")
    monkeypatch.setattr(hl, "imageToVTK", full)
    with pytest.raises(OSError, match="No space"):
        write_vti(box, tmp_path / "flow.vti")
    assert [path.name for path in tmp_path.iterdir()] == ["flow.vti"]
    assert (tmp_path / "flow.vti").read_text() == "earlier, written by spirillum"
