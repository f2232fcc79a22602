"""The web server of the workbench: who says nothing, or half of something, is in nobody's way."""

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator, Callable, Coroutine
from typing import Any

import pytest
import uvicorn

from detent.workbench import connections
from detent.workbench.connections import MOST, LimitedConnection


async def everything(scope: Any, receive: Any, send: Any) -> None:
    """An application that answers everybody, and lets every socket in."""
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.accept"})
        await receive()
        return
    await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"2")]})
    await send({"type": "http.response.body", "body": b"in"})


@contextlib.asynccontextmanager
async def served() -> AsyncIterator[tuple[str, int]]:
    listener = socket.create_server(("127.0.0.1", 0), backlog=512)
    config = uvicorn.Config(everything, http=LimitedConnection, log_level="error", lifespan="off", ws="wsproto")
    server = uvicorn.Server(config)
    server.capture_signals = contextlib.nullcontext  # type: ignore[method-assign, assignment]
    serving = asyncio.create_task(server.serve(sockets=[listener]))
    try:
        yield listener.getsockname()[:2]
    finally:
        server.should_exit = True
        server.force_exit = True
        await serving


Talk = Callable[[str, int], Coroutine[Any, Any, None]]


def run(talk: Talk) -> None:
    async def all_of_it() -> None:
        async with served() as (host, port):
            await talk(host, port)

    asyncio.run(all_of_it())


async def say(host: str, port: int, data: bytes) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    reader, writer = await asyncio.open_connection(host, port)
    writer.write(data)
    await writer.drain()
    return reader, writer


WHOLE = b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"


def test_more_who_say_half_of_something_than_there_are_places_keep_nobody_out() -> None:
    async def talk(host: str, port: int) -> None:
        slow = [await say(host, port, b"GET / HT") for _ in range(MOST + 20)]
        reader, writer = await say(host, port, WHOLE)
        assert (await reader.readuntil(b"in")).startswith(b"HTTP/1.1 200 ")
        assert len(LimitedConnection.open) <= MOST
        assert await slow[0][0].read() == b"", "the first of them has kept a place for longest"
        for _, one in (*slow, (reader, writer)):
            one.close()

    run(talk)


@pytest.mark.parametrize("said", [b"", b"GET / HT"])
def test_who_does_not_say_in_time_what_he_wants_leaves(said: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "QUIET", 0.01)

    async def talk(host: str, port: int) -> None:
        reader, writer = await say(host, port, said)
        heard = b""
        with contextlib.suppress(ConnectionError):
            heard = await reader.read()
        assert heard.count(b"HTTP/1.1 200 ") == said.count(WHOLE)
        writer.close()

    run(talk)


def test_an_open_window_is_left_alone() -> None:
    async def talk(host: str, port: int) -> None:
        key = b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
        head = b"GET /live HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n" + key + b"\r\n"
        reader, writer = await say(host, port, head)
        assert (await reader.readuntil(b"\r\n\r\n")).startswith(b"HTTP/1.1 101 ")
        assert not LimitedConnection.open
        writer.close()

    run(talk)
