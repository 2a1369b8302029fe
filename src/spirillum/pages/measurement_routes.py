"""Routes of the measurement page: uploads of videos and texts, pictures, state and results; no name becomes a path."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Route

from spirillum.errors import InputError, clipped
from spirillum.files.limits import LARGEST_TEXT
from spirillum.pages.job import run_in_background
from spirillum.pages.knobs import text_of
from spirillum.pages.measurement_session import MeasurementSession
from spirillum.pages.simulation_thread import SimulationThread
from spirillum.pages.video_store import Uploads, stated_size

_MOST_POINTS = 40
_FARTHEST = 1e6  # largest pixel, or time in s, that is pointed at
_SHOWN = {"mp4": "video/mp4", "png": "image/png"}  # kinds of results that the page shows; the others are taken away
_Handler = Callable[[Request], Awaitable[Response]]


class _Endpoints:
    """Handlers of the routes."""

    def __init__(self, session: MeasurementSession, simulation: SimulationThread, uploads: Uploads) -> None:
        self._session, self._simulation, self._uploads = session, simulation, uploads
        self.acts: dict[str, Callable[[Mapping[str, Any]], Any]] = {
            "state": lambda _message: None,
            "text": lambda message: session.editor.add_text(text_of(message, "text", "")),
            "robot": self._robot_of_swim,
            "remove": lambda message: session.films.remove(text_of(message, "film", "")),
            "fields": self._fields,
            "click": self._clicked,
            "look": lambda message: session.editor.look(text_of(message, "film", "")),
            "propose": lambda message: session.editor.propose(text_of(message, "film", "")),
            "measure": lambda _message: session.measure(),
            "beside": lambda message: session.compare_with_run(text_of(message, "trial", "")),
            "calibrate": lambda message: session.calibrate(
                text_of(message, "model", ""), text_of(message, "method", "")
            ),
            "stop": lambda _message: session.stop(),
        }

    def answering(self, act: Callable[[Mapping[str, Any]], Any]) -> _Handler:
        """Handler of a JSON message; responds with the outcome and the whole state."""

        async def handle(request: Request) -> Response:
            async with self._uploads.received(request, LARGEST_TEXT) as content:
                return await self._told(await run_in_background(act, _message(content)))

        return handle

    async def _told(self, said: Any) -> Response:
        return JSONResponse({"said": said, **await run_in_background(self._session.state)})

    def _robot_of_swim(self, message: Mapping[str, Any]) -> None:
        swimmer = self._simulation.swimmer_number(message.get("lane"))
        found = self._simulation.recording(swimmer)
        if found is None:
            raise InputError(f"lane = {swimmer}; allowed: a robot that is there")
        self._session.editor.take_robot(found[0].predicted())

    def _fields(self, message: Mapping[str, Any]) -> None:
        given = message.get("fields")
        self._session.editor.set_fields(given if isinstance(given, dict) else {})

    def _clicked(self, message: Mapping[str, Any]) -> str:
        points = message.get("points")
        pairs = points if isinstance(points, list) and len(points) <= _MOST_POINTS else []
        return self._session.editor.click(
            text_of(message, "what", ""),
            text_of(message, "film", ""),
            _number(message.get("time")),
            [(_number(pair[0]), _number(pair[1])) for pair in pairs if isinstance(pair, list) and len(pair) == 2],
            text_of(message, "length", ""),
        )

    async def film(self, request: Request) -> Response:
        """A film is sent."""
        return await self._told(await _received(request, self._session))

    async def picture(self, request: Request) -> Response:
        """A frame of a film."""
        name, time = request.query_params.get("film", ""), _number(request.query_params.get("time"))
        content = await run_in_background(self._session.films.picture, name, time)
        return Response(content, media_type="image/jpeg")

    async def file(self, request: Request) -> Response:
        """A file of the measurement session, by its name."""
        name = request.query_params.get("name", "")
        texts = {"setup.toml": self._session.editor.setup_text, "robot.toml": self._session.editor.robot_text}
        if name in texts:
            text = await run_in_background(texts[name])
            return Response(text, media_type="text/plain", headers=_attached(name))
        path = self._session.result_file(name)
        if path is None:
            raise InputError(f"file {name[:60]!r}; allowed: one of the results")
        kind = _SHOWN.get(path.suffix[1:])
        if kind is not None and "take" not in request.query_params:
            return FileResponse(path, media_type=kind)
        return FileResponse(path, media_type="application/octet-stream", headers=_attached(path.name))


def session_routes(session: MeasurementSession, simulation: SimulationThread, uploads: Uploads) -> list[Route]:
    """Routes of the measurement page."""
    endpoints = _Endpoints(session, simulation, uploads)
    return [
        *[Route(f"/bench/{name}", endpoints.answering(act), methods=["POST"]) for name, act in endpoints.acts.items()],
        Route("/bench/film", endpoints.film, methods=["POST"]),
        Route("/bench/picture", endpoints.picture),
        Route("/bench/file", endpoints.file),
    ]


async def _received(request: Request, session: MeasurementSession) -> str:
    """Store an uploaded video under a name chosen here, in chunks; return its name."""
    kind, size = request.query_params.get("kind", ""), stated_size(request)
    path: Path = await run_in_background(session.films.room_for, kind, size)
    try:
        with path.open("wb") as stream:
            async for piece in request.stream():
                await asyncio.to_thread(stream.write, piece)
        return await run_in_background(session.films.add, path)
    except BaseException:
        path.unlink(missing_ok=True)
        raise


def _message(content: bytes) -> Mapping[str, Any]:
    try:
        found = json.loads(content or b"{}")
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise InputError("the message is no JSON object; allowed: one")
    return found


def _number(value: Any) -> float:
    with suppress(TypeError, ValueError, OverflowError):
        number = float(value)
        if abs(number) <= _FARTHEST:
            return number
    raise InputError(
        f"{clipped(value, 40)} is no pixel or time; allowed: a number from {-_FARTHEST:g} to {_FARTHEST:g}"
    )


def _attached(name: str) -> dict[str, str]:
    return {"Content-Disposition": f'attachment; filename="{name}"'}
