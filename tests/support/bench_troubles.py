"""What a real bench does to a film, as changes of its frames, times and setup: on top of any style of picture."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path

import numpy as np

from bench_scenes import DURATION, FPS, Scene

SPEED, BODY, TAIL, MOTOR = "forward_velocity", "body_rotation_rate", "tail_rotation_rate", "motor_rotation_rate"
ACROSS, HEADING = "lateral_position", "heading"
RATES = (SPEED, BODY, TAIL, MOTOR)


@dataclass(frozen=True)
class Film:
    """Frames, and the numbers by which the film counts their times."""

    images: list[np.ndarray] = field(repr=False)
    numbers: list[int]
    """As the film states them: time = number / FPS."""
    times: list[float]
    """True ones, s."""
    setup: dict[str, str]
    crf: int = 16

    def write(self, folder: Path, robot_text: str | None) -> tuple[Path, Path]:
        """Write film, setup and robot into a folder; paths of the first two."""
        import av

        film, setup = folder / "film.mp4", folder / "setup.toml"
        with av.open(str(film), "w") as container:
            options = {"crf": str(self.crf), "preset": "veryfast", "x264-params": "mbtree=0"}
            stream = container.add_stream("libx264", rate=Fraction(FPS), options=options)
            stream.height, stream.width = self.images[0].shape[:2]
            stream.pix_fmt, stream.codec_context.thread_count = "yuv420p", 1
            for image, number in zip(self.images, self.numbers, strict=True):
                frame = av.VideoFrame.from_ndarray(image, format="rgb24")
                frame.pts = number
                container.mux(stream.encode(frame))
            container.mux(stream.encode())
        setup.write_text("".join(f"{name} = {text}\n" for name, text in self.setup.items()), encoding="utf-8")
        if robot_text is not None:
            (folder / "robot.toml").write_text(robot_text, encoding="utf-8")
        return film, setup


Change = Callable[[Film, Scene, np.random.Generator], Film]


@dataclass(frozen=True)
class Trouble:
    """A trouble, and what can still be known with it."""

    name: str
    what: str
    """What is done, for the ledger."""
    change: Change
    variant: str = ""
    """Of the scene; see `bench_scenes`."""
    known: tuple[str, ...] = RATES
    """What a careful person could still read off the frames."""
    still: bool = True
    """Whether camera and picture are upright and still, so that place and heading are compared too."""


def _each(film: Film, change: Callable[[np.ndarray, int], np.ndarray]) -> Film:
    """Change pictures, given as floats, one by one."""
    images = [change(image.astype(np.float32), index) for index, image in enumerate(film.images)]
    return replace(film, images=[np.clip(np.rint(image), 0, 255).astype(np.uint8) for image in images])


def _none(film: Film, _scene: Scene, _rng: np.random.Generator) -> Film:
    return film


def _kept(film: Film, kept: np.ndarray, *, even: bool) -> Film:
    """Some of the frames; `even`: the film counts them on without gaps."""
    numbers = list(range(len(kept))) if even else [film.numbers[index] for index in kept]
    return replace(film, images=[film.images[k] for k in kept], numbers=numbers, times=[film.times[k] for k in kept])


def _lost(share: float, *, even: bool) -> Change:
    def change(film: Film, _scene: Scene, rng: np.random.Generator) -> Film:
        count = len(film.images)
        gone = 1 + rng.permutation(count - 2)[: round(share * count)]
        return _kept(film, np.delete(np.arange(count), gone), even=even)

    return change


def _clock_jumps(film: Film, _scene: Scene, rng: np.random.Generator) -> Film:
    late, half = round(rng.uniform(1.0, 4.0) * FPS), len(film.numbers) // 2
    return replace(film, numbers=[number + late * (place >= half) for place, number in enumerate(film.numbers)])


def _piece_missing(*, even: bool) -> Change:
    """A second from the middle of the film."""

    def change(film: Film, _scene: Scene, rng: np.random.Generator) -> Film:
        count, gone = len(film.images), round(FPS)
        start = int(rng.integers(count // 3, 2 * count // 3 - gone // 2))
        return _kept(film, np.delete(np.arange(count), np.arange(start, start + gone)), even=even)

    return change


def _joined(film: Film, _scene: Scene, _rng: np.random.Generator) -> Film:
    """Its first half twice, as where two recordings were joined."""
    half = (len(film.images) + 1) // 2
    return replace(
        film,
        images=[*film.images[:half], *film.images[:half]],
        numbers=film.numbers[: 2 * half],
        times=film.times[: 2 * half],
    )


def _first(seconds: float) -> Change:
    return lambda film, _scene, _rng: _kept(film, np.arange(round(seconds * FPS) + 1), even=False)


def _moved(image: np.ndarray, u: float, v: float, roll: float) -> np.ndarray:
    import cv2

    rows, columns = image.shape[:2]
    matrix = cv2.getRotationMatrix2D((0.5 * (columns - 1), 0.5 * (rows - 1)), np.degrees(roll), 1.0)
    matrix[:, 2] += u, v
    return cv2.warpAffine(image, matrix, (columns, rows), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)


def _rolled(film: Film, _scene: Scene, rng: np.random.Generator) -> Film:
    roll = np.radians(rng.uniform(2.0, 8.0)) * rng.choice([-1.0, 1.0])
    return _each(film, lambda image, _: _moved(image, 0.0, 0.0, roll))


def _portrait(film: Film, _scene: Scene, rng: np.random.Generator) -> Film:
    quarter = int(rng.choice([1, 3]))
    rightwards = film.setup["robot.direction"] == '"right"'
    up = rightwards == (quarter == 1)
    setup = film.setup | {"robot.direction": '"up"' if up else '"down"'}
    images = [np.ascontiguousarray(np.rot90(image, quarter)) for image in film.images]
    return replace(film, images=images, setup=setup)


def _handheld(film: Film, _scene: Scene, rng: np.random.Generator) -> Film:
    sway, jitter = 2.0, 0.7
    rates = 2 * np.pi * np.exp(rng.uniform(np.log(0.15), np.log(1.2), (3, 4)))
    phases, sizes = rng.uniform(0, 2 * np.pi, (3, 4)), sway * rng.uniform(0.5, 1.0, (3, 4)) / np.sqrt(2.0)
    shakes = jitter * rng.standard_normal((len(film.images), 3))

    def change(image: np.ndarray, index: int) -> np.ndarray:
        u, v, turn = (sizes * np.sin(rates * film.times[index] + phases)).sum(axis=1) + shakes[index]
        return _moved(image, u, v, 2e-4 * turn)

    return _each(film, change)


def _wrong_spacing(film: Film, _scene: Scene, rng: np.random.Generator) -> Film:
    true = float(film.setup["markers.spacing"].strip('"').split()[0])
    wrong = true * float(rng.choice([0.8, 0.9, 1.1, 1.25]))
    return replace(film, setup=film.setup | {"markers.spacing": f'"{wrong!r} mm"'})


def _wrong_rate(film: Film, _scene: Scene, _rng: np.random.Generator) -> Film:
    return replace(film, setup=film.setup | {"camera.frames_per_second": "30.0"})


def _wrong_direction(film: Film, _scene: Scene, _rng: np.random.Generator) -> Film:
    other = {'"right"': '"left"', '"left"': '"right"'}[film.setup["robot.direction"]]
    return replace(film, setup=film.setup | {"robot.direction": other})


def _grid(image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    v, u = np.mgrid[: image.shape[0], : image.shape[1]]
    return u, v


def _glare(*, moves: bool) -> Change:
    def change(film: Film, scene: Scene, rng: np.random.Generator) -> Film:
        body = scene.truth.robot.body
        offset = scene.scale * rng.uniform([-0.5, -0.3], [0.5, 0.3]) * np.array([body.length, body.diameter])
        minor = float(np.sqrt(0.2 * 0.94 * body.length * body.diameter / (1.6 * np.pi))) * scene.scale
        still = scene.middle(0.5 * DURATION)
        u, v = _grid(film.images[0])

        def one(image: np.ndarray, index: int) -> np.ndarray:
            at = (scene.middle(film.times[index]) if moves else still) + offset
            far = ((u - at[0]) / (1.6 * minor)) ** 2 + ((v - at[1]) / minor) ** 2
            return image + (340.0 * np.exp(-(far**2)))[..., None]

        return _each(film, one)

    return change


def _cables(film: Film, scene: Scene, rng: np.random.Generator) -> Film:
    """Two dark cables that hang across the view, above the robot; each covers three percent of the picture's width."""
    import cv2

    rows, columns = film.images[0].shape[:2]
    cover = np.zeros((rows, columns), dtype=np.uint8)
    for _ in range(2):
        knots = np.linspace(-5, rows + 5, 40)
        place = rng.uniform(0.1, 0.9) * columns + rng.uniform(-0.2, 0.2) * (knots - 0.5 * rows)
        place += rng.uniform(0.02, 0.05) * columns * np.sin(knots / rows * 2 * np.pi + rng.uniform(0, 2 * np.pi))
        path = np.rint(np.column_stack([place, knots]) * 16).astype(np.int32)
        cv2.polylines(cover, [path], False, 255, max(2, columns // 80), cv2.LINE_AA, shift=4)
    share = (cover / 255.0)[..., None]
    return _each(film, lambda image, _: image * (1 - share) + share * np.array([38.0, 36.0, 42.0]))


def _bubbles(film: Film, scene: Scene, rng: np.random.Generator) -> Film:
    rows, columns = film.images[0].shape[:2]
    count = 8
    places = rng.uniform([0, 0.3 * rows], [columns, 0.7 * rows], (count, 2))
    drift = rng.uniform(-0.4e-3, 0.4e-3, (count, 2)) * scene.scale * np.array([1.0, 0.2])
    radius = rng.uniform(0.4e-3, 1.3e-3, count) * scene.scale
    u, v = _grid(film.images[0])

    def change(image: np.ndarray, index: int) -> np.ndarray:
        for place, speed, size in zip(places, drift, radius, strict=True):
            at = place + speed * film.times[index]
            share = np.hypot(u - at[0], v - at[1]) / size
            ring = np.exp(-(((share - 0.85) / 0.2) ** 2))
            spot = np.exp(-(((u - at[0] + 0.3 * size) ** 2 + (v - at[1] + 0.3 * size) ** 2) / (0.25 * size) ** 2))
            image = image * (1 - 0.45 * ring)[..., None] + (150.0 * spot)[..., None]
        return image

    return _each(film, change)


def _noise(sigma: float) -> Change:
    def change(film: Film, _scene: Scene, rng: np.random.Generator) -> Film:
        return _each(film, lambda image, _: image + sigma * rng.standard_normal(image.shape, dtype=np.float32))

    return change


def _blurred(film: Film, _scene: Scene, rng: np.random.Generator) -> Film:
    import cv2

    sigma = float(rng.uniform(0.7, 1.3))
    return _each(film, lambda image, _: cv2.GaussianBlur(image, (0, 0), sigma))


def _compressed(film: Film, _scene: Scene, _rng: np.random.Generator) -> Film:
    return replace(film, crf=34)


def _lamp(film: Film, _scene: Scene, rng: np.random.Generator) -> Film:
    phase, rate, sign = rng.uniform(0, 2 * np.pi), rng.uniform(0.5, 1.5), rng.choice([-1.0, 1.0])
    wave = bool(rng.integers(2))

    def change(image: np.ndarray, index: int) -> np.ndarray:
        share = film.times[index] / DURATION
        drift = 0.2 * (np.sin(2 * np.pi * rate * share + phase) if wave else sign * share)
        return image * ((1.0 + drift) * (1.0 + 0.25 * drift * np.array([1.0, 0.0, -1.0]))) ** (1 / 2.2)

    return _each(film, change)


def _hand(film: Film, _scene: Scene, rng: np.random.Generator) -> Film:
    when, sign = rng.uniform(0.2, 0.8) * DURATION, rng.choice([-1.0, 1.0])
    u, v = _grid(film.images[0])
    rows, columns = film.images[0].shape[:2]
    along = np.exp(-(((v - rng.uniform(0.3, 0.7) * rows) / (0.55 * rows)) ** 4))

    def change(image: np.ndarray, index: int) -> np.ndarray:
        middle = columns * (0.5 + sign * 1.6 * (film.times[index] - when) / 4.0)
        across = np.exp(-(((u - middle) / (0.28 * columns)) ** 4))
        return image * ((1.0 - 0.45 * across * along) ** (1 / 2.2))[..., None]

    return _each(film, change)


def _all_of(*changes: Change) -> Change:
    def change(film: Film, scene: Scene, rng: np.random.Generator) -> Film:
        for one in changes:
            film = one(film, scene, rng)
        return film

    return change


_WITHOUT_BODY = (SPEED, TAIL)
"""What is known of a body whose stripes say nothing."""
TROUBLES = (
    Trouble("none", "a clean film", _none),
    Trouble("noise", "standard deviation of 8 of 255 in every pixel", _noise(8.0)),
    Trouble("blur", "out of focus by 0.7 to 1.3 pixels (standard deviation)", _blurred),
    Trouble("compression", "H.264 with a constant rate factor of 34", _compressed),
    Trouble("lamp", "the lamp drifts by a fifth", _lamp),
    Trouble("hand", "the shadow of a hand passes", _hand),
    Trouble("bubbles", "eight bubbles drift over the tube", _bubbles),
    Trouble("cables", "two dark cables hang across the view", _cables),
    Trouble("glare, moving", "a spot as large as a fifth of the body moves along with it", _glare(moves=True)),
    Trouble("glare, standing", "the same spot stands still where the robot passes", _glare(moves=False)),
    Trouble(
        "degraded",
        "lamp, moving glare, noise, compression, a twentieth of the frames missing",
        _all_of(_lamp, _glare(moves=True), _lost(0.05, even=False), _noise(8.0), _compressed),
    ),
    Trouble("frames missing", "a tenth of the frames, with true times", _lost(0.1, even=False)),
    Trouble("frames lost, times even", "a twentieth of the frames, and the film counts on", _lost(0.05, even=True)),
    Trouble("camera paused", "a second is missing, with true times", _piece_missing(even=False)),
    Trouble("film cut", "a second is missing, and the film counts on", _piece_missing(even=True), known=()),
    Trouble("films joined", "the first half follows once more", _joined, known=()),
    Trouble("clock jumps", "by 1 to 4 s in the middle, nothing is missing", _clock_jumps, known=()),
    Trouble("camera rolled", "by 2 to 8 degrees", _rolled, still=False),
    Trouble("portrait", "the camera is turned by 90 degrees", _portrait, still=False),
    Trouble("hand-held", "2 pixels of sway, 0.7 pixels from frame to frame", _handheld, still=False),
    Trouble("short", "a film of one second", _first(1.0)),
    Trouble("small robot", "a body of 12 mm, 2 seconds", _first(2.0), variant="small"),
    Trouble("stripes uneven", "widths differ by up to a fifth", _none, variant="uneven"),
    Trouble("one painted line", "15 degrees wide, white on black; it faces the camera at first", _none, variant="line"),
    Trouble("bars", "eight, black and white, of which no three neighbours come twice", _none, variant="bars"),
    Trouble("seal bare", "no stripes, though the setup names them", _none, variant="bare", known=_WITHOUT_BODY),
    Trouble("seal of one colour", "instead of stripes", _none, variant="one-colour", known=_WITHOUT_BODY),
    Trouble("body stuck", "it does not turn, the tail does", _none, variant="stuck", known=_WITHOUT_BODY),
    Trouble(
        "ruler's spacing wrong", "in the setup, by -20, -10, 10 or 25 %", _wrong_spacing, known=(BODY, TAIL, MOTOR)
    ),
    Trouble("frame rate wrong", "the setup says 30 for 25 frames a second", _wrong_rate, known=()),
    Trouble("direction wrong", "the setup says left for right", _wrong_direction, known=()),
    Trouble("tail too fast", "0.55 to 0.95 turns from frame to frame", _none, variant="fast-tail", known=(SPEED, BODY)),
)
