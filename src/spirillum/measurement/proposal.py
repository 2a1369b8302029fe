"""From a video to a setup file: detected values are filled in, those that only the experimenter knows are marked."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from spirillum.answer_entries import answer_of
from spirillum.display import DisplayMixin
from spirillum.errors import InputError
from spirillum.files import checked_path, new_file, output_target
from spirillum.measurement.setup_template import KNOWN, setup_text, toml_value
from spirillum.notes import Note
from spirillum.robot.load import PAPER_ROBOTS, load
from spirillum.robot.robot import Robot
from spirillum.units import KINDS, parse_option
from spirillum.vision.camera.optics import project
from spirillum.vision.track.constants import IDENTITY, SETUP_FREE, SIZE
from spirillum.vision.track.setup_free_detection import SetupFreeDetection, detect_without_setup
from spirillum.vision.track.steadiness import camera_flags
from spirillum.vision.video.frames import Video, open_video

Confidence = Literal["clear", "doubtful", "not found"]
_OUTER = 1.1  # outer over inner diameter of a glass tube, about; assumed
_USUAL_RATE = 30.0  # frames a second at which a folder of images is looked at until its rate is known
_SPACING = (0.8, 1.4)
"""A ruler's spacing over that from the robot's size at the robot's own depth, where nothing is wrong: the ruler may be
farther away, or a little nearer. Assumed.
"""
_AT_REST = 0.2  # speed below which a robot counts as resting, pixels a second


@dataclass(frozen=True)
class Finding:
    """One finding from a video."""

    name: str  #: `frame_rate`, `ruler`, `robot`, `direction`, `travel`, `appearance`, `stripes` or `walls`.
    value: Any  #: What it is; None where it was not found.
    unit: str  #: Its unit; `1` for what has none, empty for words.
    confidence: Confidence  #: `clear`, `doubtful` or `not found`.
    sentence: str  #: What was seen, and what that rests on.
    field: str = ""  #: Field of the setup that it fills in; empty where there is none.
    pixels: tuple[tuple[tuple[float, float], ...], ...] = ()  #: For drawing: lines through pixels (u, v).


@dataclass(frozen=True, repr=False)
class Proposal(DisplayMixin):
    """A setup as far as a video determines it."""

    film: str  #: Name of the video.
    size: tuple[int, int]  #: Width and height of its pictures, pixels.
    robot: str  #: The robot that was looked for: a preset's name or a file.
    findings: tuple[Finding, ...]  #: What was found.
    to_fill: tuple[tuple[str, str], ...]  #: Fields that only the experimenter knows, each with what it means.
    text: str  #: The setup file.
    file: str | None = None  #: Where it was written; None: nowhere.
    warnings: tuple[Note, ...] = ()

    def found(self, name: str) -> Finding:
        """A finding by its name."""
        return next(finding for finding in self.findings if finding.name == name)

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return answer_of(self, to_fill=[{"field": field, "sentence": sentence} for field, sentence in self.to_fill])


def propose_setup(
    film: str | Path,
    robot: str | Path | None = None,
    output: str | Path | None = None,
    *,
    spacing: str | float | None = None,
    fps: float | None = None,
    overwrite: bool = False,
    progress: Callable[[str, int, int], None] | None = None,
) -> Proposal:
    """Look at a video and propose its setup.

    Args:
        film: the video, or a folder of images.
        robot: a preset's name or a robot file; None: the paper's robot, in the channel that the walls look like.
        output: setup file to write (`.toml`); None: none is written.
        spacing: distance of the ruler's lines, with its unit or a float in m; None: left to be filled in.
        fps: frames a second of a folder of images, or in place of a video's own times.
        overwrite: overwrite a file that is there.
        progress: called with stage, number done, and total.

    Returns:
        What was found and how sure it is, what is left to be filled in, and the text of the file.

    Raises:
        InputError: if the video or the robot cannot be read, the video shows neither a ruler nor the robot, or the file
            cannot be written.
    """
    target = None
    if output is not None:
        target = output_target(
            Path(output), {".toml": "a setup file"}, "setup.toml", replace="any" if overwrite else "none"
        )
    apart = None if spacing is None else parse_option("spacing", spacing, KINDS["length"])
    if fps is not None and not 0.01 <= fps <= 1e5:
        raise InputError(f"fps = {fps:g}; allowed: 0.01 to 100000 frames a second")
    name = PAPER_ROBOTS[0] if robot is None else str(robot)
    loaded = load(name)
    video = open_video(
        film, fps or (_USUAL_RATE if checked_path(film, "a film, or a folder of images").is_dir() else None)
    )
    seen_there = detect_without_setup(video, loaded, apart, progress)
    if seen_there.known is None and seen_there.lines is None:
        raise InputError(
            f"{video.name} shows neither a ruler nor a robot like '{loaded.name}' at any scale; allowed: a film in "
            "which all of the robot is in view and moves, with the right ROBOT"
        )
    if robot is None:
        name = _by_walls(seen_there, loaded)
    timed = not video.images or fps is not None
    rests = Path(name).resolve() if target is not None and Path(name).is_file() else None
    stated = name if rests is None or target is None else _relative_to_setup(rests, target)
    findings = tuple(_findings(video, seen_there, loaded, name, apart, timed=timed, given=robot is not None))
    found = {finding.field: _toml(finding) for finding in findings if finding.field and finding.value is not None}
    if seen_there.known is not None or robot is not None:
        found["robot.file"] = toml_value(stated), "as asked for" if robot is not None else _doubt(findings, "walls")
    found |= _scale_lines(seen_there, loaded, apart)
    ruled = "markers.length_per_pixel" not in found
    open_fields = {
        field: words for field, words in KNOWN.items() if field not in found and (ruled or "markers" not in field)
    }
    text = setup_text(found, open_fields)
    if target is not None:
        new_file(target, text, overwrite=overwrite)
    warnings = tuple(_warnings(video, seen_there, findings, apart))
    file = None if target is None else str(target)
    return Proposal(video.name, video.size, name, findings, tuple(open_fields.items()), text, file, warnings)


def _relative_to_setup(file: Path, target: Path) -> str:
    """A robot file as the setup file names it: relative to its own folder, if it is inside."""
    folder = target.resolve().parent
    return file.relative_to(folder).as_posix() if file.is_relative_to(folder) else file.as_posix()


def _by_walls(found: SetupFreeDetection, robot: Robot) -> str:
    """The paper's robot whose channel is nearest to the walls; the first one where no walls were found."""
    if found.walls is None:
        return PAPER_ROBOTS[0]
    width = found.walls.distance * robot.body.diameter / _OUTER
    channels = {name: channel.diameter for name in PAPER_ROBOTS if (channel := load(name).channel) is not None}
    return min(channels, key=lambda name: abs(math.log(channels[name] / width)))


def _findings(
    video: Video, found: SetupFreeDetection, robot: Robot, name: str, spacing: float | None, *, timed: bool, given: bool
) -> Iterator[Finding]:
    yield _frame_rate(video, timed=timed)
    yield _ruler(found, spacing)
    known = found.known
    if known is None:
        words = (
            f"no robot like '{robot.name}' was found at any scale: give the right ROBOT, or a film in which all of it "
            "is in view and moves"
        )
        words += "" if spacing is None else f", or check spacing = {1e3 * spacing:.4g} mm"
        yield Finding("robot", None, "", "not found", words)
        return
    sure = known.wire.readable > IDENTITY.sure_share
    striped = bool(found.stripes)
    optics = found.optics
    half = 0.5 * robot.body.length
    ends = np.array([[-half, 0.0, 0.0], [half, 0.0, 0.0]])
    pose = known.start.path[0][1]
    rear, nose = project(ends, pose, optics).tolist()
    long = math.dist(rear, nose)
    words = (
        f"a body {long:.0f} pixels long on {len(known.start.path)} of {len(found.frames)} frames; its tail is seen on "
        f"{100 * known.wire.readable:.0f} % of them"
    )
    yield Finding(
        "robot", robot.name if given else name, "", "clear" if sure or striped else "doubtful", words,
        pixels=((tuple(rear), tuple(nose)),),
    )  # fmt: skip
    behind = "its tail is seen behind it" if sure else "a guess, for its tail is hardly seen behind it"
    towards = found.direction if found.direction in ("up", "down") else f"to the {found.direction}"
    yield Finding(
        "direction", found.direction, "", "clear" if sure else "doubtful",
        f"the nose points {towards}: {behind}", "robot.direction",
        ((tuple(rear), tuple(nose)),),
    )  # fmt: skip
    yield _travel(found)
    yield _appearance(found)
    yield _stripes(found)
    yield _walls(found, robot)


def _frame_rate(video: Video, *, timed: bool) -> Finding:
    rate = video.rate
    if not timed or rate is None:
        words = "a folder of images does not say how many frames a second it has"
        return Finding("frame_rate", None, "1/s", "not found", words)
    own = "as it was given" if video.given_rate else "as the file states it; the times of its frames are used"
    field = "camera.frames_per_second" if video.given_rate else ""
    return Finding("frame_rate", rate, "1/s", "clear", f"{rate:.4g} frames a second, {own}", field)


def _ruler(found: SetupFreeDetection, spacing: float | None) -> Finding:
    lines = found.lines
    if lines is None:
        words = "no equally spaced lines across the picture's rows"
        return Finding("ruler", None, "pixel", "not found", words)
    strips = []
    for label in np.unique(lines.strip):
        inside = lines.pixels[lines.strip == label]
        order = np.argsort(inside[:, 0])
        edge = max(1, len(order) // 20)
        first, last = inside[order[:edge]].mean(axis=0), inside[order[-edge:]].mean(axis=0)
        strips.append(((float(first[0]), float(first[1])), (float(last[0]), float(last[1]))))
    roll = math.degrees(lines.roll)
    words = f"{lines.lines} lines or more, {lines.distance:.2f} pixels apart"
    words += f"; the channel runs at {abs(roll):.1f} deg to the rows" if abs(roll) > 0.5 else ""
    words += "" if spacing is not None else "; how far apart they are in mm, you know"
    return Finding("ruler", lines.distance, "pixel", "clear", words, pixels=tuple(strips))


def _travel(found: SetupFreeDetection) -> Finding:
    speed = found.speed
    if abs(speed) < _AT_REST:
        return Finding("travel", speed, "pixel/s", "doubtful", "the robot hardly moves")
    where = "nose first" if speed > 0 else "tail first, against its nose"
    words = f"it moves {where}, at {abs(speed):.2g} pixels a second"
    return Finding("travel", speed, "pixel/s", "clear" if speed > 0 else "doubtful", words)


def _appearance(found: SetupFreeDetection) -> Finding:
    appearance = found.appearance
    if appearance == "unknown":
        words = "the picture does not tell whether the body's cover is opaque or glass"
        return Finding("appearance", None, "", "not found", words)
    why = "of one brightness up to its rim" if appearance == "opaque" else "a bright rim, or contents, show through it"
    return Finding(
        "appearance", appearance, "", "doubtful", f"the body's cover looks {appearance}: {why}", "robot.appearance"
    )


def _stripes(found: SetupFreeDetection) -> Finding:
    assert found.known is not None  # noqa: S101 - called where it is known
    stated = found.known.stripes.stripes
    if not stated:
        words = "the robot file names no stripes: without them the body's rotation cannot be seen"
        return Finding("stripes", None, "", "not found", words)
    if not found.stripes:
        words = f"the seal does not show {', '.join(stated)} in any one order: name the colours as they are painted"
        return Finding("stripes", None, "", "not found", words)
    order = ", ".join(found.stripes)
    if found.stripes == stated:
        return Finding("stripes", list(stated), "", "clear", f"as the robot file names them: {order}")
    words = f"another order than in the robot file is seen: {order}"
    return Finding("stripes", list(found.stripes), "", "doubtful", words, "robot.stripes")


def _walls(found: SetupFreeDetection, robot: Robot) -> Finding:
    walls = found.walls
    if walls is None:
        words = "no edges along the channel were found on both sides of the robot"
        return Finding("walls", None, "m", "not found", words)
    width = walls.distance * robot.body.diameter
    words = (
        f"edges along the channel {1e3 * width:.3g} mm apart by the robot's own diameter, as a rule the outer sides of "
        f"the glass (bore some {1e3 * width / _OUTER:.3g} mm): depth and refraction may change this by a quarter, "
        "measure the bore"
    )
    ends = tuple(tuple((float(u), float(v)) for u, v in line) for line in walls.ends)
    confidence: Confidence = "clear" if walls.contrast > 2.0 * SETUP_FREE.clear else "doubtful"
    return Finding("walls", width, "m", confidence, words, pixels=ends)


def _toml(finding: Finding) -> tuple[str, str]:
    """A finding's value as written in the file, and the comment beside it."""
    value = finding.value
    text = f"{value:.9g}" if isinstance(value, float) else toml_value(value)
    return text, f"found in the film, {finding.confidence}"


def _doubt(findings: tuple[Finding, ...], name: str) -> str:
    """Comment on the preset that was taken."""
    walls = next((finding for finding in findings if finding.name == name), None)
    if walls is None or walls.value is None:
        return "CHECK: the paper's robot was found; which channel it is in, the film does not tell"
    return f"CHECK: the paper's robot was found; its channel by the walls, {walls.confidence}"


def _scale_lines(found: SetupFreeDetection, robot: Robot, spacing: float | None) -> dict[str, tuple[str, str]]:
    """The spacing, where it is known; without a ruler the scale by the robot's own size."""
    if spacing is not None and (found.lines is not None or found.known is None):
        return {"markers.spacing": (f'"{1e3 * spacing:.9g} mm"', "as given")}
    if found.lines is not None or found.known is None:
        return {}
    pixel = found.optics.length_per_pixel
    half = 0.5 * robot.body.length / pixel
    share = math.hypot(SIZE.build_error, SIZE.edge_error / half)
    found_by = f'"{1e3 * pixel:.6g} mm"', "CHECK: no ruler was found; by the body's length"
    unsure = f'"{1e3 * share * pixel:.3g} mm"', "by how well it was built and seen"
    return {"markers.length_per_pixel": found_by, "markers.length_per_pixel_uncertainty": unsure}


def _warnings(
    video: Video, found: SetupFreeDetection, findings: tuple[Finding, ...], spacing: float | None
) -> Iterator[Note]:
    yield from (flag.note for flag in video.flags)
    unsure = ("robot", "direction", "ruler")
    yield from (
        Note("setup-incomplete", one.sentence, (one.name,))
        for one in findings
        if one.name in unsure and one.confidence != "clear"
    )
    if found.known is None:
        return
    lines = found.lines
    if lines is not None and spacing is not None:
        apart = lines.distance * found.optics.length_per_pixel
        if not _SPACING[0] < spacing / apart < _SPACING[1]:
            words = (
                f"spacing = {1e3 * spacing:.4g} mm does not fit: by the robot's size the lines are {1e3 * apart:.2g} "
                "mm apart; check the spacing, or the robot file"
            )
            yield Note("setup-incomplete", words, ("markers.spacing",))
    frames = [frame.small(found.reduction) for frame in found.frames]
    flags = camera_flags(frames, found.known.start, ruled=lines is not None)
    yield from (flag.note for flag in (*flags, *found.known.wire.flags))
