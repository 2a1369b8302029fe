"""The command `spirillum remote`."""

from __future__ import annotations

from typing import Annotated

import typer

from spirillum.cli.shared_options import Json


def remote(
    port: Annotated[str, typer.Argument(help="Serial port of the remote, such as /dev/ttyUSB0 or COM3.")],
    duty: Annotated[float, typer.Option(help="Duty of the motor, 0 to 1.")] = 1.0,
    duration: Annotated[str, typer.Option(metavar="TIME", help="How long it is on, such as 2s.")] = "1s",
    baud: Annotated[int, typer.Option(help="Symbols a second.")] = 115_200,
    json: Json = False,
) -> None:
    """Switch a real motor on for a time, through a remote at a serial port. Needs the extra `control`.

    Example: `spirillum remote /dev/ttyUSB0 --duty 0.5 --duration 2s`
    """
    from spirillum.cli import renderer
    from spirillum.interfaces.serial_remote import remote as answer

    renderer.show(answer(port, duty=duty, duration=duration, baud=baud).to_dict(), json=json)
