"""Who may speak to the workbench: a layer around the whole application, pages, files and sockets alike.

- `Host` must be an address or a name of this machine, so that no foreign name that is bent to
  point here (DNS rebinding) opens it.
- `Origin`, which browsers add, must be the workbench itself; a WebSocket and whatever changes something needs it.
- A token is needed: once in the address (``?token=``), from then on as a cookie. `detent workbench` makes one where
  none is given: loopback is open to every user of the machine.

Everything that is answered carries a policy that forbids the browser to load anything from elsewhere.
"""

import hashlib
import hmac
import socket
from collections.abc import Collection, Iterable
from http.cookies import CookieError, SimpleCookie
from ipaddress import ip_address
from urllib.parse import parse_qsl, quote, urlencode

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from detent.realtime.http import name_of, wrong_token

LOOPBACK_NAMES = ("localhost",)
SAFE_METHODS = ("GET", "HEAD", "OPTIONS")

_POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; font-src 'self' data:; connect-src 'self'; worker-src 'self' blob:; "
    "object-src 'none'; base-uri 'self'; form-action 'self'; frame-ancestors 'none'"
)
_HEADERS = (
    (b"content-security-policy", _POLICY.encode()),
    (b"x-frame-options", b"DENY"),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"same-origin"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
)


class Refusal(Exception):
    """Whoever asks is not let in. `status` is that of HTTP, the text says what to do."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status = status


def is_loopback(host: str) -> bool:
    """Whether an address or name reaches this machine alone."""
    try:
        return ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host.lower() in LOOPBACK_NAMES


def check_place(host: str, token: str | None) -> None:
    """Raises ValueError if `host` needs a token that is not there, or the token is none."""
    if token is None and not is_loopback(host):
        raise ValueError(f"--host {host} lets others in: give a word that they must know, with --token")
    if token is not None and (wrong := wrong_token(token)):
        raise ValueError(f"--token: {wrong}")


class Guard:
    """The application behind its checks. `host` is what it listens on."""

    def __init__(self, app: ASGIApp, host: str, token: str | None = None, names: Collection[str] = ()) -> None:
        """`names`: what this machine is called besides its addresses. Raises as `check_place`."""
        check_place(host, token)
        self.app, self._token = app, token  # `app` is a name that NiceGUI follows to find its server
        self._names = {name.lower() for name in names}
        self._only_loopback = is_loopback(host)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let the request through, or answer it with the reason why not."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        headers = [(name.decode("latin-1").lower(), value.decode("latin-1")) for name, value in scope["headers"]]
        try:
            self.check_origin(scope["type"], scope.get("method", "GET"), headers)
            let_in = self.check_token(scope.get("query_string", b"").decode("latin-1"), headers)
        except Refusal as refusal:
            await _refuse(scope, receive, send, refusal)
            return
        if let_in and scope["type"] == "http" and scope["method"] in ("GET", "HEAD"):
            await self._welcome(scope, headers, send)
            return

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                message = {**message, "headers": [*message.get("headers", ()), *_HEADERS]}
            await send(message)

        await self.app(scope, receive, guarded if scope["type"] == "http" else send)

    def check_origin(self, kind: str, method: str, headers: Iterable[tuple[str, str]]) -> None:
        """Check Host and Origin of a request (`kind` is "http" or "websocket"). Raises Refusal."""
        values = list(headers)
        hosts = [value for name, value in values if name == "host"]
        if len(hosts) != 1 or not self._known(name_of(hosts[0])):
            raise Refusal(403, "This is no name of the machine that Detent runs on; use the address that it printed.")
        origins = [value for name, value in values if name == "origin"]
        if not origins:
            if kind == "websocket" or method not in SAFE_METHODS:
                raise Refusal(403, "The request does not say which page it comes from (Origin).")
            return
        own = [f"{scheme}://{hosts[0].lower()}" for scheme in ("http", "https")]
        if len(origins) != 1 or origins[0].lower() not in own:
            raise Refusal(403, "The request comes from a page of another origin.")

    def check_token(self, query: str, headers: Iterable[tuple[str, str]]) -> bool:
        """Check the cookie, or the token in the query; True: it was in the query. Raises Refusal."""
        if self._token is None:
            return False
        for name, value in parse_qsl(query):
            if name == "token":
                if hmac.compare_digest(_digest(value), _digest(self._token)):
                    return True
                raise Refusal(401, "The token is wrong; use the address that Detent printed.")
        for name, value in headers:
            if name == "cookie" and hmac.compare_digest(_cookie(value, self._cookie_name).encode(), self._cookie):
                return False
        raise Refusal(401, "A token is needed: open the address that Detent printed, with ?token= at its end.")

    @property
    def _cookie_name(self) -> str:
        assert self._token is not None
        return "detent-" + hashlib.sha256(b"name " + self._token.encode()).hexdigest()[:8]  # cookies know no ports

    @property
    def _cookie(self) -> bytes:
        assert self._token is not None
        return hashlib.sha256(b"detent workbench " + self._token.encode()).hexdigest().encode()

    def _known(self, name: str) -> bool:
        """Whether a host name in a request can be ours."""
        if is_loopback(name):
            return True
        if self._only_loopback:
            return False
        try:
            ip_address(name)
        except ValueError:
            return name.lower() in self._names
        return True  # an address is never a foreign name that was bent to point here

    async def _welcome(self, scope: Scope, headers: Iterable[tuple[str, str]], send: Send) -> None:
        """Put the token into a cookie and lead to the same place without it."""
        left = [pair for pair in parse_qsl(scope["query_string"].decode("latin-1")) if pair[0] != "token"]
        # only a path: two slashes at its beginning would lead to another host, and browsers drop tabs and line ends
        # between them
        place = "/" + quote(scope["path"].lstrip("/\\"), errors="replace") + (f"?{urlencode(left)}" if left else "")
        cookie = f"{self._cookie_name}={self._cookie.decode()}; Path=/; HttpOnly; SameSite=Lax; Max-Age=2592000"
        answer = [
            (b"location", place.encode()),
            (b"set-cookie", cookie.encode()),
            (b"cache-control", b"no-store"),
            *_HEADERS,
        ]
        await send({"type": "http.response.start", "status": 303, "headers": answer})
        await send({"type": "http.response.body", "body": b""})


def names_of_this_machine() -> tuple[str, ...]:
    """What this machine calls itself."""
    name = socket.gethostname()
    return (name, name.partition(".")[0], f"{name.partition('.')[0]}.local")


def _digest(text: str) -> bytes:
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).digest()


def _cookie(header: str, name: str) -> str:
    try:
        jar: SimpleCookie = SimpleCookie(header)
    except CookieError:
        return ""
    return jar[name].value if name in jar else ""


async def _refuse(scope: Scope, receive: Receive, send: Send, refusal: Refusal) -> None:
    if scope["type"] == "websocket":
        await receive()  # the connection that is asked for
        await send({"type": "websocket.close", "code": 1008, "reason": str(refusal)})
        return
    headers = [(b"content-type", b"text/plain; charset=utf-8"), *_HEADERS]
    await send({"type": "http.response.start", "status": refusal.status, "headers": headers})
    await send({"type": "http.response.body", "body": f"{refusal}\n".encode()})
