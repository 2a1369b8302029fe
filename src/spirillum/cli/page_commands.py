"""The command `spirillum page`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spirillum.cli.inputs import loaded_robot
from spirillum.cli.shared_options import Settings, complete_robots
from spirillum.errors import InputError


def page(
    robot: Annotated[
        str | None,
        typer.Argument(
            autocompletion=complete_robots,
            help="A preset's name or a robot file (TOML); else that of --run, or biorob2012-wide.",
        ),
    ] = None,
    run: Annotated[
        Path | None, typer.Option(metavar="FILE", help="A run (NetCDF) to replay, written by `spirillum simulate`.")
    ] = None,
    port: Annotated[int, typer.Option(help="Port to listen on; 0: a free one.")] = 0,
    host: Annotated[
        str, typer.Option(help="Address to listen on; any but the loopback is open to the network.")
    ] = "127.0.0.1",
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Print the address, open no browser.")] = False,
    settings: Settings = None,
) -> None:
    """Show a robot alive in the browser: it swims, its knobs turn, its numbers follow. Needs the extra `page`.

    Example: `spirillum page biorob2012-wide`
    """
    from spirillum.pages.launch import page as answer

    if robot is None and settings:
        raise InputError(f"set = {settings[0]} without a robot; allowed: with a preset's name or a robot file")
    source = loaded_robot(robot, settings) if robot and settings else robot
    answer(source, run=run, host=host, port=port, browser=not no_browser, tell=typer.echo)
