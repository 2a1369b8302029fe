"""The picture of a flow is to scale, shows the field's numbers, and covers all that is solid."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import LogNorm, SymLogNorm
from matplotlib.patches import PathPatch, Polygon
from matplotlib.path import Path as Path2D
from matplotlib.text import Text

import spirillum as sp
from spirillum.fields.flow import Flow
from spirillum.view.figures.flow import flow_figure
from spirillum.view.figures.style import save_as

WIDE = "biorob2012-wide"


@pytest.fixture(scope="module")
def around(sphere: Any) -> Flow:
    """A sphere's flow under the name of a robot."""
    return Flow(sp.predict(WIDE, tail_rate="1.2 Hz", model="sbt"), sphere, 0.4, "lab")


@pytest.fixture(scope="module")
def in_tube(sphere: Any) -> Callable[..., Flow]:
    """A sphere's flow under the name of a robot that lies in a tube."""
    from spirillum.fluid.tube.tube import Tube
    from spirillum.robot.placement import Placement

    def make(**placement: str) -> Flow:
        prediction = sp.predict(WIDE, tail_rate="1.2 Hz", model="sbt")
        placed = prediction.batch.placed(Placement.of(placement))
        return Flow(replace(prediction, model=Tube(), batch=placed), sphere, 0.4, "lab")

    return make


@pytest.fixture
def without_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """No streamlines: they take a third of the time of a figure."""
    monkeypatch.setattr("spirillum.view.figures.flow._draw_lines", lambda *_: None)


def _words(figure: Any) -> str:
    return " ".join(text.get_text() for text in figure.findobj(Text))


@pytest.mark.usefixtures("without_lines")
@pytest.mark.parametrize(
    ("plane", "offset"), [("xz", 0.0), pytest.param("xy", 0.004, marks=pytest.mark.slow), ("yz", -0.05)]
)
def test_panels_are_to_scale_and_show_the_field(around: Flow, plane: str, offset: float) -> None:
    data = around.plane(plane, offset=offset, resolution=60)
    figure = flow_figure(around, data)
    speed = np.sqrt(sum(data[f"velocity_{axis}"].values ** 2 for axis in "xyz")).T
    for axes, values in zip(figure.axes[:2], (speed, data["pressure"].values.T), strict=True):
        (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
        place = axes.get_window_extent()
        assert (right - left) / place.width == pytest.approx((top - bottom) / place.height)
        assert (left, right) == pytest.approx(1e3 * data[plane[0]].values[[0, -1]])  # mm
        assert axes.get_xlabel() == f"${plane[0]}$ (mm)"
        assert axes.get_ylabel() == f"${plane[1]}$ (mm)"
        (image,) = axes.images
        shown = np.asarray(image.get_array())
        free = np.isfinite(values)
        ratio = shown[free] / values[free]
        np.testing.assert_allclose(ratio, ratio.flat[0], rtol=1e-12)  # the unit's prefix
        assert np.isfinite(shown).all()  # no fringe without colour at the solids


@pytest.mark.usefixtures("without_lines", "unplaced")
def test_colours_are_logarithmic_for_speed_and_centred_for_pressure(around: Flow) -> None:
    figure = flow_figure(around, around.plane(resolution=60))
    speed, pressure = (axes.images[0] for axes in figure.axes if axes.images)
    assert isinstance(speed.norm, LogNorm)
    assert speed.get_cmap().name == "viridis"
    assert isinstance(pressure.norm, SymLogNorm)
    assert pressure.norm.vmin == -float(pressure.norm.vmax or 0)
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert any(label.startswith("speed (") and label.endswith("m/s)") for label in labels)
    assert any(label.startswith("pressure (") and label.endswith("Pa)") for label in labels)


@pytest.mark.usefixtures("without_lines", "unplaced")
def test_the_section_covers_the_robots_solids(around: Flow) -> None:
    """Points of body, coupling and wire lie in what is drawn, points beside them do not."""
    figure = flow_figure(around, around.plane(resolution=20))
    axes = figure.axes[0]
    outlines = [patch.get_path() for patch in axes.patches if isinstance(patch, Polygon)]
    body, coupling = outlines
    assert body.contains_points([(0, 0), (17, 0), (-17, 8.9), (0, -8.9)]).all()  # mm
    assert not body.contains_points([(17, 8), (-18, 0), (0, 9.1)]).any()  # a hemispherical nose, a flat rear
    assert coupling.contains_points([(-22, 2.9), (-18.1, 0), (-26.9, 0)]).all()
    assert not coupling.contains_points([(-17.8, 0), (-27.2, 0), (-22, 3.1)]).any()  # a clearance on both sides


@pytest.mark.usefixtures("without_lines", "unplaced")
def test_the_wire_is_cut_where_it_crosses_the_plane(around: Flow) -> None:
    """At z = 0 a plain wire crosses where sin(kx + phi) = 0, a half wavelength apart, at +B_o and -B_o in turn."""
    plain = Flow(
        sp.predict(sp.load(WIDE, **{"tail.taper": "none"}), tail_rate=7.5, model="sbt"), around.field, 0.4, "lab"
    )
    axes = flow_figure(plain, plain.plane("xy", resolution=20)).axes[0]
    cuts = [item for item in axes.collections if type(item).__name__ == "QuadContourSet" and not item.filled]
    (cut,) = cuts
    centres = np.array([polygon.mean(axis=0) for path in cut.get_paths() for polygon in path.to_polygons()])
    centres = centres[np.argsort(-centres[:, 0])]
    k = 2 * np.pi / 25.0
    expected = np.array([(-0.4 - n * np.pi) / k for n in range(30)])
    expected = expected[(expected < -27.5 - 1.5) & (expected > -87.5 + 1.5)]
    inner = centres[(centres[:, 0] < -27.5 - 1.5) & (centres[:, 0] > -87.5 + 1.5)]
    np.testing.assert_allclose(inner[:, 0], expected, atol=0.15)
    np.testing.assert_allclose(inner[:, 1], 2.5 * np.cos(k * expected + 0.4), atol=0.1)


@pytest.mark.usefixtures("without_lines", "unplaced")
def test_a_plane_beside_the_robot_cuts_nothing(around: Flow) -> None:
    axes = flow_figure(around, around.plane("xz", offset=0.02, resolution=20)).axes[0]
    assert not [patch for patch in axes.patches if isinstance(patch, Polygon) and patch.get_fill()]
    assert not [item for item in axes.collections if type(item).__name__ == "QuadContourSet"]
    assert not [patch for patch in axes.patches if isinstance(patch, PathPatch)]


@pytest.mark.usefixtures("without_lines", "unplaced")
def test_words_name_plane_frame_phase_and_motion(around: Flow) -> None:
    words = _words(flow_figure(around, around.plane("xy", offset=-0.004, resolution=20)))
    for wanted in ("plane xy at z = −4 mm", "lab frame", "phase 22.92°", "1.2 Hz", "1.102 mm/s", "no walls", "dashed"):
        assert wanted in words
    turned = replace(around, frame="body")
    assert "frame of the swimming robot" in _words(flow_figure(turned, turned.plane(resolution=20)))


@pytest.mark.usefixtures("unplaced")
@pytest.mark.parametrize(("plane", "resolution"), [("xz", 2), ("yz", 3)])
def test_the_coarsest_grids_are_drawn(around: Flow, resolution: int, plane: str, tmp_path: Path) -> None:
    save_as(flow_figure(around, around.plane(plane, resolution=resolution)), tmp_path / "flow.png")


@pytest.mark.parametrize(
    ("fields", "suffixes"),
    [
        ({"tail.handedness": "left", "drive.kind": "rate", "drive.rate": "-1 Hz"}, ("png",)),
        ({"body.diameter": "0.9 m", "body.length": "1 m", "channel": "none"}, ("pdf",)),
    ],
)
@pytest.mark.usefixtures("without_lines", "unplaced")
def test_any_robot_can_be_drawn(fields: dict[str, str], suffixes: tuple[str, ...], sphere: Any, tmp_path: Path) -> None:
    _drawn(fields, suffixes, sphere, tmp_path)


@pytest.mark.usefixtures("unplaced")
def test_a_robot_of_micrometres_has_its_streamlines(sphere: Any, tmp_path: Path) -> None:
    body = {"body.diameter": "2 um", "body.length": "4 um", "coupling.length": "0 mm", "channel": "none"}
    tail = {
        "tail.length": "20 um",
        "tail.wavelength": "5 um",
        "tail.amplitude": "0.8 um",
        "tail.wire_diameter": "100 nm",
    }
    _drawn(body | tail, ("svg",), sphere, tmp_path)


@pytest.mark.usefixtures("without_lines")
def test_a_very_long_name_finds_room(sphere: Any, tmp_path: Path) -> None:
    fields = {"name": "$x_{1}$ of a very long name " * 6, "channel": "none"}
    _drawn(fields, ("svg",), sphere, tmp_path)


def _drawn(fields: dict[str, str], suffixes: tuple[str, ...], sphere: Any, tmp_path: Path) -> None:
    robot = sp.load(WIDE, **fields)
    flow = Flow(sp.predict(robot, model="sbt"), replace(sphere, radius=0.5 * robot.body.diameter), 0.0, "lab")
    figure = flow_figure(flow, flow.plane(resolution=30))
    for suffix in suffixes:
        save_as(figure, tmp_path / f"flow.{suffix}")
        assert (tmp_path / f"flow.{suffix}").stat().st_size > 5_000


@pytest.mark.usefixtures("unplaced")
def test_a_plane_inside_a_solid_is_drawn(around: Flow, sphere: Any, tmp_path: Path) -> None:
    solid = replace(around, field=replace(sphere, radius=1.0))
    save_as(flow_figure(solid, solid.plane(resolution=20)), tmp_path / "flow.png")


@pytest.mark.parametrize(("plane", "offset"), [("xz", 0.0), ("xz", 0.012), ("xy", 0.004), ("yz", -0.05)])
@pytest.mark.parametrize("pitch", [pytest.param("0 deg", marks=pytest.mark.slow), "3 deg"])
@pytest.mark.usefixtures("without_lines", "unplaced")
def test_the_glass_covers_all_beyond_the_wall(
    in_tube: Callable[..., Flow], plane: str, offset: float, pitch: str
) -> None:
    flow = in_tube(gap="1 mm", pitch=pitch, ends="closed")
    assert flow.seat is not None
    axes = flow_figure(flow, flow.plane(plane, offset=offset, resolution=30)).axes[0]
    (glass,) = [patch for patch in axes.patches if type(patch) is PathPatch]
    first, second = (limits for limits in (axes.get_xlim(), axes.get_ylim()))
    spots = np.random.default_rng(1).uniform([first[0], second[0]], [first[1], second[1]], (400, 2))
    points = np.full((400, 3), offset)
    points[:, ["xyz".index(axis) for axis in plane]] = 1e-3 * spots
    turned = np.stack([points[:, 0], points[:, 2], -points[:, 1]], axis=1)
    rho = np.hypot(*flow.seat.placed(turned)[:, 1:].T)
    clear = np.abs(rho - 0.02) > 2e-5
    frame, bore = (Path2D(corners) for corners in glass.get_path().to_polygons())
    drawn = frame.contains_points(spots) & ~bore.contains_points(spots)
    np.testing.assert_array_equal(drawn[clear], (rho > 0.02)[clear])


@pytest.mark.usefixtures("without_lines", "unplaced")
def test_words_and_the_third_panel_tell_of_the_tube(in_tube: Callable[..., Flow]) -> None:
    flow = in_tube(gap="1 mm", pitch="2 deg", ends="closed", tail_drop="1 mm")
    data = flow.plane(resolution=30)
    figure = flow_figure(flow, data)
    words = _words(figure)
    for wanted in ("gap 1 mm", "pitch 2°", "ends closed", "tail lowered by 1 mm", "mean of the tube's ends"):
        assert wanted in words
    assert "no walls" not in words
    (line,) = [line for line in figure.axes[2].lines if len(line.get_xdata()) > 2]
    x, pressure = (np.asarray(values, dtype=float) for values in line.get_data())
    column = data["pressure"].sel(x=1e-3 * x[7], method="nearest").dropna("z")
    largest = np.abs(pressure).max() / np.abs(pressure[7])
    uppermost = [data["pressure"].sel(x=1e-3 * place, method="nearest").dropna("z").values[-1] for place in x]
    assert np.abs(uppermost).max() / abs(float(column[-1])) == pytest.approx(largest)
    assert len(flow_figure(flow, flow.plane("yz", resolution=20)).axes) == len(figure.axes) - 1


@pytest.mark.usefixtures("without_lines", "unplaced")
def test_imposed_flow_and_open_ends_are_told(in_tube: Callable[..., Flow]) -> None:
    imposed = in_tube(gap="1 mm", flow="-2 mm/s")
    assert "imposed mean flow" in _words(flow_figure(imposed, imposed.plane(resolution=20)))
    opened = in_tube(gap="1 mm")
    assert "ends open, mean flow" in _words(flow_figure(opened, opened.plane(resolution=20)))
