"""The verbs over HTTP: JSON in, JSON out, for programs on this computer, or with a token for others.

``GET /`` lists the verbs. ``POST /VERB`` with an object of arguments does one; what changes nothing may be asked with
``GET /VERB?NAME=VALUE``. Every error is ``{"error": ..., "remedy": ...}``. A web page cannot reach it: requests that
name another host, or come from another origin, are turned away.

One thread with a loop of its own answers everybody, so that a client that is slow costs nobody anything. Whoever has
not said what he wants in `QUIET` seconds is sent away, sooner where there is no room for another. Whoever waits for the
cell and leaves is waited for no more.
"""

import asyncio
import contextlib
import hmac
import ipaddress
import json
import re
import socket
import sys
import threading
import traceback
from collections.abc import Mapping
from concurrent.futures import Future
from enum import Enum, auto
from http import HTTPStatus
from typing import Any, Final, Protocol
from urllib.parse import SplitResult, parse_qsl, urlsplit

import detent
from detent.realtime import http1, openapi, verbs
from detent.realtime.control import Ending
from detent.realtime.endpoints.endpoint import EndpointError, descriptors_suffice
from detent.realtime.endpoints.tcp import TcpAddress
from detent.realtime.system import reuse_address
from detent.realtime.verbs import Answer, AskedWrongly, Json

QUIET: Final = 10.0  # seconds in which a client has to say what it wants, and to take the answer
MOST_CLIENTS: Final = 128  # at once; one more takes the place of the one that has said nothing for longest
MOST_WAITING: Final = 64  # of them that wait for the cell
PARTING: Final = 0.5  # seconds in which clients take their last answers when it ends
SHORTEST_TOKEN: Final = 8  # characters
LAST_LATIN: Final = 0xFF  # the last character that a header can have
TOKEN: Final = "DETENT_TOKEN"  # the variable of the environment


class VerbHandler(Protocol):
    """Whoever does the verbs (`realtime.control.Control`)."""

    def ask(self, verb: str, given: Mapping[str, object]) -> "Future[Answer]":
        """Do it; the answer is to come. Raises Ending."""

    def late(self, verb: str) -> Answer:
        """What is answered when the answer has not come in time. Raises Ending."""

    def end(self) -> None:
        """Whoever waits is told that it ends."""


class _Refused(Exception):
    """A request that is not for the cell."""

    def __init__(self, status: HTTPStatus, what: str, remedy: str = "", **headers: str) -> None:
        super().__init__(what)
        self.status, self.what, self.remedy, self.headers = status, what, remedy, headers


class HttpControl:
    """Listens at `address` and answers in a thread of its own, until it is closed."""

    def __init__(self, control: VerbHandler, address: TcpAddress, token: str | None = None) -> None:
        """Raises EndpointError if the port cannot be had, or is open to others without a `token`, or that is short."""
        if token and (wrong := wrong_token(token)):
            raise EndpointError(f"--token or ${TOKEN}: {wrong}")
        if not token and not is_loopback(address.host):
            raise EndpointError(
                f"{address} is open to other computers: give --token TEXT or ${TOKEN}, or listen on 127.0.0.1"
            )
        try:
            with descriptors_suffice():
                listener = _listen(address)
                self._loop = asyncio.new_event_loop()
        except EndpointError:
            raise
        except (OSError, UnicodeError) as error:
            reason = getattr(error, "strerror", None) or error
            raise EndpointError(
                f"{address} cannot be listened on: {reason}; choose another port, or 0 for any free one"
            ) from error
        host, port = listener.getsockname()[:2]
        self.address = TcpAddress(str(host), int(port))
        self._control = control
        self._clients = _Clients(control, token or "")
        self._loop.set_exception_handler(_of_a_connection)
        self._ending = asyncio.Event()
        self._thread = threading.Thread(target=self._run, args=(listener,), name="control", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """What a client on this computer is given."""
        host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(self.address.host, self.address.host)
        return f"http://{self.address._replace(host=host)}"

    def close(self) -> None:
        """Whoever still waits for the cell is told that it ends; then nobody is listened to any more. Soon over."""
        self._control.end()
        with contextlib.suppress(RuntimeError):  # it was closed before
            self._loop.call_soon_threadsafe(self._ending.set)
        self._thread.join()

    def _run(self, listener: socket.socket) -> None:
        try:
            self._loop.run_until_complete(self._serve(listener))
        finally:
            self._loop.close()

    async def _serve(self, listener: socket.socket) -> None:
        server = await asyncio.start_server(
            self._clients.connected, sock=listener, limit=http1.LONGEST_HEAD, backlog=MOST_CLIENTS
        )
        await self._ending.wait()
        server.close()
        await self._clients.part()


def wrong_token(token: str) -> str:
    """What is wrong with a token, and what it has to be; "" if it can be sent in a header and compared there."""
    if len(token) < SHORTEST_TOKEN:
        return f"it is too short; at least {SHORTEST_TOKEN} characters"
    if not token.isprintable() or token != token.strip():
        return "it has characters that cannot be seen; take letters, digits and signs, with spaces only between them"
    if any(ord(letter) > LAST_LATIN for letter in token):
        return f"it has {max(token)!r}, which no header of a request can have; take Latin letters, digits and signs"
    return ""


_HOST: Final = re.compile(r"(?P<name>\[[0-9A-Fa-f:.]+\]|[^\s:/?#@\\\[\]]+)(:\d{1,5})?", re.ASCII)


def name_of(host: str) -> str:
    """The name in a Host header, without its port and brackets; "" for what is no name, or has more behind it."""
    found = _HOST.fullmatch(host)
    return found["name"].strip("[]").lower() if found is not None else ""


def is_loopback(host: str) -> bool:
    """Whether only programs on this computer reach `host`."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _listen(address: TcpAddress) -> socket.socket:
    found = socket.getaddrinfo(address.host, address.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    family, kind, protocol, _, where = found[0]
    listener = socket.socket(family, kind, protocol)
    try:
        reuse_address(listener)
        listener.bind(where)
        listener.listen(MOST_CLIENTS)
    except OSError:
        listener.close()
        raise
    listener.setblocking(False)
    return listener


def _of_a_connection(loop: asyncio.AbstractEventLoop, told: dict[str, Any]) -> None:
    """What asyncio tells of connections that broke, and of descriptors that ran out, is nothing to report."""
    error = told.get("exception")
    if error is not None and not isinstance(error, OSError):
        traceback.print_exception(error, file=sys.stderr)


class _Stage(Enum):
    """How far a client is."""

    ASKING = auto()  # it has not said yet what it wants
    ANSWERED = auto()  # we are to find the answer
    TAKING = auto()  # it has not taken all of the answer


class _Client:
    """Somebody who is connected."""

    __slots__ = ("stage", "writer")

    def __init__(self, writer: asyncio.StreamWriter) -> None:
        self.stage, self.writer = _Stage.ASKING, writer


class _Clients:
    """Who is connected, each a task that reads one request and writes one answer."""

    def __init__(self, control: VerbHandler, token: str) -> None:
        self._control, self._token = control, token
        self._clients: dict[asyncio.Task[None], _Client] = {}  # the oldest first
        self._waiting = 0  # for the cell

    async def connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """A client: all of it, from the connection to its end."""
        task = asyncio.current_task()
        assert task is not None
        client = _Client(writer)
        try:
            if not self._make_room():
                return
            self._clients[task] = client
            async with asyncio.timeout(QUIET):
                told = await self._told(reader, writer)
            client.stage = _Stage.ANSWERED
            if isinstance(told, http1.Request):
                told = await self._answer(told, reader)
            client.stage = _Stage.TAKING
            writer.write(told)
            async with asyncio.timeout(QUIET):
                await writer.drain()
                writer.write_eof()
                while await reader.read(1 << 16):  # what it has said too much: closed sooner, it would not hear us
                    pass
        except (OSError, EOFError, TimeoutError):
            pass  # the client is gone, or has said or taken nothing for too long
        except asyncio.CancelledError:
            pass  # it ends
        finally:
            self._clients.pop(task, None)
            writer.transport.abort()

    def _make_room(self) -> bool:
        """Where all places are taken, whoever keeps us waiting for longest leaves; False if nobody does."""
        if len(self._clients) < MOST_CLIENTS:
            return True
        for stage in (_Stage.ASKING, _Stage.TAKING):
            for task, client in self._clients.items():
                if client.stage is stage:
                    client.writer.transport.abort()
                    del self._clients[task]
                    return True
        return False

    async def part(self) -> None:
        """It ends: those who were promised an answer have a moment to take it."""
        for task, client in self._clients.items():
            if client.stage is _Stage.ASKING:
                task.cancel()
        everybody = set(self._clients)
        if everybody:
            _, left = await asyncio.wait(everybody, timeout=PARTING)
            for task in left:
                task.cancel()
            if left:
                await asyncio.wait(left)

    async def _told(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> "http1.Request | bytes":
        """What the client wants; the answer if that is not to be understood."""
        try:
            return await http1.read(reader, writer)
        except http1.Unreadable as wrong:
            return _written(wrong.status, _error(wrong.what, wrong.remedy))

    async def _answer(self, request: http1.Request, reader: asyncio.StreamReader) -> bytes:
        """The answer to a request as it is sent."""
        headers: Mapping[str, str] = {}
        try:
            status, answer = HTTPStatus.OK, await self._asked(request, reader)
        except _Refused as refused:
            status, headers = refused.status, refused.headers
            answer = _error(refused.what, refused.remedy)
        except AskedWrongly as error:
            status, answer = HTTPStatus.BAD_REQUEST, _error(error.what, error.remedy)
        except Ending as error:
            status, answer = HTTPStatus.SERVICE_UNAVAILABLE, _error(str(error), "start it again: detent serve")
        except (OSError, EOFError):
            raise
        except Exception as error:  # a fault of ours: all of it here, a line of it there
            traceback.print_exc()
            status = HTTPStatus.INTERNAL_SERVER_ERROR
            answer = _error(f"{type(error).__name__}: {error}", "what it was stands in the log of the service")
        return _written(status, answer, headers, with_body=request.method != "HEAD")

    async def _asked(self, request: http1.Request, reader: asyncio.StreamReader) -> Answer:
        """What the request asks, done. Raises what `_answer` knows."""
        if request.method not in _METHODS:
            what = f"Unsupported method ({request.method[:20]!r})"
            raise _Refused(HTTPStatus.METHOD_NOT_ALLOWED, what, "GET / lists the verbs", Allow="GET, POST")
        self._check_sender(request)
        url = _split(request.target, "path")
        if url.path == "/":
            _check_method(request, "GET")
            return _listed()
        if url.path == "/openapi.json":
            _check_method(request, "GET")
            return openapi.document()
        name = url.path.strip("/")
        if name not in verbs.VERBS:
            error = verbs.unknown("verb", name, tuple(verbs.VERBS))
            raise _Refused(HTTPStatus.NOT_FOUND, error.what, error.remedy)
        _check_method(request, *(["POST"] if verbs.VERBS[name].changes else ["GET", "POST"]))
        given: dict[str, object] = dict(parse_qsl(url.query, keep_blank_values=True))
        return await self._do(name, given | _arguments(request.body), reader)

    async def _do(self, verb: str, given: Mapping[str, object], reader: asyncio.StreamReader) -> Answer:
        """The answer of the cell. A client that leaves while it waits for the cell is waited for no more."""
        patience, waits = verbs.verb(verb).patience(given), verbs.verb(verb).waits
        if waits and self._waiting >= MOST_WAITING:
            what = f"{MOST_WAITING} clients wait for the cell already"
            raise _Refused(HTTPStatus.SERVICE_UNAVAILABLE, what, "ask again when one of them has its answer")
        promised = asyncio.wrap_future(self._control.ask(verb, given))
        gone: asyncio.Task[None] | None = asyncio.create_task(_left(reader)) if waits else None
        self._waiting += waits
        try:
            watched: set[asyncio.Future[Any]] = {promised} if gone is None else {promised, gone}
            await asyncio.wait(watched, timeout=patience, return_when=asyncio.FIRST_COMPLETED)
            if promised.done():
                return promised.result()
            if gone is not None and gone.done():
                raise ConnectionError("the client went away")
        except asyncio.CancelledError:
            if not promised.cancelled():
                raise
            raise Ending("the cell is not served any more") from None
        finally:
            self._waiting -= waits
            promised.cancel()
            if gone is not None:
                await _ended(gone)
        return self._control.late(verb) | await self._do("state", {}, reader)

    def _check_sender(self, request: http1.Request) -> None:
        """No pages of other sites, no names that were pointed here, no strangers."""
        host, origin = request.headers.get("host", ""), request.headers.get("origin")
        if not self._token and not is_loopback(name_of(host)):
            raise _Refused(HTTPStatus.FORBIDDEN, f"host {host!r} is not this one", "ask 127.0.0.1 or localhost")
        if origin is not None and origin not in (f"http://{host}", f"https://{host}"):
            raise _Refused(HTTPStatus.FORBIDDEN, f"origin {origin!r} may not ask", "this is no place for web pages")
        if self._token:
            scheme, _, token = request.headers.get("authorization", "").partition(" ")
            right = hmac.compare_digest(token.strip().encode(), self._token.encode())
            if scheme.lower() != "bearer" or not right:
                what = "the token is wrong" if token else "a token is needed"
                remedy = f"send Authorization: Bearer TOKEN (detent control: --token or ${TOKEN})"
                raise _Refused(HTTPStatus.UNAUTHORIZED, what, remedy, WWW_Authenticate="Bearer")


_METHODS: Final = ("GET", "POST", "PUT", "DELETE", "PATCH", "HEAD", "OPTIONS")


async def _left(reader: asyncio.StreamReader) -> None:
    """Come back when the client has left. What else it says is nothing to us."""
    with contextlib.suppress(OSError):
        while await reader.read(1 << 16):
            pass


async def _ended(task: "asyncio.Task[None]") -> None:
    task.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await task


def _check_method(request: http1.Request, *allowed: str) -> None:
    if request.method not in allowed:
        what = f"{request.method} is not for {request.target.partition('?')[0]}"
        raise _Refused(HTTPStatus.METHOD_NOT_ALLOWED, what, f"use {allowed[-1]}", Allow=", ".join(allowed))


def _written(status: HTTPStatus, answer: Answer, headers: Mapping[str, str] = {}, *, with_body: bool = True) -> bytes:
    """An answer as it is sent."""
    told = {
        "Server": f"detent/{detent.__version__}",
        "Content-Type": "application/json",
        "Cache-Control": "no-store",
        "X-Content-Type-Options": "nosniff",
        **{name.replace("_", "-"): value for name, value in headers.items()},
    }
    return http1.answer(status, told, (json.dumps(answer) + "\n").encode(), with_body=with_body)


def _split(text: str, what: str) -> SplitResult:
    """A URL, or a part of one, in its parts."""
    try:
        return urlsplit(text)
    except ValueError:
        raise _Refused(HTTPStatus.BAD_REQUEST, f"the {what} cannot be understood", "GET / lists the verbs") from None


def _arguments(body: bytes) -> dict[str, object]:
    """The arguments in a body."""
    if not body.strip():
        return {}
    try:
        found = json.loads(body)
    except (ValueError, RecursionError):
        raise AskedWrongly("the body is no JSON", 'send an object: {"unit": "bar"}') from None
    if not isinstance(found, dict):
        raise AskedWrongly("the body is no JSON object", 'send arguments by name: {"unit": "bar"}')
    return found


def _error(what: str, remedy: str) -> Answer:
    return {"error": what, "remedy": remedy} if remedy else {"error": what}


def _listed() -> Answer:
    """What there is to ask."""
    listed: list[Json] = [
        {
            "verb": verb.name,
            "method": "POST" if verb.changes else "GET",
            "help": verb.help,
            "arguments": [
                {"name": p.name, "takes": p.kind.takes, "help": p.help, "required": p.required} for p in verb.parameters
            ],
        }
        for verb in verbs.VERBS.values()
    ]
    faults: list[Json] = [
        {"kind": kind.name, "where": kind.where, "takes": list(kind.takes), "help": kind.help}
        for kind in verbs.FAULTS.values()
    ]
    return {"detent": detent.__version__, "verbs": listed, "faults": faults}
