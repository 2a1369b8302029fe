"""Another page, another host, no key, too much: refused, by a server as it runs."""

import asyncio
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import AsyncExitStack, ExitStack, suppress
from http.client import HTTPConnection, HTTPException
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from starlette.requests import Request
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

import spirillum as sp
from spirillum.errors import InputError
from spirillum.files.limits import LARGEST_TEXT
from spirillum.pages import server
from spirillum.pages.guard import HEADERS, LARGEST_MESSAGE, Guard, MessageRate, Strangers
from spirillum.pages.job import BackgroundJob
from spirillum.pages.knobs import Settings
from spirillum.pages.measurement_session import MeasurementSession
from spirillum.pages.study_picture import StudyPicture
from spirillum.pages.video_store import TooLargeError, Uploads


def _answer(served: Any, path: str, method: str = "GET", body: bytes | None = None, **headers: str) -> Any:
    host = served.base.removeprefix("http://")
    connection = HTTPConnection(host, timeout=20)
    connection.putrequest(method, path, skip_host=True)
    sent = {"Host": host, **{name.replace("_", "-"): value for name, value in headers.items()}}
    if body is not None:
        sent["Content-Length"] = str(len(body))
    for name, value in sent.items():
        connection.putheader(name, value)
    connection.endheaders(body)
    found = connection.getresponse()
    found.content = found.read()  # type: ignore[attr-defined]
    connection.close()
    return found


@pytest.fixture
def home(served: Any) -> str:
    """The path of the page, with its key."""
    found = _answer(served, f"/?key={served.key}")
    assert (found.status, found.headers["Location"]) == (303, f"/{served.key}/")
    assert found.headers["Set-Cookie"] is None  # a browser would send it to every other server of this machine
    return f"/{served.key}"


def test_key_opens_and_nothing_else_does(served: Any, home: str) -> None:
    assert _answer(served, f"{home}/").status == 200
    assert _answer(served, f"{home}/main.js").status == 200
    wrong = home[:-2] + "xx"
    for path in ("/", "/?key=wrong", "/main.js", f"{wrong}/", f"{wrong}/main.js", f"//{home}/main.js", f"/x{home}/"):
        assert _answer(served, path).status == 403
    assert _answer(served, f"/main.js?key={served.key}").status == 403


def test_every_answer_has_its_headers(served: Any, home: str) -> None:
    for path in ("/", "/main.js", "/nothing"):
        found = _answer(served, home + path)
        assert {name: found.headers[name] for name in HEADERS} == dict(HEADERS)
    assert "unsafe" not in HEADERS["Content-Security-Policy"]


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1:1", "192.0.2.7:{port}", ""])
def test_wrong_host_is_refused(served: Any, home: str, host: str) -> None:
    port = served.base.rpartition(":")[2]
    assert _answer(served, home + "/", Host=host.format(port=port)).status == 403


def test_another_origin_is_refused(served: Any, home: str) -> None:
    own = served.base
    assert _answer(served, home + "/", Origin=own).status == 200
    for other in ("http://evil.example", "null", own.replace("127.0.0.1", "localhost"), own + "0"):
        assert _answer(served, home + "/", Origin=other).status == 403
    assert _answer(served, home + "/replay", "POST", b"x").status == 403  # no origin
    found = _answer(served, home + "/replay", "POST", b"no run", Origin=own)
    assert found.status == 400
    assert b"the file" in found.content


@pytest.mark.parametrize(
    "path", ["/../pyproject.toml", "/%2e%2e/guard.py", "/static/main.js", "/keep/robot.toml?lane=../9"]
)
def test_no_path_of_a_client_is_a_file(served: Any, home: str, path: str) -> None:
    assert _answer(served, home + path).status in (400, 404)


def _socket(served: Any, home: str, origin: str | None) -> Any:
    headers = {} if origin is None else {"Origin": origin}
    return connect(served.base.replace("http", "ws") + home + "/live", additional_headers=headers, max_size=None)


def test_socket_wants_key_and_origin(served: Any, home: str) -> None:
    for wrong in ((home, "http://evil.example"), (home, None), ("", served.base), (home[:-1], served.base)):
        with pytest.raises(Exception, match="403"):
            _socket(served, *wrong)
    with _socket(served, home, served.base) as socket:
        assert json.loads(socket.recv())["t"] == "past"


def test_nonsense_gets_a_sentence(served: Any, home: str) -> None:
    with _socket(served, home, served.base) as socket:
        said = []
        for text in ("nonsense", "[1]", '{"do":"fly"}', '{"do":"set","field":"robot.path","value":"/etc/passwd"}'):
            socket.send(text)
        socket.send('{"do":"set","field":"tail.wavelength","value":"' + "9" * 200 + ' mm"}')
        socket.send('{"do":"pace","value":NaN}')
        while len(said) < 6:
            message = json.loads(socket.recv(timeout=20))
            said += [message["sentence"]] if message["t"] == "refused" else []
        assert all("allowed" in sentence or "JSON" in sentence for sentence in said)


@pytest.mark.parametrize("flood", [["x" * (LARGEST_MESSAGE + 1)], ['{"do":"wake"}'] * 1000], ids=["long", "many"])
def test_too_much_at_once_is_cut_off(served: Any, home: str, flood: list[str]) -> None:
    def drown() -> None:
        with _socket(served, home, served.base) as socket:
            for text in flood:
                socket.send(text)
            while True:
                socket.recv(timeout=20)

    with pytest.raises(ConnectionClosed) as closed:
        drown()
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1008


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 0), (signal.SIGTERM, 143)])
def test_a_signal_ends_it_while_a_film_is_searched(
    served: Any, trial: Any, tmp_path: Path, number: int, code: int
) -> None:
    with (tmp_path / "err").open("w") as err:
        other = type(served)("--port", "0", stderr=err)
    film = _answer(other, f"/{other.key}/bench/film?kind=mp4", "POST", trial.path.read_bytes(), Origin=other.base)
    assert film.status == 200
    slow = threading.Thread(target=lambda: _dropped(other, "/bench/propose", b'{"film":"trial-1"}'))
    slow.start()
    time.sleep(0.3)
    assert other.ended(number) == code
    slow.join()
    assert (tmp_path / "err").read_text() == ""


def _dropped(served: Any, path: str, body: bytes) -> None:
    with suppress(OSError, HTTPException):  # the page ends meanwhile
        _answer(served, f"/{served.key}{path}", "POST", body, Origin=served.base)


def test_malformed_bytes_print_nothing(served: Any, tmp_path: Path) -> None:
    with (tmp_path / "err").open("w") as err:
        other = type(served)("--port", "0", stderr=err)
    address = ("127.0.0.1", int(other.base.rpartition(":")[2]))
    upgrade = (
        f"GET /{other.key}/live HTTP/1.1\r\nHost: {other.base[7:]}\r\nOrigin: {other.base}\r\nConnection: Upgrade\r\n"
        "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
    ).encode()
    mask = bytes(4)
    frames = {
        "invalid UTF-8": b"\x81\x82" + mask + b"\xc3\x28",
        "bytes": b"\x82\x82" + mask + b"\xc3\x28",
        "no mask": b"\x81\x02ab",
        "a reserved opcode": b"\x83\x82" + mask + b"ab",
        "a cut message": b"\x01\x82" + mask + b"\xc3\x28" + b"\x81\x82" + mask + b"ab",
        "too long": b"\x81\xff" + b"\x7f" * 8 + mask,
        "a wrong end": b"\x88\x82" + mask + b"\x00\x01",
    }
    requests = [upgrade + frame for frame in frames.values()]
    requests += [b"\xff\xfe\x00 nonsense\r\n\r\n", b"GET /\xc3\x28 HTTP/1.1\r\nHost: \xff\r\n\r\n"]
    requests.append(upgrade.replace(b"/live", b"/l\xc3\x28ve"))
    requests.append(upgrade.replace(b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n", b""))
    with ExitStack() as stack:
        clients = [stack.enter_context(socket.create_connection(address, timeout=5.0)) for _ in requests]
        for client, request in zip(clients, requests, strict=True):
            client.sendall(request)
        end = time.monotonic() + 1.0  # what is not refused goes on with pictures of the robot
        for client in clients:
            client.settimeout(0.3)
            with suppress(OSError):
                while client.recv(65536) and time.monotonic() < end:
                    pass
    assert _answer(other, f"/{other.key}/").status == 200
    assert other.ended(signal.SIGINT) == 0
    assert (tmp_path / "err").read_text() == ""


def test_half_open_connections_lock_nobody_out(served: Any, home: str) -> None:
    address = ("127.0.0.1", int(served.base.rpartition(":")[2]))
    with ExitStack() as stack:
        for number in range(300):
            client = stack.enter_context(socket.create_connection(address, timeout=5.0))
            with suppress(OSError):  # closed already, for younger ones
                client.sendall((b"", b"GET / HTTP/1.1\r\n", b"POST / HTTP/1.1\r\nContent-Length: 9\r\n")[number % 3])
        assert _answer(served, f"{home}/").status == 200
        with _socket(served, home, served.base) as live:
            assert json.loads(live.recv())["t"] == "past"


class _Transport(asyncio.Transport):
    def __init__(self, port: int) -> None:
        super().__init__({"peername": ("127.0.0.1", port)})
        self.closed = False

    def abort(self) -> None:
        self.closed = True


def test_connections_without_a_key_are_few_and_short() -> None:
    async def come() -> list[bool]:
        strangers = Strangers(most=2, patience=0.02)
        all_of_them = [_Transport(port) for port in range(4)]
        strangers.greet(all_of_them[0])
        strangers.admit(("127.0.0.1", 0))  # it has the key
        for transport in all_of_them[1:]:
            strangers.greet(transport)
        closed = [transport.closed for transport in all_of_them]
        await asyncio.sleep(0.1)
        return closed + [transport.closed for transport in all_of_them]

    assert asyncio.run(come()) == [False, True, False, False, False, True, True, True]


def _scenes(live: Any, wanted: Callable[[dict[str, Any]], bool]) -> list[dict[str, Any]]:
    """The first robot in every scene that is sent, until one is as wanted."""
    found: list[dict[str, Any]] = []
    while not (found and wanted(found[-1])):
        message = json.loads(live.recv(timeout=120))
        found += [message["lanes"][0]] if message["t"] == "scene" else []
    return found


def test_numbers_are_never_those_of_what_was_set_before(served: Any, home: str) -> None:
    changes: list[tuple[dict[str, Any], Callable[[dict[str, Any]], bool]]] = [
        ({"do": "preset", "value": "magnetic-helix"}, lambda swimmer: swimmer["robot"] == "magnetic-helix"),
        ({"do": "preset", "value": "biorob2012-wide"}, lambda swimmer: swimmer["robot"] == "biorob2012-wide"),
        ({"do": "duty", "value": 0.5}, lambda swimmer: swimmer["duty"] == 0.5),
        ({"do": "set", "field": "run.flow", "value": "0.1 mm/s"}, lambda swimmer: _knob(swimmer, "run.flow") == 0.1),
    ]
    with _socket(served, home, served.base) as live:
        _scenes(live, lambda swimmer: bool(swimmer["numbers"]))
        for command, is_set in changes:
            live.send(json.dumps(command))
            seen = _scenes(live, lambda swimmer, is_set=is_set: bool(is_set(swimmer) and swimmer["numbers"]))  # type: ignore[misc]
            shown = [swimmer["numbers"] for swimmer in seen if is_set(swimmer)]
            assert shown[0] is None  # blank first
            assert all(one is None or one == shown[-1] for one in shown)
    half = sp.load("biorob2012-wide", **{"drive.duty": 0.5})
    still, flowing = (sp.predict(half, model="tube", placement=where) for where in (None, {"flow": "0.1 mm/s"}))
    assert shown[-1]["rows"]["forward_velocity"]["value"] == pytest.approx(flowing.forward_velocity, rel=1e-9)
    assert abs(flowing.forward_velocity / still.forward_velocity - 1.0) > 0.1


def _knob(swimmer: dict[str, Any], field: str) -> Any:
    return next(knob["value"] for knob in swimmer["knobs"] if knob["field"] == field)


def test_guard_beyond_the_loopback_takes_addresses_but_no_foreign_names() -> None:
    guard = Guard("0.0.0.0", 8000)
    assert guard.is_own_host("192.0.2.7:8000")
    assert not guard.is_own_host("evil.example:8000")
    assert not Guard("127.0.0.1", 8000).is_own_host("192.0.2.7:8000")


@pytest.mark.parametrize("host", ["", " ", "0", "0x0", "010.0.0.1", "<broadcast>", "a b", "-a", "a..b", "[::1]", "\0"])
def test_what_is_no_host_is_refused(host: str) -> None:
    with pytest.raises(InputError, match=r"host = .*; allowed: the name of a host, or an address such as 127\.0\.0\.1"):
        sp.page(host=host, browser=False)


def test_rate_lets_a_burst_through_and_then_no_more() -> None:
    rate = MessageRate(1e-6, 3.0)
    assert [rate.allowed() for _ in range(5)] == [True, True, True, False, False]


def test_only_knobs_can_be_turned() -> None:
    with pytest.raises(InputError, match="is no knob"):
        Settings("biorob2012-wide").changed("extends", "biorob2012-narrow")


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("click", {"what": "ruler", "points": [[10**400, 1], [2, 3]], "time": 0}),
        ("click", {"what": "body", "points": [["nan", 1], [1e300, 3]], "time": 0}),
        ("click", {"what": "stripes", "points": [], "time": float("inf")}),
        ("text", {"text": "extends = 'biorob2012-wide'\ndescription = '\ud800'"}),
        ("look", {"film": "\ud800"}),
        ("measure", {}),
        ("robot", {"lane": [[10**400]]}),
        ("robot", {"lane": 0.0}),
        ("robot", {"lane": False}),
    ],
)
def test_what_the_bench_cannot_take_gets_a_sentence(served: Any, home: str, path: str, message: dict[str, Any]) -> None:
    body = json.dumps(message).encode()
    found = _answer(served, f"{home}/bench/{path}", "POST", body, Origin=served.base)
    assert found.status == 400
    assert b"allowed: " in found.content


@pytest.mark.parametrize("path", ["/bench/film?kind=mp4", "/bench/state", "/replay", "/study"])
def test_a_client_that_leaves_while_it_sends_is_no_error(path: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("av")
    pytest.importorskip("cv2")
    session = MeasurementSession()
    monkeypatch.setattr(server, "MeasurementSession", lambda: session)
    guard = Guard("127.0.0.1", 1)
    where, _, query = path.partition("?")
    named = {"host": "127.0.0.1:1", "origin": "http://127.0.0.1:1", "content-length": "9"}
    headers = [(name.encode(), value.encode()) for name, value in named.items()]
    scope = {
        "type": "http",
        "method": "POST",
        "path": f"/{guard.key}{where}",
        "query_string": query.encode(),
        "headers": headers,
    }
    comes = iter([{"type": "http.request", "body": b"{", "more_body": True}, {"type": "http.disconnect"}])
    sent: list[Any] = []

    async def receive() -> Any:
        return next(comes)

    async def send(message: Any) -> None:
        sent.append(message)

    asyncio.run(server.application("biorob2012-wide", guard)(scope, receive, send))
    assert sent[0]["status"] == 400
    assert not list(session._folder.iterdir())
    session.close()


def test_what_is_too_large_gets_a_sentence(served: Any, home: str) -> None:
    found = _answer(served, f"{home}/bench/state", "POST", bytes(LARGEST_TEXT + 1), Origin=served.base)
    assert (found.status, found.content) == (413, b"1048577 bytes are too much; allowed: 1048576 bytes")


def _request(size: int) -> Request:
    """A request that states a size."""

    async def receive() -> Any:
        return {"type": "http.request", "body": b"all"}

    return Request({"type": "http", "headers": [(b"content-length", b"%d" % size)]}, receive)


def test_all_that_is_sent_at_once_has_one_budget() -> None:
    async def at_once(*sizes: int) -> None:
        async with AsyncExitStack() as stack:
            for size in sizes:
                assert await stack.enter_async_context(uploads.received(_request(size), 100 << 20)) == b"all"

    uploads = Uploads()
    for sizes in ((100 << 20, 100 << 20), (64 << 20, 64 << 20, 1), (*[1 << 20] * 128, 1)):
        with pytest.raises(TooLargeError, match="at once; allowed: 128 MB in all"):
            asyncio.run(at_once(*sizes))
        asyncio.run(at_once(*sizes[:-1]))  # what has been read makes room


def test_files_are_read_one_at_a_time() -> None:
    inside, most = 0, 0

    def read(content: bytes) -> int:
        nonlocal inside, most
        inside += 1
        most = max(most, inside)
        time.sleep(0.01)
        inside -= 1
        return len(content)

    async def all_of_them() -> list[Any]:
        handler = server._sent(read, 10, Uploads())
        return await asyncio.gather(*[handler(_request(3)) for _ in range(5)])

    assert [found.body for found in asyncio.run(all_of_them())] == [b"3"] * 5
    assert most == 1


def test_interrupt_of_the_terminal_is_for_the_page_and_not_for_what_it_started() -> None:
    job = BackgroundJob("spirillum.pages.simulation_thread", {})
    assert os.getsid(job._process.pid) == job._process.pid
    job.stop()
    job._thread.join()


def test_work_ends_without_a_word_where_its_page_was_killed() -> None:
    script = "from spirillum.pages.job import worker; worker(lambda request, tell: tell('a table', 0, 1) or {})"
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer) as nobody:
        command = [sys.executable, "-c", script]
        found = subprocess.run(command, input=b"{}", stdout=nobody, stderr=subprocess.PIPE, check=False)
    assert (found.returncode, found.stderr) == (1, b"")


@pytest.mark.parametrize(
    ("name", "value"), [("wavelength", np.nan), ("amplitude", np.inf), ("wavelength", "x"), ("forward_velocity", "x")]
)
def test_a_study_without_numbers_gets_a_sentence(name: str, value: Any) -> None:
    dims = ("wavelength", "amplitude", "model", "channel")
    study = xr.Dataset({"forward_velocity": (dims, np.ones((1, 1, 1, 1)))}, {dim: [1.0] for dim in dims})
    study[name] = (study[name].dims, np.full(study[name].shape, value))
    with pytest.raises(InputError, match="are no numbers; allowed: a study's dataset"):
        StudyPicture(study)
