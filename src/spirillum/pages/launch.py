"""`spirillum.page`: start the server, open the browser, end cleanly."""

from __future__ import annotations

import ipaddress
import re
import socket
import webbrowser
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from threading import Timer
from typing import TYPE_CHECKING, Any

from spirillum.argument_validation import validate_arguments
from spirillum.errors import InputError, clipped
from spirillum.optional_dependencies import import_optional
from spirillum.robot.load import load
from spirillum.robot.robot import Robot

if TYPE_CHECKING:
    import xarray as xr

_LARGEST_PORT = 65_535
_LABEL = "[a-z0-9_]([a-z0-9_-]{0,61}[a-z0-9_])?"
_HOST_NAME = re.compile(rf"(?=.{{1,253}}$)({_LABEL}\.)*{_LABEL}\.?", re.IGNORECASE)


@validate_arguments
def page(
    robot: str | Path | Mapping[str, Any] | Robot | None = None,
    *,
    run: xr.Dataset | str | Path | None = None,
    host: str = "127.0.0.1",
    port: int = 0,
    browser: bool = True,
    tell: Callable[[str], None] = print,
) -> None:
    """Show a robot alive in the browser: it swims, with a control for each field. Ends with Ctrl-C.

    Needs the extra `page`. Everything stays on this machine: nothing is loaded from elsewhere.

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot; None: that of the run, else the preset
            biorob2012-wide.
        run: a run of `spirillum.simulate` to replay, or the file with it.
        host: address to listen on; any other than the loopback lets others on the network in.
        port: port to listen on; 0: a free one.
        browser: open the page in the browser.
        tell: called with the page's address, which holds the key.

    Raises:
        InputError: for a robot or run that cannot be shown, a host that is none, a port that is taken, or a missing
            extra.
    """
    if not _is_host(host):
        raise InputError(f"host = {clipped(host)}; allowed: the name of a host, or an address such as 127.0.0.1")
    for name in ("starlette", "uvicorn", "websockets"):
        import_optional(name, "the page", "page")
    if not 0 <= port <= _LARGEST_PORT:
        raise InputError(f"port = {port}; allowed: 0 (a free one) to {_LARGEST_PORT}")
    import uvicorn

    from spirillum.pages.guard import Guard, Strangers, is_loopback, protocol_for
    from spirillum.pages.server import application

    listening = _listening(host, port)
    with listening:
        number = int(listening.getsockname()[1])
        guard = Guard(host, number)
        own, first_run = ("biorob2012-wide", None) if run is None else _replay(run)
        strangers, first = Strangers(), own if robot is None else robot
        load(first).check_body("the page", "; `show` and `flow` draw this one")
        app = application(first, guard, strangers=strangers, first_run=first_run)
        shown = f"[{host}]" if ":" in host else host
        if host in ("0.0.0.0", "::"):  # noqa: S104 - requested, and announced
            shown = socket.gethostname()
        address = f"http://{shown}:{number}/?key={guard.key}"
        with suppress(KeyboardInterrupt):  # Ctrl-C is how it ends
            if not is_loopback(host):
                tell(
                    f"listening on {host}, not on this machine alone: whoever can reach it and has the address below "
                    "can use the page; nothing is encrypted, so that others on the network may read the address"
                )
            tell(f"The page is at {address}\nCtrl-C ends it.")
            if browser:
                opening = Timer(0.1, webbrowser.open, [address])
                opening.daemon = True
                opening.start()
            config = uvicorn.Config(
                app,
                http=protocol_for(strangers),
                log_level="critical",  # malformed requests are not for the terminal; the application prints its faults
                ws="websockets-sansio",
                ws_max_size=1 << 16,
                ws_per_message_deflate=False,
                timeout_graceful_shutdown=1,
                server_header=False,
                access_log=False,
            )
            uvicorn.Server(config).run(sockets=[listening])


def _is_host(host: str) -> bool:
    """Whether it is an address as it is usually written, or can be the name of a host."""
    # What the system alone reads as an address is neither: an empty text, ``0`` and ``<broadcast>`` would let the whole
    # network in.
    with suppress(ValueError):
        ipaddress.ip_address(host)
        return True
    with suppress(OSError, ValueError):
        socket.inet_aton(host)
        return False
    return _HOST_NAME.fullmatch(host) is not None


def _listening(host: str, port: int) -> socket.socket:
    found = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_STREAM)
    try:
        found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        found.bind((host, port))
        found.listen(128)
    except (OSError, UnicodeError) as error:
        found.close()
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(
            f"host = {host[:80]!r} with port = {port}: {reason}; allowed: an address of this machine with a free port"
        ) from error
    return found


def _replay(run: xr.Dataset | str | Path) -> tuple[Robot, dict[str, Any]]:
    from spirillum.dynamics.run_file import open_run, robot_of
    from spirillum.pages.replay import replay_of_run

    dataset = open_run(run) if isinstance(run, (str, Path)) else run
    return robot_of(dataset), replay_of_run(dataset)
