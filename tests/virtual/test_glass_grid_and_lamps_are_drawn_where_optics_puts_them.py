"""A glass cover, grid paper and mirrored lamps lie where optics puts them, and the truth stays what it is."""

import json

import numpy as np
import pytest

import spirillum as sp
from spirillum.errors import InputError
from spirillum.virtual.artifacts import Troubles, ViewArtifacts
from spirillum.virtual.optics import VirtualLens, backdrop, tank_of
from spirillum.virtual.pictures import Painter, light_path
from spirillum.virtual.trajectory import TrialTrajectory, steady_trajectory

LENS = VirtualLens(0.21, 0.06, 1.4, 740.0, (640, 480), distortion=(-0.02, 0.0))
RADIUS, WALL, GLASS = 9e-3, 0.11, 1.47


def refracted(ray: np.ndarray, normal: np.ndarray, before: float, after: float) -> np.ndarray | None:
    """Direction behind a surface by Snell's law in vectors, its normal against the ray; None: total reflection."""
    ratio, cos = before / after, -float(ray @ normal)
    rest = 1.0 - ratio**2 * (1.0 - cos**2)
    return None if rest < 0 else ratio * ray + (ratio * cos - np.sqrt(rest)) * normal


def hit(place: np.ndarray, ray: np.ndarray, radius: float) -> np.ndarray:
    """The next point on a circle about the origin."""
    half, rest = float(place @ ray), float(place @ place) - radius**2
    root = np.sqrt(half**2 - rest)
    ways = [way for way in (-half - root, -half + root) if way > 1e-9 * radius]
    return place + min(ways) * ray


def floor_place(distance: float, height: float, index: float) -> float | None:
    """Where a vertical ray through a cover with air inside meets the floor, followed from surface to surface."""
    inner = RADIUS * (1.0 - WALL)
    ray, place = np.array([0.0, -1.0]), hit(np.array([distance, 2 * RADIUS]), np.array([0.0, -1.0]), RADIUS)
    ray = refracted(ray, place / RADIUS, index, GLASS)
    place = hit(place, ray, inner)
    normal = place / inner
    inside = refracted(ray, normal, GLASS, 1.0)
    if inside is None:
        ray = ray - 2.0 * (ray @ normal) * normal
    else:
        place = hit(place, inside, inner)
        ray = refracted(inside, -place / inner, 1.0, GLASS)
    place = hit(place, ray, RADIUS)
    ray = refracted(ray, -place / RADIUS, GLASS, index)
    return None if ray[1] >= -0.3 else float(place[0] - (place[1] + height) / ray[1] * ray[0])


@pytest.mark.parametrize("index", [1.35, 1.40, 1.46])
def test_the_floor_is_seen_where_rays_that_are_followed_meet_it(index: float) -> None:
    far = np.concatenate([np.linspace(0.02, 0.6, 30), np.linspace(0.72, 0.89 * GLASS / index - 0.02, 12)])
    shift, floor = light_path(far, RADIUS, 11.5e-3, index)
    compared = 0
    for where, moved, share in zip(far, shift, floor, strict=True):
        expected = floor_place(where * RADIUS, 11.5e-3, index)
        if expected is not None:
            assert where * RADIUS + moved == pytest.approx(expected, abs=1e-9)
            assert share > 0.0
            compared += 1
    assert compared > 30


def test_the_middle_lets_light_through_as_two_surfaces_of_glass_do() -> None:
    shift, floor = light_path(np.array([1e-9]), RADIUS, 11.5e-3, 1.40)
    assert shift[0] == pytest.approx(0.0, abs=1e-9)
    assert floor[0] == pytest.approx((1.0 - (0.47 / 2.47) ** 2) ** 2, rel=1e-6)


@pytest.mark.parametrize("axis", [0, 1])
def test_lines_of_grid_paper_lie_where_the_lens_sees_them(axis: int) -> None:
    robot = sp.load("biorob2012-wide", channel="none")
    still = backdrop(tank_of(robot, "top", grid=True), LENS)
    for number in (-10, -5, 5, 10, 15):  # each fifth line is strong
        place = np.array([[1.0e-3, 1.0e-3, 0.0]])
        place[0, axis] = number * 2e-3
        u, v, _ = LENS.project(place)[0]
        rows, columns = slice(round(v) - 3, round(v) + 4), slice(round(u) - 3, round(u) + 4)
        light = still.light[rows, columns, 1].astype(float).mean(axis=axis)
        dark = np.maximum(np.median(light) - light, 0.0)
        middle = (dark * np.arange(640)[columns if axis == 0 else rows]).sum() / dark.sum()
        assert middle == pytest.approx((u, v)[axis], abs=0.1)


def test_ink_covers_the_share_of_the_floor_that_its_lines_have() -> None:
    robot = sp.load("biorob2012-wide", channel="none")
    light = backdrop(tank_of(robot, "top", grid=True), LENS).light.mean(axis=(0, 1))
    strong = 0.16 / 5
    bare = 1.0 - strong - (0.11 - 0.11 / 5)  # each fifth fine line lies under a strong one
    red_paper, red_fine, red_strong = ((0.055 + c) ** 2.4 / 1.055**2.4 for c in (0.90, 0.47, 0.17))
    any_strong = 1.0 - (1.0 - strong) ** 2
    red = red_paper * bare**2 + red_strong * any_strong + red_fine * (1.0 - bare**2 - any_strong)
    assert light[0] == pytest.approx(red * np.exp(-0.72 * 0.062), rel=0.02)  # of oil, seen a little aslant


def still_robot(angle: float, tank_height: float) -> TrialTrajectory:
    rates = {"forward_velocity": 0.0, "body_rotation_rate": 0.0, "tail_rotation_rate": 0.0}
    return steady_trajectory(1.0, **rates, position=np.array([0.03, 0.0, tank_height - 10.5e-3]), body_angle=angle)


def test_a_cover_changes_the_body_before_its_seal_and_turns_with_it() -> None:
    robot = sp.load("biorob2012-wide")
    tank = tank_of(robot, "top")
    path = still_robot(0.2, tank.tube_height)
    plain = Painter(robot, tank, LENS).light(path, 0.5, 0.0)
    covered = Painter(robot, tank, LENS, covered=True)
    glass = covered.light(path, 0.5, 0.0)
    seal = LENS.project(np.array([[0.03 - 6.5e-3, 0.0, path.position[0, 2] + 9e-3]]))[0, 0]
    changed = np.flatnonzero(np.abs(glass - plain).max(axis=(0, 2)) > 0.01)
    nose = LENS.project(np.array([[0.03 + 17.5e-3, 0.0, path.position[0, 2]]]))[0, 0]
    assert seal - 4 < changed.min() < seal + 2
    assert nose - 2 < changed.max() < nose + 2
    # Stripes come back after half a turn; the battery's faces differ.
    turned = covered.light(still_robot(0.2 + np.pi, tank.tube_height), 0.5, 0.0)
    before = round(seal) - 6
    assert np.abs(turned - glass)[:, :before].max() < 0.02
    assert np.abs(turned - glass)[:, before:].max() > 0.1


def test_a_robot_without_a_seal_has_no_cover() -> None:
    robot = sp.load("biorob2012-wide", seal="none")
    with pytest.raises(InputError, match=r"glass_cover .* requires a robot with a seal"):
        Painter(robot, tank_of(robot, "top"), LENS, covered=True)


def test_mirrored_lamps_stand_still_and_add_light() -> None:
    view = ViewArtifacts(Troubles(mirrored_lamps=2), 4, (160, 120))
    dark, bright = np.zeros((120, 160, 3), dtype=np.float32), np.full((120, 160, 3), 0.3, dtype=np.float32)
    first, later = view.camera_picture(dark, 0.0), view.camera_picture(bright, 7.0) - bright
    assert later == pytest.approx(first, abs=1e-6)
    assert 0.02 < (first > 0.1).mean() < 0.3
    assert first.dtype == np.float32
    assert np.any(first != ViewArtifacts(Troubles(mirrored_lamps=2), 5, (160, 120)).camera_picture(dark, 0.0))
    assert ViewArtifacts(Troubles(), 4, (160, 120)).camera_picture(dark, 0.0) is dark


def test_the_truth_is_that_of_the_same_robot(tmp_path) -> None:
    rates = {"forward_velocity": "1 mm/s", "body_rate": "-0.1 Hz", "tail_rate": "1.2 Hz"}
    told, pictures, setups = [], [], []
    for name, troubles in (("plain", None), ("paper", "glass-cover,grid-paper,mirrored-lamps")):
        trial = sp.render(
            "biorob2012-wide",
            tmp_path / name,
            motion=rates,
            trial={"duration": "0.1 s"},
            camera={"size": "160x120", "fps": 20.0},
            troubles=troubles,
        )
        told.append(json.loads(trial.truth.read_text()))
        setups.append(trial.setup.read_text())
        pictures.append([path.read_bytes() for path in sorted(trial.path.glob("*.png"))])
    stated = told[1].pop("troubles")
    assert stated == told[0].pop("troubles") | {"glass_cover": True, "grid_paper": True, "mirrored_lamps": 2}
    assert told[0] == told[1]
    assert setups[0] == setups[1].replace('appearance = "glass"', 'appearance = "opaque"')
    assert len(pictures[0]) == len(pictures[1]) == 3
    assert all(one != other for one, other in zip(*pictures, strict=True))


def test_what_is_alike_for_all_seeds_does_not_count_as_drawn_from_one() -> None:
    assert not Troubles(glass_cover=True, grid_paper=True, blurred=1.0, rolled="4 deg", clock_jump="1 s").uses_seed
    for name, size in {"lost_frames": 0.1, "handheld": 1.0, "uneven_stripes": 0.1, "cables": 1}.items():
        assert Troubles(**{name: size}).uses_seed
    assert Troubles(mirrored_lamps=1).uses_seed
