"""The verbs over HTTP: JSON in, JSON out, for programs on this computer, or with a token for others.

``GET /`` lists the verbs. ``POST /VERB`` with an object of arguments does one; what changes nothing may be asked with
``GET /VERB?NAME=VALUE``. Every error is ``{"error": ..., "remedy": ...}``. A web page cannot reach it: requests that
name another host, or come from another origin, are turned away.
"""

import contextlib
import hmac
import ipaddress
import json
import socket
import sys
import threading
import traceback
from collections.abc import Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Final, Protocol
from urllib.parse import SplitResult, parse_qsl, urlsplit

import detent
from detent.realtime import openapi, verbs
from detent.realtime.control import Ending
from detent.realtime.endpoints.endpoint import EndpointError
from detent.realtime.endpoints.tcp import TcpAddress
from detent.realtime.verbs import Answer, AskedWrongly, Json

LONGEST_BODY: Final = 64 << 10  # bytes
MOST_IGNORED: Final = 1 << 20  # bytes of a longer one that are read before it is turned away
QUIET: Final = 10.0  # seconds in which a client has to say what it wants
MOST_CLIENTS: Final = 64  # at once; the next waits
SHORTEST_TOKEN: Final = 8  # characters
TOKEN: Final = "DETENT_TOKEN"  # the variable of the environment


class Doer(Protocol):
    """Whoever does the verbs (`realtime.control.Control`)."""

    def call(self, verb: str, given: Mapping[str, object]) -> Answer:
        """Do it and wait for the answer. Raises AskedWrongly, Ending."""

    def end(self) -> None:
        """Whoever waits is told that it ends."""


class _Refused(Exception):
    """A request that is not for the cell."""

    def __init__(self, status: HTTPStatus, what: str, remedy: str = "", **headers: str) -> None:
        super().__init__(what)
        self.status, self.what, self.remedy, self.headers = status, what, remedy, headers


class HttpControl:
    """Listens at `address` and answers in threads of its own, until it is closed."""

    def __init__(self, control: Doer, address: TcpAddress, token: str | None = None) -> None:
        """Raises EndpointError if the port cannot be had, or is open to others without a `token`, or that is short."""
        if token and len(token) < SHORTEST_TOKEN:
            raise EndpointError(f"--token or ${TOKEN}: it is too short; at least {SHORTEST_TOKEN} characters")
        if not token and not is_loopback(address.host):
            raise EndpointError(
                f"{address} is open to other computers: give --token TEXT or ${TOKEN}, or listen on 127.0.0.1"
            )
        try:
            self._server = _Server(address, control, token or "")
        except (OSError, UnicodeError) as error:
            reason = getattr(error, "strerror", None) or error
            raise EndpointError(
                f"{address} cannot be listened on: {reason}; choose another port, or 0 for any free one"
            ) from error
        host, port = self._server.server_address[:2]
        self.address = TcpAddress(str(host), int(port))
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.05,), name="control", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """What a client on this computer is given."""
        host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(self.address.host, self.address.host)
        return f"http://{self.address._replace(host=host)}"

    def close(self) -> None:
        """Whoever still waits for the cell is told that it ends; then nobody is listened to any more."""
        self._server.control.end()
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()


def is_loopback(host: str) -> bool:
    """Whether only programs on this computer reach `host`."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class _Server(ThreadingHTTPServer):
    daemon_threads = False  # `server_close` waits for those that answer
    request_queue_size = 2 * MOST_CLIENTS  # a system turns those away for whom there is no place to wait

    def __init__(self, address: TcpAddress, control: Doer, token: str) -> None:
        self.control, self.token = control, token
        found = socket.getaddrinfo(address.host, address.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
        self.address_family = found[0][0]
        self._room = threading.BoundedSemaphore(MOST_CLIENTS)
        self._open: set[socket.socket] = set()
        self._lock = threading.Lock()
        super().__init__((address.host, address.port), _Handler)

    def server_bind(self) -> None:
        """Without the look-up of a name that the standard library makes."""
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.socket.bind(self.server_address)
        self.server_address = self.socket.getsockname()
        self.server_name, self.server_port = str(self.server_address[0]), int(self.server_address[1])

    def process_request(self, request, client_address):  # type: ignore[no-untyped-def]
        self._room.acquire()
        with self._lock:
            self._open.add(request)
        super().process_request(request, client_address)

    def shutdown_request(self, request):  # type: ignore[no-untyped-def]
        with self._lock:
            self._open.discard(request)
        super().shutdown_request(request)
        self._room.release()

    def server_close(self) -> None:
        """Clients that have not yet said what they want are not waited for."""
        with self._lock:
            for request in self._open:
                with contextlib.suppress(OSError):
                    request.shutdown(socket.SHUT_RD)
        super().server_close()

    def handle_error(self, request: object, client_address: object) -> None:
        """A client went away while it was answered: nobody needs to know."""
        if not isinstance(sys.exception(), OSError):
            traceback.print_exc()


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    protocol_version = "HTTP/1.1"
    server_version = f"detent/{detent.__version__}"
    sys_version = ""
    timeout = QUIET

    def do_GET(self) -> None:
        """The list of verbs, or a verb that changes nothing."""
        self._answer()

    do_POST = do_PUT = do_DELETE = do_PATCH = do_HEAD = do_OPTIONS = do_GET

    def _answer(self) -> None:
        self.close_connection = True
        headers: Mapping[str, str] = {}
        try:
            status, answer = HTTPStatus.OK, self._asked()
        except _Refused as refused:
            status, headers = refused.status, refused.headers
            answer = _error(refused.what, refused.remedy)
        except AskedWrongly as error:
            status, answer = HTTPStatus.BAD_REQUEST, _error(error.what, error.remedy)
        except Ending as error:
            status, answer = HTTPStatus.SERVICE_UNAVAILABLE, _error(str(error), "start it again: detent serve")
        except OSError:
            return  # the client is gone, or has said nothing for too long
        except Exception as error:  # a fault of ours: all of it here, a line of it there
            traceback.print_exc()
            status = HTTPStatus.INTERNAL_SERVER_ERROR
            answer = _error(f"{type(error).__name__}: {error}", "what it was stands in the log of the service")
        self._send(status, answer, headers)

    def _send(self, status: HTTPStatus, answer: Answer, headers: Mapping[str, str]) -> None:
        body = (json.dumps(answer) + "\n").encode()
        self.send_response(status)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Connection", "close")
        for name, value in headers.items():
            self.send_header(name.replace("_", "-"), value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    def _asked(self) -> Answer:
        """What the request asks, done. Raises what `_answer` knows."""
        body = self._read()  # first of all: a client that has not got rid of it does not hear the answer
        self._check_sender()
        url = _split(self.path, "path")
        if url.path == "/":
            self._check_method("GET")
            return _listed()
        if url.path == "/openapi.json":
            self._check_method("GET")
            return openapi.document()
        name = url.path.strip("/")
        if name not in verbs.VERBS:
            error = verbs.unknown("verb", name, tuple(verbs.VERBS))
            raise _Refused(HTTPStatus.NOT_FOUND, error.what, error.remedy)
        self._check_method(*(["POST"] if verbs.VERBS[name].changes else ["GET", "POST"]))
        given: dict[str, object] = dict(parse_qsl(url.query, keep_blank_values=True))
        return self.server.control.call(name, given | _arguments(body))

    def _check_sender(self) -> None:
        """No pages of other sites, no names that were pointed here, no strangers."""
        host, origin = self.headers.get("Host", ""), self.headers.get("Origin")
        name = _split(f"//{host}", "host").hostname or ""
        if not self.server.token and not is_loopback(name):
            raise _Refused(HTTPStatus.FORBIDDEN, f"host {host!r} is not this one", "ask 127.0.0.1 or localhost")
        if origin is not None and origin not in (f"http://{host}", f"https://{host}"):
            raise _Refused(HTTPStatus.FORBIDDEN, f"origin {origin!r} may not ask", "this is no place for web pages")
        if self.server.token:
            scheme, _, token = self.headers.get("Authorization", "").partition(" ")
            right = hmac.compare_digest(token.strip().encode(), self.server.token.encode())
            if scheme.lower() != "bearer" or not right:
                what = "the token is wrong" if token else "a token is needed"
                remedy = f"send Authorization: Bearer TOKEN (detent control: --token or ${TOKEN})"
                raise _Refused(HTTPStatus.UNAUTHORIZED, what, remedy, WWW_Authenticate="Bearer")

    def _check_method(self, *allowed: str) -> None:
        if self.command not in allowed:
            what = f"{self.command} is not for {self.path.partition('?')[0]}"
            raise _Refused(HTTPStatus.METHOD_NOT_ALLOWED, what, f"use {allowed[-1]}", Allow=", ".join(allowed))

    def _read(self) -> bytes:
        """The body."""
        if "chunked" in self.headers.get("Transfer-Encoding", ""):
            raise _Refused(HTTPStatus.LENGTH_REQUIRED, "the body is chunked", "send a Content-Length")
        try:
            length = int(self.headers.get("Content-Length", "0"))
        except ValueError:
            length = -1
        if length < 0:
            raise _Refused(HTTPStatus.BAD_REQUEST, "Content-Length is no number", "leave it to your library")
        if length > LONGEST_BODY:
            left = min(length, MOST_IGNORED)
            while left > 0 and (ignored := self.rfile.read(min(left, LONGEST_BODY))):
                left -= len(ignored)
            remedy = f"at most {LONGEST_BODY} bytes"
            raise _Refused(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"a body of {length} bytes is too long", remedy)
        body = self.rfile.read(length)
        if len(body) < length:
            raise ConnectionError("the client went away")
        return body

    def log_message(self, format: str, *args: object) -> None:
        """Requests are not logged."""

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """What the standard library turns away itself: an error like all others."""
        self.close_connection = True
        status = HTTPStatus(code)
        if getattr(self, "command", None) is None:
            self.command = ""
        with contextlib.suppress(OSError):
            if status is HTTPStatus.NOT_IMPLEMENTED:  # a method that nobody has heard of
                status = HTTPStatus.METHOD_NOT_ALLOWED
            self._send(status, _error(message or status.phrase, "send HTTP/1.1 requests: GET / lists the verbs"), {})


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
