"""Server: fixed routes, one websocket, and the guard before both. No client data names a file."""

from __future__ import annotations

import asyncio
import json
import traceback
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from functools import partial
from typing import Any

from starlette.applications import Starlette
from starlette.datastructures import Headers
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from spirillum.errors import InputError
from spirillum.pages.guard import HEADERS, LARGEST_MESSAGE, Guard, MessageRate, Strangers
from spirillum.pages.job import run_in_background
from spirillum.pages.measurement_routes import session_routes
from spirillum.pages.measurement_session import MeasurementSession
from spirillum.pages.replay import (
    LARGEST_RUN,
    MODULES,
    asset,
    command_line,
    python_lines,
    replay_of_swimmer,
    replay_of_upload,
    replay_page,
    robot_file,
)
from spirillum.pages.simulation_thread import SimulationThread
from spirillum.pages.study_picture import LARGEST_STUDY_SENT, StudyPicture, sent_study
from spirillum.pages.video_store import TooLargeError, Uploads

_MOST_CLIENTS = 32
_MOST_REFUSALS = 20
_EACH_SECOND, _AT_ONCE = 80.0, 160.0
_TYPES = {"html": "text/html", "css": "text/css", "js": "text/javascript", "svg": "image/svg+xml"}
_OWN = ("page.css", "main.js", "knobs.js", "numbers.js", "measure.js", "study.js", "pointing.js", "icon.svg", *MODULES)
"""Files of the page; no others are served."""
_MISSING = "the key is missing: open the address that `spirillum page` has printed"


class _Guarded:
    """The guard around the application."""

    def __init__(self, app: ASGIApp, guard: Guard, strangers: Strangers) -> None:
        self._app, self._guard, self._strangers = app, guard, strangers

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._answer(scope, receive, send)
            return
        key = self._guard.key
        refused = self._refused(scope)
        if not refused:
            self._strangers.admit(scope.get("client"))
            await self._answer({**scope, "root_path": f"/{key}"}, receive, _with_headers(send))
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008, "reason": refused})
        elif refused == _MISSING and self._is_printed_address(scope):
            await RedirectResponse(f"/{key}/", status_code=303, headers=dict(HEADERS))(scope, receive, send)
        else:
            await PlainTextResponse(f"{refused}\n", status_code=403, headers=dict(HEADERS))(scope, receive, send)

    async def _answer(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request; print a fault of the program, since the server's own log holds malformed requests too."""
        try:
            await self._app(scope, receive, send)
        except Exception:
            traceback.print_exc()
            raise

    def _refused(self, scope: Scope) -> str:
        """Why a request is refused; empty for one that is not."""
        headers, guard = Headers(scope=scope), self._guard
        host, origin = headers.get("host", ""), headers.get("origin")
        if not guard.is_own_host(host):
            return "this server is not the requested host"
        if origin is not None and origin != f"http://{host}":
            return "another page has no business here"
        if origin is None and (scope["type"] == "websocket" or scope["method"] not in ("GET", "HEAD")):
            return "a request without its origin"
        before, _, after = scope["path"].partition("/")  # which the key begins
        return _MISSING if before or not guard.right_key(after.partition("/")[0]) else ""

    def _is_printed_address(self, scope: Scope) -> bool:
        """Whether a request is for the address that `page` prints, `/?key=...`."""
        own = scope["path"] == "/" and scope["method"] == "GET"
        return own and self._guard.right_key(Request(scope).query_params.get("key", ""))


def _with_headers(send: Send) -> Send:
    async def sending(message: Any) -> None:
        if message["type"] == "http.response.start":
            own = [(name.lower().encode(), value.encode()) for name, value in HEADERS.items()]
            message = {**message, "headers": [*message.get("headers", []), *own]}
        await send(message)

    return sending


class _Client:
    """One tab: receives the newest state, and refusals of its commands."""

    def __init__(self) -> None:
        self.news = asyncio.Event()
        self.refusals: list[str] = []
        self.version = -1
        self.looks = True


class _House:
    """Simulation thread and its clients."""

    def __init__(self, source: Any) -> None:
        self.simulation = SimulationThread(source, self._publish)
        self.session = MeasurementSession()
        self._clients: set[_Client] = set()
        self._loop: asyncio.AbstractEventLoop | None = None

    @asynccontextmanager
    async def open(self, _app: Starlette) -> AsyncIterator[None]:
        """From the first request to the last."""
        self._loop = asyncio.get_running_loop()
        self.simulation.start()
        try:
            yield
        finally:
            self.simulation.stop()
            self.session.close()

    def _publish(self) -> None:
        """There is something new; called from the thread of the simulation."""
        if self._loop is not None and not self._loop.is_closed():
            with suppress(RuntimeError):  # the loop ends while the thread still tells
                self._loop.call_soon_threadsafe(self._wake)

    def _wake(self) -> None:
        for client in self._clients:
            client.news.set()

    def _count_those_who_look(self) -> None:
        self.simulation.look(any(client.looks for client in self._clients))

    async def connect(self, socket: WebSocket) -> None:
        """One tab, as long as it is open."""
        if len(self._clients) >= _MOST_CLIENTS:
            await socket.close(1013, "too many tabs")
            return
        await socket.accept()
        client = _Client()
        self._clients.add(client)
        self._count_those_who_look()
        sender = asyncio.create_task(_tell(socket, client, self.simulation))
        try:
            await self._listen(socket, client)
        except (WebSocketDisconnect, KeyError):  # a message of bytes has no text
            pass
        finally:
            sender.cancel()
            self._clients.discard(client)
            self._count_those_who_look()

    async def _listen(self, socket: WebSocket, client: _Client) -> None:
        rate, loop = MessageRate(_EACH_SECOND, _AT_ONCE), asyncio.get_running_loop()
        while True:
            text = await socket.receive_text()
            if len(text) > LARGEST_MESSAGE or not rate.allowed():
                await socket.close(1008, "too much at once")
                return
            _heard(text, client, self.simulation, loop)
            self._count_those_who_look()


def application(
    source: Any, guard: Guard, *, strangers: Strangers | None = None, first_run: dict[str, Any] | None = None
) -> ASGIApp:
    """The page's application."""
    house, uploads = _House(source), Uploads()
    routes = [
        Route("/", _file("index.html")),
        *[Route(f"/{name}", _file(name)) for name in _OWN],
        *[Route(f"/keep/{name}", _kept(name, house.simulation)) for name in _KEPT],
        *session_routes(house.session, house.simulation, uploads),
        Route("/flow", _flow(house.simulation)),
        Route("/first-run", _fixed(partial(json.dumps, first_run), "application/json")),
        Route("/replay", _sent(replay_of_upload, LARGEST_RUN, uploads), methods=["POST"]),
        Route("/study", _sent(_study(house.simulation), LARGEST_STUDY_SENT, uploads), methods=["POST"]),
        WebSocketRoute("/live", house.connect),
    ]
    handlers = dict.fromkeys((InputError, OSError, ClientDisconnect), _said)
    app = Starlette(routes=routes, lifespan=house.open, exception_handlers=handlers)
    return _Guarded(app, guard, strangers or Strangers())


async def _said(request: Request, error: Exception) -> Response:
    """The error as a sentence. Nothing is reported to a client that disconnects while it sends, or in the terminal."""
    with suppress(ClientDisconnect, RuntimeError):  # RuntimeError: all has been read
        async for _ in request.stream():  # browsers listen to the answer when they have sent everything
            pass
    if isinstance(error, InputError):
        return PlainTextResponse(str(error), status_code=413 if isinstance(error, TooLargeError) else 400)
    if isinstance(error, OSError):
        return PlainTextResponse(f"a file could not be written: {error.strerror}", status_code=507)
    return Response(status_code=400)


async def _tell(socket: WebSocket, client: _Client, simulation: SimulationThread) -> None:
    """Send the newest state whenever there is one; a slow client misses those between."""
    with suppress(WebSocketDisconnect, RuntimeError):
        while True:
            if client.version < 0:
                await socket.send_text(simulation.past())
            if client.version != simulation.version:
                client.version = simulation.version
                await socket.send_text(simulation.scene)
            while client.refusals:
                await socket.send_text(client.refusals.pop(0))
            if simulation.frame:
                await socket.send_text(simulation.frame)
            await client.news.wait()
            client.news.clear()


def _heard(text: str, client: _Client, simulation: SimulationThread, loop: asyncio.AbstractEventLoop) -> None:
    """Dispatch a client's command, if it is a JSON object."""

    def refuse(sentence: str) -> None:
        def note() -> None:
            client.refusals.append(sentence)
            del client.refusals[:-_MOST_REFUSALS]
            client.news.set()

        with suppress(RuntimeError):
            loop.call_soon_threadsafe(note)

    try:
        command = json.loads(text)
    except (ValueError, RecursionError):
        command = None
    if not isinstance(command, dict):
        refuse(json.dumps({"t": "refused", "field": "", "lane": 0, "sentence": "a message that is no JSON object"}))
    elif command.get("do") == "look":
        client.looks = bool(command.get("value"))
    else:
        simulation.ask(command, refuse)


Handler = Callable[[Request], Awaitable[Response]]


def _fixed(content: Callable[[], str], media: str) -> Handler:
    """Serve a text that no request changes."""

    async def serve(_request: Request) -> Response:
        return Response(content(), media_type=media)

    return serve


def _file(name: str) -> Handler:
    return _fixed(partial(asset, name), _TYPES[name.rpartition(".")[2]])


_KEPT = ("robot.toml", "commands.txt", "robot.py", "run.html", "run.json", "words.json")


def _kept(name: str, simulation: SimulationThread) -> Handler:
    def made(lane_text: str) -> Response:
        found = simulation.recording(int(lane_text)) if lane_text in ("0", "1") else None
        if found is None:
            raise InputError(f"lane = {lane_text[:20]!r}; allowed: a robot that is there")
        swimmer, run = found
        if name == "words.json":
            words = {"commands": command_line(swimmer), "python": python_lines(swimmer), "robot": robot_file(swimmer)}
            return JSONResponse(words)
        if name.startswith("run.") and len(run["time"]) < 2:
            raise InputError("the robot has not swum yet; allowed: a run of some steps")
        if name == "run.json":
            return JSONResponse(replay_of_swimmer(swimmer, run))
        if name == "run.html":
            text, media = replay_page(replay_of_swimmer(swimmer, run)), "text/html"
        else:
            maker = {"robot.toml": robot_file, "commands.txt": command_line, "robot.py": python_lines}[name]
            text, media = maker(swimmer), "text/plain"
        return Response(text, media_type=media, headers={"Content-Disposition": f'attachment; filename="{name}"'})

    async def serve(request: Request) -> Response:
        return await run_in_background(made, request.query_params.get("lane", "0"))

    return serve


def _flow(simulation: SimulationThread) -> Handler:
    async def serve(request: Request) -> Response:
        swimmer = request.query_params.get("lane", "")
        found = simulation.flow(int(swimmer)) if swimmer in ("0", "1") else None
        if found is None:
            return PlainTextResponse("there is no flow", status_code=404)
        return JSONResponse(found)

    return serve


def _study(simulation: SimulationThread) -> Callable[[bytes], dict[str, Any]]:
    """Picture of an uploaded study's dataset, or of the paper's."""

    def picture(content: bytes) -> dict[str, Any]:
        from spirillum.results.study import study

        found = sent_study(content) if content else StudyPicture(study())
        simulation.study = found  # whose tails can be pointed at from now on
        return found.describe()

    return picture


def _sent(read: Callable[[bytes], Any], largest: int, uploads: Uploads) -> Handler:
    """Process an upload and return its content; one at a time, since small files may declare much."""
    one = asyncio.Lock()

    async def serve(request: Request) -> Response:
        async with uploads.received(request, largest) as content, one:
            return JSONResponse(await run_in_background(read, content))

    return serve
