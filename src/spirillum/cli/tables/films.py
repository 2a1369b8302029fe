"""Rendered videos, films, pictures and recordings."""

from __future__ import annotations

from rich.markup import escape

from spirillum.cli.tables.parts import Answer, Blocks, grid, quantity_grid, reason_of
from spirillum.units import in_unit


def virtual_experiment(answer: Answer) -> Blocks:
    """Where the videos are, and the rates of their robots."""
    kept = f", {answer['kept']} of them there before" if answer["kept"] else ""
    videos = answer["trials"] * len(answer["robots"])
    yield f"{answer['folder']}: synthetic, {videos} videos{kept}; truth in {answer['observations']}"
    title = f"without the planted spread of {100 * answer['spread']:g} %"
    rows = grid(title, "robot", "forward velocity (mm/s)", "tail rate (Hz)", "body rate (Hz)")
    names = {"forward_velocity": "mm/s", "tail_rotation_rate": "Hz", "body_rotation_rate": "Hz"}
    for robot in answer["robots"]:
        cells = [in_unit(robot[name]["value"], robot[name]["unit"], unit) for name, unit in names.items()]
        rows.add_row(escape(robot["robot"]), *cells)
    yield rows


def virtual_trial(answer: Answer) -> Blocks:
    """The video of `render`, and its true motion."""
    lost = f", {answer['dropped']} lost" if answer["dropped"] else ""
    size = f"{answer['width']}x{answer['height']} pixels, {answer['frames_per_second']:g} frames a second"
    said = f"{answer['frames']} frames{lost}, {size}; setup and truth beside it"
    yield f"{answer['video']}: synthetic, {said}"
    names = ("forward_velocity", "tail_rotation_rate", "body_rotation_rate", "motor_rotation_rate")
    true = {name: answer[name] for name in names}
    motion = f", {answer['motion']}" if answer["motion"] in ("held", "trial") else ""
    yield quantity_grid(f"{answer['robot']}: true motion, {answer['model']}{motion}", true)
    yield from reason_of(answer)


def film(answer: Answer) -> Blocks:
    """Text of `film`."""
    size, fps = f"{answer['width']}x{answer['height']} pixels", answer["frames_per_second"]
    length = f"{answer['duration']['value']:.3g} s at {fps} frames a second, speed x{answer['speed']:g}"
    yield f"{answer['file']}: {answer['robot']}, {answer['frames']} frames of {size}, {length}"


def show(answer: Answer) -> Blocks:
    """Text of `show`."""
    where = "shown in a window" if answer["file"] is None else answer["file"]
    yield f"{where}: {answer['robot']}, {answer['width']}x{answer['height']} pixels, view {answer['view']}"


def recording(answer: Answer) -> Blocks:
    """The file, then its topics."""
    yield f"{answer['file']}: a recording for Foxglove, {answer['robot']}, {answer['duration']['value']:.3g} s"
    rows = grid("topics", "topic", "messages")
    for topic, count in answer["topics"].items():
        rows.add_row(topic, str(count))
    yield rows
