"""The command `spirillum track`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from spirillum.cli.inputs import overrides_from
from spirillum.cli.shared_options import Json, Settings, starting

if TYPE_CHECKING:
    from spirillum.live.observation import Observation
    from spirillum.live.tracking_summary import Tracked


def _complete_paces(incomplete: str) -> list[str]:
    return starting(("fast", "real"), incomplete)


def track(
    source: Annotated[
        str,
        typer.Argument(metavar="SOURCE", help="A film, camera:0, or the address of a stream (rtsp://, ...)."),
    ],
    setup: Annotated[Path | None, typer.Option(metavar="FILE", help="Setup file (TOML); see `setup new`.")] = None,
    pace: Annotated[
        str,
        typer.Option(autocompletion=_complete_paces, help="real: as pictures come; fast: a film, as fast as it goes."),
    ] = "real",
    size: Annotated[str | None, typer.Option(metavar="WIDTHxHEIGHT", help="Pixels that a camera is asked for.")] = None,
    fps: Annotated[float | None, typer.Option(help="Frames a second that a camera is asked for.")] = None,
    learn: Annotated[str, typer.Option(metavar="TIME", help="Time from which the robot's look is learnt.")] = "3s",
    window: Annotated[str, typer.Option(metavar="TIME", help="Time over which each frame's rates are taken.")] = "2s",
    learn_from: Annotated[
        Path | None,
        typer.Option(
            metavar="FILM", help="Learn from this video of the same robot and camera, then track from the first frame."
        ),
    ] = None,
    udp: Annotated[
        str | None,
        typer.Option(metavar="[HOST:]PORT", help="Send the lines as datagrams; without a host, to this computer."),
    ] = None,
    duration: Annotated[
        str | None, typer.Option(metavar="TIME", help="End after this time; else with the source.")
    ] = None,
    settings: Settings = None,
    json: Json = False,
) -> None:
    """Track a robot live: a JSON line for every frame, and a last one for all of them.

    With --udp the lines go out as datagrams, and the terminal shows the end alone.

    Example: `spirillum track camera:0 --setup setup.toml --size 640x480 --fps 30`
    """
    from spirillum.cli import renderer
    from spirillum.errors import InputError
    from spirillum.live.sending import line_of
    from spirillum.live.session import observation_line
    from spirillum.live.session import track as answer

    if setup is None:
        raise InputError("--setup is missing; allowed: a setup file, see `spirillum setup new`")

    def say(said: Observation, latency: float | None) -> None:
        typer.echo(line_of(observation_line(said, latency)))

    result = answer(
        source,
        setup,
        pace=pace,
        size=None if size is None else _size(size),
        fps=fps,
        learn=learn,
        window=window,
        learn_from=learn_from,
        udp=udp,
        duration=duration,
        overrides=overrides_from(settings),
        on_observation=say if udp is None else None,
    )
    if udp is None:
        typer.echo(line_of(result.to_dict()))
    else:
        renderer.show(result.to_dict(), json=json)
    _end(result, source)


def _end(result: Tracked, source: str) -> None:
    """Leave with the exit code of how it ended."""
    from spirillum.errors import InputError
    from spirillum.measurement.trials import RATE_NAMES

    if result.interrupted:
        raise KeyboardInterrupt
    if result.stopped:
        raise InputError(result.stopped)
    if result.trial is not None:
        rates = [result.trial.quantities[name] for name in RATE_NAMES]
        if all(rate.value != rate.value for rate in rates):
            slow = result.pace == "real" and Path(source).exists() and result.dropped > result.tracked
            hint = "; most frames passed while the robot was learnt: --pace fast looks at all of them" if slow else ""
            raise InputError(f"{result.source}: no rate could be given: {rates[0].reason}{hint}")


def _size(word: str) -> tuple[int, int]:
    from spirillum.errors import InputError

    parts = word.lower().split("x")
    if len(parts) != 2 or not all(part.isascii() and part.isdigit() and 1 <= len(part) <= 5 for part in parts):
        raise InputError(f"size = {word[:40]!r}; allowed: WIDTHxHEIGHT in pixels, for example 640x480")
    return int(parts[0]), int(parts[1])
