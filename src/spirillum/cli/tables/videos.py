"""Videos, measured and rendered, pictures, recordings and setups."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from rich.markup import escape

from spirillum.cli.tables.parts import (
    Answer,
    Blocks,
    Detail,
    cell,
    grid,
    in_words,
    quantity_grid,
    reason_of,
    sentences_of,
)
from spirillum.display import percent
from spirillum.measurement.statistics import measured_rows
from spirillum.measurement.trials import MEASURED, RATE_NAMES
from spirillum.units import for_people, shown_in


def virtual_experiment(answer: Answer) -> Blocks:
    """Where the videos are, and the rates of their robots."""
    kept = f", {answer['kept']} of them there before" if answer["kept"] else ""
    videos = answer["trials"] * len(answer["robots"])
    yield f"{answer['folder']}: synthetic, {videos} videos{kept}; truth in {answer['observations']}"
    title = f"without the planted spread of {100 * answer['spread']:g} %"
    heads = ("robot", "forward velocity (mm/s)", "tail rate (Hz)", "body rate (Hz)")
    units = {"forward_velocity": "mm/s", "tail_rotation_rate": "Hz", "body_rotation_rate": "Hz"}
    robots = [(escape(one["robot"]), *(cell(one[name], units[name]) for name in units)) for one in answer["robots"]]
    yield grid(title, *heads, rows=robots)
    yield from dict.fromkeys(line for robot in answer["robots"] for line in reason_of(robot))


def virtual_trial(answer: Answer) -> Blocks:
    """The video of `render`, and its true motion."""
    lost = f", {answer['dropped']} lost" if answer["dropped"] else ""
    size = f"{answer['width']}x{answer['height']} pixels, {answer['frames_per_second']:g} frames a second"
    details = f"{answer['frames']} frames{lost}, {size}; setup and truth beside it"
    yield f"{answer['video']}: synthetic, {details}"
    names = ("forward_velocity", "tail_rotation_rate", "body_rotation_rate", "motor_rotation_rate")
    true = {name: answer[name] for name in names}
    motion = f", {answer['motion']}" if answer["motion"] in ("held", "trial") else ""
    yield quantity_grid(f"{answer['robot']}: true motion, {answer['model']}{motion}", true)
    yield from filter(None, [answer.get("assumption")])
    yield from sentences_of(answer, "slow-film")
    yield from reason_of(answer)


def film(answer: Answer) -> Blocks:
    """Text of `film`."""
    size, fps = f"{answer['width']}x{answer['height']} pixels", answer["frames_per_second"]
    length = f"{answer['duration']['value']:.3g} s at {fps} frames a second, speed x{answer['speed']:g}"
    yield f"{answer['file']}: {answer['robot']}, {answer['frames']} frames of {size}, {length}"
    yield from filter(None, [answer.get("assumption")])
    yield from sentences_of(answer, "slow-film")


def show(answer: Answer) -> Blocks:
    """Text of `show`."""
    where = "shown in a window" if answer["file"] is None else answer["file"]
    yield f"{where}: {answer['robot']}, {answer['width']}x{answer['height']} pixels, view {answer['view']}"


def recording(answer: Answer) -> Blocks:
    """The file, then its topics."""
    yield f"{answer['file']}: a recording for Foxglove, {answer['robot']}, {answer['duration']['value']:.3g} s"
    yield grid("topics", "topic", "messages", rows=((topic, str(count)) for topic, count in answer["topics"].items()))


def measurement(answer: Answer) -> Blocks:
    """Each trial of `measure`, and the means over them; one trial has one table."""
    trials, summary = answer["trials"], answer["summary"]
    several = len(trials) > 1
    if several:
        table = grid(f"{answer['robot']}: {len(trials)} trials", "trial", "quantity", "value", "low", "high", "unit")
        for trial in trials:
            for number, cells in enumerate(_cells(trial, RATE_NAMES)):
                table.add_row("" if number else escape(trial["name"]), *cells[:5])
        yield table
    title = "means over trials" if several else f"{answer['robot']}: {trials[0]['name']}"
    rows = grid(title, "quantity", "value", "low", "high", "unit", *(["trials"] if several else []))
    for cells in _cells(summary, (n for n in MEASURED if n in RATE_NAMES or summary[n]["value"] is not None)):
        rows.add_row(*(cells[:6] if several else cells[:5]))
    yield rows
    if summary["lateral_position"]["value"] is not None:
        shift = in_words(answer["lateral_shift_of_a_degree"])
        yield f"lateral position: of a level camera; a tilt of one degree, in no interval, moves it by {shift}"
    yield from _intervals(answer, several=several)
    if answer["files"]:
        listed = [name for name in answer["files"] if not name.startswith("figures/")]
        yield f"{len(answer['files'])} files, among them {', '.join(listed[-3:])}"


def _intervals(answer: Answer, *, several: bool) -> Iterator[Detail]:
    """What the intervals are, and why there is none where there is none."""
    scale = 100 * answer["summary"]["scale_uncertainty"]
    known = [
        (name.replace("_", " "), item)
        for items in (answer["summary"], *answer["trials"])
        for name, item in items.items()
        if name in MEASURED and item["value"] is not None
    ]
    if any("low" in item for _, item in known):
        words = "Student's t over trials" if several else "from the trial's own residuals"
        share = f"; the scale's standard uncertainty of {scale:.2g} % is in lengths whole" if scale else ""
        yield Detail(f"low and high: 95 % interval, {words}{share}")
    for reason in sorted({item["reason"] for _, item in known if "low" not in item}):
        names = dict.fromkeys(name for name, item in known if item.get("reason") == reason)
        yield Detail(f"no interval of {', '.join(names)}: {reason}")


def _cells(answer: Answer, names: Iterable[str]) -> Iterator[list[str]]:
    return (list(row.values()) for row in measured_rows(answer, names))


def feasibility(answer: Answer) -> Blocks:
    """Expected rates, checks and intervals of `measure --feasibility`."""
    expected = [(name, item, for_people(item["unit"])) for name, item in answer["expected"].items()]
    cells = ((name.replace("_", " "), cell(item, unit), unit, item["source"]) for name, item, unit in expected)
    yield grid(f"{answer['robot']}: expected", "quantity", "value", "unit", "from", rows=cells)
    yield from (f"{'yes' if check['passed'] else 'NO':<4} {check['sentence']}" for check in answer["checks"])
    if answer["intervals"]:
        span = f"{answer['time_measured']['value']:.4g} s"
        rows = grid(f"expected 95 % interval of one trial, {span} long", "quantity", "half width", "unit", "share")
        for name, item in answer["intervals"].items():
            reach = item["half_width"]
            unit = for_people(reach["unit"])
            share = "-" if item["share"] is None else percent(item["share"])
            rows.add_row(name.replace("_", " "), f"{shown_in(reach['value'], unit):.2g}", unit, share)
        yield rows
        yield Detail(f"basis: {answer['basis']}")
    words = _scale_sources(answer)
    yield f"standard uncertainty of lengths: {percent(answer['scale_uncertainty'])}{f' ({words})' if words else ''}"
    yield f"verdict: {'all rates can be resolved' if answer['feasible'] else 'not all rates can be resolved'}"


def _scale_sources(answer: Answer) -> str:
    """Shares of the uncertainty of lengths, the largest first."""
    parts = sorted(answer["scale_sources"].items(), key=lambda item: -item[1])
    return ", ".join(f"{name} {percent(share)}" for name, share in parts)


def setup_check(answer: Answer) -> Blocks:
    """Text of `setup check`."""
    yield f"{answer['file']}: valid, robot {answer['robot']}"
    words, total = _scale_sources(answer), percent(answer["scale_uncertainty"])
    yield f"standard uncertainty of lengths from heights and scale: {total}{': ' + words if words else ''}"
    if (video := answer.get("film")) is not None:
        pixel, size = video["length_per_pixel"]["value"], video["apparent_body_size"]
        ruler = f"{video['markers']} lines of the ruler" if video["markers"] else "no ruler"
        stripes = "its stripes fit" if video["stripes_fit"] else "its stripes do not fit"
        yield (
            f"{video['name']}: robot on {video['frames_with_robot']} of {video['frames']} frames looked at, {size:.3f} "
            f"times as large as its file says; {stripes}, tail read on {100 * video['tail_readable']:.0f} %; {ruler}, "
            f"{1e3 * pixel:.4g} mm a pixel"
        )


def setup_proposal(answer: Answer) -> Blocks:
    """What `setup propose` found and how sure it is, then what is left to be filled in."""
    rows = ((one["name"].replace("_", " "), one["confidence"], one["sentence"]) for one in answer["findings"])
    yield grid(f"{answer['film']}: what it shows", "what", "sure", "seen", rows=rows)
    if answer["file"] is not None:
        fields = ", ".join(item["field"] for item in answer["to_fill"])
        yield f"{answer['file']}: fill in what you know: {fields}"


def track(answer: Answer) -> Blocks:
    """Speed and rates over all frames of `track`, and its latency."""
    if "forward_velocity" in answer:
        rows = (cells[:5] for cells in _cells(answer, RATE_NAMES))
        yield grid(f"{answer['source']}: all frames", "quantity", "value", "low", "high", "unit", rows=rows)
    seen = f"robot seen on {answer['frames_tracked']} of {answer['frames']} frames, {answer['frames_dropped']} dropped"
    latency = answer["latency"]
    if latency["median"]["value"] is not None:
        median, high = (1e3 * latency[name]["value"] for name in ("median", "percentile_95"))
        seen += f"; latency {median:.1f} ms, 95th percentile {high:.1f} ms"
    yield seen
