"""Flat drawings of a swimming robot, deliberately unlike the virtual camera: a second style that has to track as well.

Own pinhole, no oil, no shading, no glass; other colours. Shares nothing with renderer and tracker but the geometry of
the robot. Camera's frame: x towards the nose, z towards the camera, y = z x x; pixel centres at whole numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from spirillum.robot.links import outlines_of
from spirillum.robot.load import load
from spirillum.robot.outline import Segment
from spirillum.robot.robot import Robot
from spirillum.robot.tail_form import amplitude_envelope

PAINTS = {
    "red": (176, 38, 70),
    "yellow": (226, 208, 92),
    "green": (60, 128, 60),
    "blue": (70, 92, 190),
    "white": (236, 240, 244),
    "black": (22, 26, 30),
    "orange": (214, 110, 40),
    "magenta": (176, 60, 160),
    "cyan": (70, 170, 190),
}
"""8-bit RGB of the stripes' names: not the shades that the robot's own pictures have."""

_SHIFT = 10  # fractional bits of the polygons' corners


@dataclass(frozen=True)
class Flat:
    """A flat film and all that is true of it; SI, rates signed about +x."""

    robot: Robot = field(default_factory=lambda: load("biorob2012-wide"))
    size: tuple[int, int] = (320, 240)
    view: str = "top"
    direction: str = "right"
    camera_height: float = 0.20
    axis_height: float = 0.015
    focal: float = 350.0
    ruler_height: float = 0.0
    spacing: float = 0.002
    ruler: bool = True
    velocity: float = 1e-3
    tail_rate: float = 2 * np.pi * 1.1
    body_rate: float = -2 * np.pi * 0.12
    start: tuple[float, float] = (0.02, 0.0)
    heading: float = 0.0
    body_angle: float = 0.3
    tail_phase: float = 0.7
    fps: float = 30.0
    frames: int = 60
    dropped: frozenset[int] = frozenset()
    floor: tuple[int, int, int] = (150, 190, 170)
    lines: tuple[int, int, int] = (60, 40, 90)
    body: tuple[int, int, int] = (96, 70, 62)
    wire: tuple[int, int, int] = (30, 30, 60)
    coupling: tuple[int, int, int] = (120, 120, 50)
    seal: tuple[int, int, int] = (200, 200, 205)
    paints: dict[str, tuple[int, int, int]] = field(default_factory=lambda: dict(PAINTS))
    stripes: Sequence[str] | None = None
    """Order of the stripes as they are drawn, if not that of the robot."""
    edges: tuple[float, ...] | None = None
    """Angles of the edges between stripes, from the first one's on, rad, one more than stripes; None: even ones."""
    noise: float = 0.0
    """Standard deviation of the noise, of 255."""
    lamp: float = 0.0
    """Share by which the lamp drifts over the film."""
    fine: int = 6
    """Samples across a pixel."""
    seed: int = 1

    @property
    def times(self) -> np.ndarray:
        """Times of the frames that were not dropped, s."""
        kept = [index for index in range(self.frames) if index not in self.dropped]
        return np.array(kept) / self.fps

    def truth(self, time: np.ndarray | float) -> dict[str, np.ndarray]:
        """Where the robot is: x, y of its mid-length, heading, body_angle, tail_phase (lab)."""
        time = np.asarray(time, dtype=float)
        return {
            "x": self.start[0] + self.velocity * time,
            "y": self.start[1] + 0.0 * time,
            "heading": self.heading + 0.0 * time,
            "body_angle": self.body_angle + self.body_rate * time,
            "tail_phase": self.tail_phase + self.tail_rate * time,
        }

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """Pixels of points of the camera's frame (height above the reference plane as z), (..., 2)."""
        sign = 1.0 if self.direction == "right" else -1.0
        scale = sign * self.focal / (self.camera_height - points[..., 2])
        centre = 0.5 * (np.array(self.size) - 1.0)
        return np.stack([centre[0] + scale * points[..., 0], centre[1] - scale * points[..., 1]], axis=-1)

    def placed(self, points: np.ndarray, time: float) -> np.ndarray:
        """Points of the robot, without its roll, in the camera's frame."""
        true = self.truth(time)
        cos, sin = np.cos(self.heading), np.sin(self.heading)
        x, y, z = points[..., 0], points[..., 1], points[..., 2]
        return np.stack(
            [true["x"] + cos * x - sin * y, true["y"] + sin * x + cos * y, self.axis_height + z],
            axis=-1,
        )

    def draw(self, time: float) -> np.ndarray:
        """The picture at a time, (height, width, 3), 8-bit RGB."""
        import cv2

        left, top, right, bottom = self._window(time)
        still, canvas, picture = self._still
        picture = picture.copy()
        if right > left and bottom > top:
            part = slice(top * self.fine, bottom * self.fine), slice(left * self.fine, right * self.fine)
            self._draw_rotor(canvas, time)
            self._draw_body(canvas, time)
            box = (right - left, bottom - top)
            picture[top:bottom, left:right] = cv2.resize(canvas[part], box, interpolation=cv2.INTER_AREA)
            canvas[part] = still[part]
        if not self.lamp and not self.noise:
            return picture
        duration = self.frames / self.fps
        bright = picture * (1.0 + self.lamp * np.sin(1.5 * np.pi * time / duration))
        if self.noise:
            rng = np.random.default_rng([self.seed, round(1e6 * time)])
            bright += rng.normal(0.0, self.noise, bright.shape)
        return np.clip(np.rint(bright), 0, 255).astype(np.uint8)

    def _window(self, time: float) -> tuple[int, int, int, int]:
        """Pixels about all of the robot: left, top, right, bottom; the rest of the picture is still."""
        robot, tail = self.robot, self.robot.tail
        front, wire = 0.5 * robot.body.length, tail.wire_diameter
        ends = -front - robot.coupling.length - tail.length - wire, front
        reach = max(0.5 * robot.body.diameter, 0.5 * robot.coupling.diameter, tail.amplitude + wire)
        box = [[x, y, z] for x in ends for y in (-reach, reach) for z in (-reach, reach)]
        corners = self.pixels(self.placed(np.array(box), time))
        low = np.clip(np.floor(corners.min(axis=0)).astype(int) - 2, 0, None)
        high = np.minimum(np.ceil(corners.max(axis=0)).astype(int) + 3, self.size)
        return int(low[0]), int(low[1]), int(high[0]), int(high[1])

    @cached_property
    def _still(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What stays from picture to picture, floor and ruler: a fine canvas, one to draw on, and the picture."""
        import cv2

        width, height = self.size
        canvas = np.empty((height * self.fine, width * self.fine, 3), dtype=np.uint8)
        canvas[:] = self.floor
        if self.ruler:
            self._draw_ruler(canvas)
        return canvas, canvas.copy(), cv2.resize(canvas, self.size, interpolation=cv2.INTER_AREA)

    def _fill(self, canvas: np.ndarray, corners: np.ndarray, colour: Any) -> None:
        """Fill a polygon given in pixels; of several, (n, corners, 2), one after the other."""
        import cv2

        # A fine cell is centred where its share of the pixel is.
        fine = np.rint(((corners + 0.5) * self.fine - 0.5) * 2**_SHIFT).astype(np.int32)
        for polygon in fine.reshape(-1, *fine.shape[-2:]):
            cv2.fillPoly(canvas, [polygon], [int(c) for c in colour], shift=_SHIFT)

    def _draw_ruler(self, canvas: np.ndarray) -> None:
        reach = 0.5 * max(self.size) * (self.camera_height - self.ruler_height) / self.focal
        count = int(reach / self.spacing) + 2
        for index in range(-count, count + 1):
            x = self.spacing * index + 0.00037
            for low, high in ((0.024, 0.032), (-0.032, -0.024)):
                box = np.array([[x - 0.25e-3, low], [x + 0.25e-3, low], [x + 0.25e-3, high], [x - 0.25e-3, high]])
                corners = np.column_stack([box, np.full(4, self.ruler_height)])
                self._fill(canvas, self.pixels(corners), self.lines)

    def _draw_rotor(self, canvas: np.ndarray, time: float) -> None:
        robot, tail = self.robot, self.robot.tail
        if "coupling" in (outlines := outlines_of(robot)):
            self._fill(canvas, self._silhouette(outlines["coupling"], time), self.coupling)
        xi = np.linspace(0.0, tail.length, 1 + int(40 * tail.length / tail.wavelength))
        radius = amplitude_envelope(
            xi, *(np.full(1, v) for v in (tail.amplitude, tail.length, np.inf if tail.taper is None else tail.taper))
        )[0]
        x = -0.5 * robot.body.length - robot.coupling.length - xi
        angle = robot.hand * 2 * np.pi / tail.wavelength * x + float(self.truth(time)["tail_phase"])
        wire = np.stack([x, radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
        wire = np.concatenate([[[x[0] + robot.coupling.length, 0.0, 0.0], [x[0], 0.0, 0.0]], wire])
        seen = self.placed(wire, time)
        middle = self.pixels(seen)
        half = 0.5 * tail.wire_diameter * self.focal / (self.camera_height - seen[:, 2])
        along = np.diff(middle, axis=0)
        along /= np.linalg.norm(along, axis=1, keepdims=True) + 1e-300
        across = np.column_stack([-along[:, 1], along[:, 0]])
        circle = np.linspace(0.0, 2 * np.pi, 17)[:-1]
        disc = np.column_stack([np.cos(circle), np.sin(circle)])
        # The wire has one colour, so that pieces and discs may come in any order.
        sides = half[:-1, None] * across, half[1:, None] * across
        pieces = (middle[:-1] + sides[0], middle[1:] + sides[1], middle[1:] - sides[1], middle[:-1] - sides[0])
        self._fill(canvas, np.stack(pieces, axis=1), self.wire)
        self._fill(canvas, middle[1:, None] + half[1:, None, None] * disc, self.wire)

    def _silhouette(self, outline: Any, time: float) -> np.ndarray:
        """What a solid of revolution covers: convex hull of rings on its surface."""
        from scipy.spatial import ConvexHull

        # The hull of a straight piece is that of its ends.
        straight, bent = np.array([0.0, 1.0]), np.linspace(0.0, 1.0, 25)
        pieces = [piece.points(straight if isinstance(piece, Segment) else bent) for piece in outline.pieces]
        x, rho = (np.concatenate(part) for part in zip(*pieces, strict=True))
        around = np.linspace(0.0, 2 * np.pi, 97)[:-1, None]
        points = np.stack([x + 0 * around, rho * np.cos(around), rho * np.sin(around)], axis=-1).reshape(-1, 3)
        seen = self.pixels(self.placed(points, time))
        return seen[ConvexHull(seen).vertices]

    def _draw_body(self, canvas: np.ndarray, time: float) -> None:
        robot = self.robot
        self._fill(canvas, self._silhouette(outlines_of(robot)["body"], time), self.body)
        if robot.seal is None:
            return
        stripes = tuple(robot.seal.stripes) if self.stripes is None else tuple(self.stripes)
        # Ray by ray, as polygons are drawn a little too large.
        rear, front = -0.5 * robot.body.length, robot.seal.length - 0.5 * robot.body.length
        radius = 0.5 * robot.body.diameter
        box = [[x, y, z] for x in (rear, front) for y in (-radius, radius) for z in (-radius, radius)]
        corners = (self.pixels(self.placed(np.array(box), time)) + 0.5) * self.fine
        low = np.clip(np.floor(corners.min(axis=0)), 0, None).astype(int)
        high = np.clip(np.ceil(corners.max(axis=0)), 0, np.array(canvas.shape[1::-1])).astype(int)
        if np.any(high <= low):
            return
        u, v = np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]))
        sign = 1.0 if self.direction == "right" else -1.0
        centre, true = 0.5 * (np.array(self.size) - 1.0), self.truth(time)
        across = sign * ((u + 0.5) / self.fine - 0.5 - centre[0]) / self.focal
        up = -sign * ((v + 0.5) / self.fine - 0.5 - centre[1]) / self.focal
        cos, sin = np.cos(self.heading), np.sin(self.heading)
        eye = np.array([-true["x"], -true["y"]])
        eye_x, eye_y, eye_z = (
            cos * eye[0] + sin * eye[1],
            cos * eye[1] - sin * eye[0],
            self.camera_height - self.axis_height,
        )
        d_x, d_y = cos * across + sin * up, cos * up - sin * across
        a, b, c = d_y**2 + 1.0, d_y * eye_y - eye_z, eye_y**2 + eye_z**2 - radius**2
        inside = b**2 - a * c
        t = (-b - np.sqrt(np.maximum(inside, 0.0))) / a
        x, y, z = eye_x + t * d_x, eye_y + t * d_y, eye_z - t
        hit = (inside > 0) & (x >= rear) & (x <= front)
        canvas[v[hit], u[hit]] = self.seal
        if stripes:
            place = (np.arctan2(-y, z) - float(true["body_angle"])) * len(stripes) / (2 * np.pi) + 0.5
            if self.edges is not None:
                edges = np.array(self.edges)
                angle = (np.arctan2(-y, z) - float(true["body_angle"]) - edges[0]) % (2 * np.pi) + edges[0]
                place = np.searchsorted(edges, angle, side="right") - 1
            paints = np.array([self.paints[name] for name in stripes], dtype=np.uint8)
            canvas[v[hit], u[hit]] = paints[np.floor(place[hit]).astype(int) % len(stripes)]

    def pictures(self) -> Iterator[tuple[float, np.ndarray]]:
        """Time and picture of each frame that was not dropped."""
        for time in self.times:
            yield float(time), self.draw(float(time))

    def setup_text(self, **changes: str) -> str:
        """What an experimenter would write; `changes` replace lines, such as `robot_direction = '"left"'`."""
        stripes = self.robot.seal.stripes if self.robot.seal is not None else ()
        lines = {
            "camera.view": f'"{self.view}"',
            "camera.height": f'"{self.camera_height * 1e3!r} mm"',
            "camera.frames_per_second": f"{float(self.fps)!r}",
            "markers.spacing": f'"{self.spacing * 1e3!r} mm"',
            "markers.height": f'"{self.ruler_height * 1e3!r} mm"',
            "robot.file": '"biorob2012-wide"',
            "robot.axis_height": f'"{self.axis_height * 1e3!r} mm"',
            "robot.direction": f'"{self.direction}"',
            "robot.stripes": str(list(stripes)).replace("'", '"'),
        }
        if not self.ruler:
            del lines["markers.spacing"], lines["markers.height"]
            scale = (self.camera_height - self.axis_height) / self.focal
            lines["markers.length_per_pixel"] = f'"{scale * 1e3!r} mm"'
        lines |= {name.replace("_", ".", 1): text for name, text in changes.items()}
        return "".join(f"{name} = {text}\n" for name, text in lines.items())

    def write(self, path: Path, **changes: str) -> Path:
        """Write the film (`.mp4` and the like, or a folder of PNG) and its setup beside it; the setup's path."""
        if path.suffix:
            self._write_film(path)
        else:
            self._write_folder(path)
        setup = path.with_name(path.stem + ".setup.toml")
        setup.write_text(self.setup_text(**changes))
        return setup

    def _write_film(self, path: Path) -> None:
        import av

        rate = Fraction(self.fps).limit_denominator(1000)
        tick = 1 / (rate * 512)
        with av.open(str(path), "w") as container:
            stream: Any = container.add_stream("libx264", rate=rate, options={"crf": "14", "preset": "veryfast"})
            stream.width, stream.height, stream.pix_fmt = *self.size, "yuv420p"
            stream.time_base = stream.codec_context.time_base = tick
            stream.codec_context.thread_count = 1  # two give now and then another film
            for time, picture in self.pictures():
                frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
                frame.pts, frame.time_base = round(time / tick), tick
                container.mux(stream.encode(frame))
            container.mux(stream.encode())

    def _write_folder(self, path: Path) -> None:
        import cv2

        path.mkdir()
        for time, picture in self.pictures():
            cv2.imwrite(str(path / f"{round(time * self.fps):05d}.png"), picture[..., ::-1])


_DRAWN: dict[str, list[np.ndarray]] = {}


def drawn(film: Flat) -> list[np.ndarray]:
    """The pictures of a film; those of the same film are drawn once, and are not to be written on."""
    if (key := repr(film)) not in _DRAWN:
        _DRAWN[key] = [picture for _, picture in film.pictures()]
        for picture in _DRAWN[key]:
            picture.setflags(write=False)
    return _DRAWN[key]


def flat(**changes: Any) -> Flat:
    """A flat film with some things changed."""
    return replace(Flat(), **changes)
