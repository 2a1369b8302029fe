"""The command `spirillum remote`."""

from __future__ import annotations

from typing import Annotated

import typer

from spirillum.cli.function_command import Request, from_function
from spirillum.cli.shared_options import Json


@from_function("spirillum.interfaces.serial_remote:remote", robot=None)
def remote(
    request: Request,
    *,
    port: Annotated[str, typer.Argument(help="Serial port of the remote, such as /dev/ttyUSB0 or COM3.")],
    json: Json = False,
) -> None:
    """Switch a real motor on for a time, through a remote at a serial port. Needs the extra `control`.

    Example: `spirillum remote /dev/ttyUSB0 --duty 0.5 --duration 2s`
    """
    from spirillum.cli import renderer

    renderer.show(request(port).to_dict(), json=json)
