"""Grids hold the field that they are made of: the exact flow around a sphere keeps mass and momentum on them."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import xarray as xr

import spirillum as sp
from spirillum.fields import grid as flow_grid
from spirillum.fields.flow import Flow

COMPONENTS = ("velocity_x", "velocity_y", "velocity_z")


@pytest.fixture(scope="module")
def around(sphere: Any) -> Flow:
    """The sphere's flow under the name of a robot: the grids follow the robot, the field the sphere."""
    prediction = sp.predict("biorob2012-wide", tail_rate="1.2 Hz", model="sbt")
    return Flow(prediction, sphere, 0.0, "lab")


def _vectors(dataset: xr.Dataset) -> np.ndarray:
    return np.stack([dataset[name].values for name in COMPONENTS])


def _far_from(sphere: Any, dataset: xr.Dataset, distance: float) -> np.ndarray:
    """Points outside a larger sphere, the grid's outermost two layers left out."""
    x, y, z = (dataset[axis].values for axis in "xyz")
    r = np.sqrt(x[:, None, None] ** 2 + y[None, :, None] ** 2 + z[None, None, :] ** 2)
    found = r > distance
    for axis in range(3):
        edge = np.ones(found.shape[axis], dtype=bool)
        edge[2:-2] = False
        found &= ~edge.reshape([-1 if number == axis else 1 for number in range(3)])
    return found


def _errors(around: Flow, sphere: Any, resolution: int) -> tuple[float, float]:
    """Largest divergence and largest residual of mu lap u = grad p by central differences, with their own scales."""
    dataset = around.volume(extent="20 mm", resolution=resolution)
    step = float(dataset["x"][1] - dataset["x"][0])
    u, p = _vectors(dataset), dataset["pressure"].values
    near = _far_from(sphere, dataset, 1.8 * sphere.radius)
    divergence = sum(np.gradient(u[k], step, axis=k) for k in range(3))
    laplacian = sum((np.roll(u, -1, 1 + k) - 2 * u + np.roll(u, 1, 1 + k)) / step**2 for k in range(3))
    gradient = np.stack([np.gradient(p, step, axis=k) for k in range(3)])
    residual = np.linalg.norm(sphere.viscosity * laplacian - gradient, axis=0)
    return float(np.abs(divergence[near]).max()), float(residual[near].max())


def test_mass_and_momentum_are_kept_to_second_order(around: Flow, sphere: Any) -> None:
    coarse, fine = (np.array(_errors(around, sphere, n)) for n in (73, 145))
    rate = np.log2(coarse / fine)
    assert np.all(rate > 1.7), rate
    speed = np.linalg.norm(sphere.velocity)
    scales = np.array([speed / sphere.radius, sphere.viscosity * speed / sphere.radius**2])
    assert np.all(fine < 0.02 * scales), fine / scales


def test_a_volume_holds_the_field_at_its_points(around: Flow, sphere: Any) -> None:
    dataset = around.volume(resolution=40)
    assert dataset["velocity_x"].dims == ("x", "y", "z")
    x, y, z = np.meshgrid(*(dataset[axis].values for axis in "xyz"), indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)
    solid = sphere.inside(points)
    np.testing.assert_array_equal(dataset["inside"].values.ravel(), solid)
    velocity, pressure = sphere.fields(points[~solid])
    np.testing.assert_array_equal(_vectors(dataset).reshape(3, -1).T[~solid], velocity)
    np.testing.assert_array_equal(dataset["pressure"].values.ravel()[~solid], pressure)
    for name in (*COMPONENTS, "pressure"):
        np.testing.assert_array_equal(np.isnan(dataset[name].values.ravel()), solid)


@pytest.mark.parametrize(("plane", "across"), [("xz", "y"), ("xy", "z"), ("yz", "x")])
def test_a_plane_stands_where_it_is_asked_for(around: Flow, sphere: Any, plane: str, across: str) -> None:
    dataset = around.plane(plane, offset="-5 mm", resolution=30)
    assert dataset["pressure"].dims == tuple(plane)
    assert dataset[across].ndim == 0
    assert float(dataset[across]) == pytest.approx(-0.005, rel=1e-15)
    place = {plane[0]: 1, plane[1]: 2}
    point = dataset.isel(place)
    velocity, pressure = sphere.fields(np.array([[float(point[axis]) for axis in "xyz"]]))
    # One point alone is summed in another order than a whole plane.
    assert [float(point[name]) for name in COMPONENTS] == pytest.approx(list(velocity[0]), rel=1e-12, abs=1e-18)
    assert float(point["pressure"]) == pytest.approx(pressure[0], rel=1e-12)


def test_the_body_frame_lacks_the_forward_velocity_and_nothing_else(around: Flow) -> None:
    lab = around.plane(resolution=30)
    body = replace(around, frame="body").plane(resolution=30)
    np.testing.assert_allclose(
        lab["velocity_x"] - body["velocity_x"], np.where(lab["inside"], np.nan, around.prediction.forward_velocity)
    )
    for name in ("velocity_y", "velocity_z", "pressure", "inside"):
        np.testing.assert_array_equal(lab[name], body[name])


def test_the_default_box_holds_the_robot_and_a_given_one_reaches_as_far_as_asked(around: Flow) -> None:
    dataset = around.plane(resolution=200)
    step = float(dataset["x"][1] - dataset["x"][0])
    assert float(dataset["x"][0]) == pytest.approx(-0.0175 - 0.01 - 0.06 - 0.0005 - 1.2 * 0.018)
    assert float(dataset["x"][-1]) == pytest.approx(0.0175 + 1.2 * 0.018)
    assert float(dataset["z"][-1]) == pytest.approx(0.009 + 1.2 * 0.018, abs=step)
    assert float(dataset["z"][-1]) == -float(dataset["z"][0])
    assert dataset.sizes["x"] == 200
    np.testing.assert_allclose(np.diff(dataset["z"]), step)  # as fine across as along
    closer = around.plane(extent="2 mm", resolution=200)
    assert float(closer["x"][-1]) == pytest.approx(0.0195)


def test_blocks_and_progress_do_not_change_the_answer(around: Flow, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = around.plane(resolution=40)
    told: list[tuple[int, int]] = []
    monkeypatch.setattr(flow_grid, "_BLOCK", 97)
    pieces = around.plane(resolution=40, progress=lambda _what, done, total: told.append((done, total)))
    xr.testing.assert_identical(whole, pieces)
    assert told[0] == (0, told[0][1])
    assert told[-1] == (told[0][1], told[0][1])
    assert [done for done, _ in told] == sorted({done for done, _ in told})


def test_settings_and_versions_go_into_the_attributes(around: Flow) -> None:
    attributes = around.plane(resolution=5).attrs
    assert {"robot", "frame", "phase", "forward_velocity", "settings", "versions", "warnings"} <= set(attributes)
    assert "wall effects are not modelled" in attributes["warnings"]
    free = Flow(
        sp.predict(sp.load("biorob2012-wide", channel="none"), tail_rate=7.5, model="sbt"), around.field, 0.0, "lab"
    )
    assert "wall" not in free.plane(resolution=5).attrs["warnings"]


def test_files_are_read_back(around: Flow, tmp_path: Any) -> None:
    from spirillum.files import write_dataset

    dataset = around.volume(resolution=12)
    write_dataset(dataset, tmp_path / "flow.nc")
    with xr.open_dataset(tmp_path / "flow.nc") as stored:
        xr.testing.assert_equal(stored, dataset)
        assert stored["inside"].dtype == bool
        assert stored["velocity_x"].attrs["units"] == "m/s"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"plane": "xx"}, "plane = 'xx'.*allowed: xz, xy, yz"),
        ({"offset": "5"}, 'offset = "5" has no unit'),
        ({"offset": "5 s"}, '"s" is not a unit of length'),
        ({"offset": "nan m"}, "is not finite"),
        ({"extent": "-1 mm"}, "extent = .* is out of range"),
        ({"resolution": 0}, "resolution = 0; allowed: 2 to 10000"),
        ({"resolution": 1}, "resolution = 1; allowed: 2"),
        ({"resolution": 1_000_000}, "resolution = 1000000; allowed"),
        ({"resolution": 9000}, "points; allowed: at most 2000000 points, here a resolution of"),
    ],
)
def test_wrong_grids_are_named(around: Flow, arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(sp.InputError, match=words):
        around.plane(**arguments)


def test_the_largest_allowed_resolution_is_one_that_is_accepted(around: Flow) -> None:
    from spirillum.fields.grid import box_around

    with pytest.raises(sp.InputError) as caught:
        box_around(around.robot, None, 1000)
    most = int(str(caught.value).rsplit(" ", 1)[-1])
    assert 1_500_000 < box_around(around.robot, None, most).size <= 2_000_000


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (np.zeros(3), "points have shape"),
        (np.zeros((2, 2)), "points have shape \\(2, 2\\)"),
        (np.array([[1.0, 0.0, 0.0], [np.nan, 0.0, 0.0]]), "point 1 = .* is not finite"),
    ],
)
def test_wrong_points_are_named(around: Flow, points: np.ndarray, words: str) -> None:
    for question in (around.velocity, around.pressure, around.inside):
        with pytest.raises(sp.InputError, match=words):
            question(points)
