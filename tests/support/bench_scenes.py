"""One scene in three styles: the virtual camera, flat drawings, the light table; random truth from a seed.

A scene is still a drawing: what a bench does to its frames and times is in `bench_troubles`. Some troubles are of the
scene itself, its `variant`: another seal, a body that does not turn, a small robot, a tail that is too fast.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from backlit_pictures import INKS, Backlit
from flat_pictures import PAINTS, Flat
from spirillum.robot.load import PAPER_ROBOTS, is_preset, load
from spirillum.robot.mesh import STRIPE_COLOURS
from spirillum.robot.robot import Robot, robot_text
from spirillum.robot.surface import linear_light
from spirillum.units import Hz
from spirillum.virtual.artifacts import Degradation, Troubles, stripe_edges
from spirillum.virtual.disturbances import Disturbances
from spirillum.virtual.motion import motion_of
from spirillum.virtual.optics import framed, lens_of, swimming_range, tank_of
from spirillum.virtual.pictures import FrameEncoder, Painter
from spirillum.virtual.trial_options import CameraOptions, MotionOptions, TrialOptions
from spirillum.virtual.truth import setup_text

STYLES = ("virtual", "flat", "light-table")
VARIANTS = ("", "uneven", "bare", "one-colour", "line", "bars", "stuck", "small", "fast-tail")
PATTERNS = {
    "line": ("white", *("black",) * 23),
    "bars": (*("black",) * 3, "white", "black", *("white",) * 3),  # no three neighbours come twice
}
"""Seals of other stripes than the paper's, which the robot's file states."""
FPS = 25.0
"""Frames a second of all films."""
DURATION = 3.0
"""Of all films, s, unless a trouble shortens them."""
SIZES = ((320, 240), (400, 300), (480, 360))
SMALL = 12.0 / 35.0
"""Size of a small robot over the paper's: a body of 12 mm."""


@dataclass(frozen=True)
class Drawn:
    """The random truth of a seed, the same in all styles; SI, rates about +x."""

    seed: int
    robot: Robot
    size: tuple[int, int]
    direction: str
    side: bool
    velocity: float
    tail_rate: float
    body_rate: float
    place: float
    """Start as a share of the way on which the robot is seen whole."""
    lateral: float
    heading: float
    body_angle: float
    tail_phase: float
    edges: tuple[float, ...] | None
    """Of the stripes where they are uneven."""
    paint: str
    """Of a seal of one colour; none of the stripes'."""


def drawn(seed: int, variant: str = "") -> Drawn:
    """Random truth: speed 0.4 to 3 mm/s, tail 0.5 to 4 Hz, body -0.03 to -0.3 Hz, both channels and directions.

    Args:
        seed: of the random numbers.
        variant: of the scene; it changes nothing that it need not.
    """
    rng = np.random.default_rng([1900, seed])

    def between(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    robot = load(str(rng.choice(PAPER_ROBOTS)))
    found = Drawn(
        seed=seed,
        robot=robot,
        size=SIZES[rng.integers(len(SIZES))],
        direction=str(rng.choice(["right", "left"])),
        side=bool(rng.random() < 0.2),
        velocity=1e-3 * between(0.4, 3.0),
        tail_rate=Hz * between(0.5, 4.0),
        body_rate=-Hz * between(0.03, 0.3),
        place=float(rng.uniform(0.1, 0.9)),
        lateral=float(rng.uniform(-3e-3, 3e-3)),
        heading=float(np.radians(rng.uniform(-2.0, 2.0))),
        body_angle=float(rng.uniform(0.0, 2.0 * np.pi)),
        tail_phase=float(rng.uniform(0.0, 2.0 * np.pi)),
        edges=None,
        paint=str(rng.choice(["orange", "magenta", "cyan", "green"])),
    )
    if variant == "uneven":
        assert robot.seal is not None
        uneven = stripe_edges(Troubles(uneven_stripes=0.2), len(robot.seal.stripes), seed)
        return replace(found, edges=tuple(uneven.tolist()))
    if variant in PATTERNS:
        return replace(found, robot=_with_stripes(robot, PATTERNS[variant]), body_angle=rng.uniform(-1.0, 1.0))
    if variant == "stuck":
        return replace(found, body_rate=0.0)
    if variant == "small":
        return replace(found, robot=shrunk(robot, SMALL))
    if variant == "fast-tail":
        return replace(found, tail_rate=Hz * FPS * float(rng.uniform(0.55, 0.95)))
    return found


def _with_stripes(robot: Robot, stripes: tuple[str, ...]) -> Robot:
    """A robot with other stripes, which its file states."""
    return load({"extends": robot.name, "name": "striped", "seal": {"stripes": list(stripes)}})


def shrunk(robot: Robot, share: float) -> Robot:
    """A robot whose lengths are all smaller by a factor, in the same channel."""
    parts = {"body": ("diameter", "length"), "coupling": ("diameter", "length", "clearance"), "seal": ("length",)}
    parts["tail"] = ("wavelength", "amplitude", "length", "wire_diameter")
    tables = {
        part: {name: f"{share * getattr(getattr(robot, part), name)!r} m" for name in names}
        for part, names in parts.items()
    }
    tables["body"]["mass"] = f"{share**3 * (robot.body.mass or 0.0)!r} kg"
    return load({"extends": robot.name, "name": "small", **tables})


@dataclass(frozen=True)
class Scene:
    """A drawing of a robot that swims, by one style."""

    truth: Drawn
    size: tuple[int, int]
    draw: Callable[[float], np.ndarray]
    """The picture at a time, (height, width, 3), 8-bit RGB."""
    middle: Callable[[float], np.ndarray]
    """Pixel of the body's mid-length at a time, (2,)."""
    scale: float
    """Pixels in a metre, at the robot's axis."""
    setup: dict[str, str]
    """Lines of the setup file."""
    robot_text: str | None
    """File of a robot that is no preset; the setup names it `robot.toml`."""


def scene(style: str, seed: int, variant: str = "") -> Scene:
    """The scene of a seed in a style.

    Args:
        style: of `STYLES`.
        seed: of the random truth.
        variant: of `VARIANTS`.
    """
    truth = drawn(seed, variant)
    return {"virtual": _virtual, "flat": _flat, "light-table": _light_table}[style](truth, variant)


def _start(truth: Drawn, visible: float) -> float:
    """x of the mid-length at first, where a picture centred on 0 shows `visible` metres of the axis."""
    robot, margin = truth.robot, 0.03 * visible
    rear = 0.5 * robot.body.length + robot.coupling.length + robot.tail.length
    low, high = -0.5 * visible + margin + rear, 0.5 * visible - margin - 0.5 * robot.body.length
    return low + truth.place * (high - low - truth.velocity * DURATION)


def _named(truth: Drawn) -> tuple[str, str | None]:
    """How the setup names the robot, and the text of its file."""
    return (truth.robot.name, None) if is_preset(truth.robot) else ("robot.toml", robot_text(truth.robot))


def _virtual(truth: Drawn, variant: str) -> Scene:
    robot, seal = truth.robot, truth.robot.seal
    assert seal is not None
    if variant == "bare":
        robot = robot.model_copy(update={"seal": None})
    if variant == "one-colour":
        robot = robot.model_copy(update={"seal": seal.model_copy(update={"stripes": (truth.paint, "white")})})
    size = f"{truth.size[0]}x{truth.size[1]}"
    camera = CameraOptions.of(
        {"direction": truth.direction, "size": size, "view": "side" if truth.side else "top", "fps": FPS}
    )
    low, high = swimming_range(robot, camera)
    room = 0.04 * (high - low + robot.body.length)
    trial = TrialOptions.of(
        {
            "duration": DURATION,
            "start": low + room + truth.place * (high - low - 2 * room - truth.velocity * DURATION),
            "lateral": truth.lateral,
            "heading": truth.heading,
            "body_angle": truth.body_angle,
            "tail_phase": truth.tail_phase,
        }
    )
    motion = MotionOptions.of(
        {"forward_velocity": truth.velocity, "tail_rate": truth.tail_rate, "body_rate": truth.body_rate}
    )
    tank, lens = tank_of(robot, camera.view), lens_of(camera, (0.0, 0.0))
    trajectory = framed(motion_of(robot, motion, trial, camera).trajectory, robot, lens, trial.start)
    edges = None if truth.edges is None else np.array(truth.edges)
    painter = Painter(robot, tank, lens, edges)
    if variant == "one-colour":
        painter.body = replace(painter.body, colours=_all_of_one(painter.body.colours, truth.paint))
    clean = Disturbances.of_robot(Degradation(), truth.seed, lens, DURATION, robot, tank)
    frames = FrameEncoder(painter, clean, trajectory, camera.exposure)

    def middle(time: float) -> np.ndarray:
        return np.asarray(lens.project(trajectory.at(time).position[None])[0, :2])

    ends = lens.project(trajectory.at(0.0).position + np.array([[0.0, 0.0, 0.0], [1e-3, 0.0, 0.0]]))
    name, text = _named(truth)
    height = float(trajectory.position[:, 2].mean())
    tables = tomllib.loads(setup_text(name, camera, lens, tank.spacing, (height, 0.0), timed=True))
    lines = {f"{table}.{key}": _toml(value) for table, part in tables.items() for key, value in part.items()}
    # Across the channel a trial counts from the channel's middle, in the lab; pictures show what the trajectory says.
    placed = replace(truth, lateral=float(trajectory.position[:, 1].mean()), heading=float(trajectory.heading.mean()))
    return Scene(placed, truth.size, frames.image, middle, abs(ends[1, 0] - ends[0, 0]) / 1e-3, lines, text)


def _all_of_one(colours: np.ndarray, paint: str) -> np.ndarray:
    """Colours of the body's triangles, white stripes painted over."""
    white, instead = (linear_light(np.array(STRIPE_COLOURS[name])) for name in ("white", paint))
    return np.where(np.isclose(colours, white).all(axis=1)[:, None], instead, colours)


def _toml(value: Any) -> str:
    return f'"{value}"' if isinstance(value, str) else repr(value)


def _flat(truth: Drawn, variant: str) -> Scene:
    changes: dict[str, Any] = {}
    if variant == "bare":
        changes = {"stripes": (), "seal": (96, 70, 62)}
    if variant == "one-colour":
        changes = {"stripes": (), "seal": PAINTS[truth.paint]}
    robot, width = truth.robot, truth.size[0]
    focal = 1.15 * width
    height, axis = 0.2, 0.5 * robot.body.diameter + 0.006
    picture = Flat(
        robot=robot,
        size=truth.size,
        direction=truth.direction,
        camera_height=height,
        axis_height=axis,
        focal=focal,
        velocity=truth.velocity,
        tail_rate=truth.tail_rate,
        body_rate=truth.body_rate,
        start=(_start(truth, width * (height - axis) / focal), truth.lateral),
        heading=truth.heading,
        body_angle=truth.body_angle,
        tail_phase=truth.tail_phase,
        fps=FPS,
        frames=round(DURATION * FPS) + 1,
        edges=truth.edges,
        seed=truth.seed,
        **changes,
    )

    def middle(time: float) -> np.ndarray:
        return picture.pixels(picture.placed(np.zeros(3), time))

    name, text = _named(truth)
    lines = dict(line.split(" = ", 1) for line in picture.setup_text().splitlines())
    lines |= {"robot.file": f'"{name}"'}
    del lines["camera.frames_per_second"], lines["robot.stripes"]
    return Scene(truth, truth.size, picture.draw, middle, focal / (height - axis), lines, text)


def _light_table(truth: Drawn, variant: str) -> Scene:
    rng = np.random.default_rng([1901, truth.seed])
    width, height = truth.size[0], float(rng.uniform(0.2, 0.32))
    axis = 0.5 * truth.robot.body.diameter + float(rng.uniform(0.006, 0.011))
    visible = float(rng.uniform(0.128, 0.150))
    focal = width * (height - axis) / visible
    picture = Backlit(
        robot=truth.robot,
        size=truth.size,
        direction=truth.direction,
        camera_height=round(height, 6),
        axis_height=round(axis, 6),
        focal=focal,
        velocity=truth.velocity,
        tail_rate=truth.tail_rate,
        body_rate=truth.body_rate,
        start=(_start(truth, visible), truth.lateral),
        heading=truth.heading,
        body_angle=truth.body_angle,
        tail_phase=truth.tail_phase,
        edges=truth.edges,
        plain={"bare": "bare", "one-colour": truth.paint}.get(variant),
        ruler_side=float(rng.choice([-1.0, 1.0])),
        paint=tuple((rng.uniform(0.06, 0.22) * rng.uniform(0.8, 1.2, 3)).tolist()),
        seed=truth.seed,
    )
    assert truth.paint in INKS

    def middle(time: float) -> np.ndarray:
        return picture.pixels(picture.placed(np.zeros(3), time))

    name, text = _named(truth)
    lines = picture.setup() | {"robot.file": f'"{name}"'}
    return Scene(truth, truth.size, picture.draw, middle, focal / (height - axis), lines, text)
