"""The engine's way to the workbench where it inherits no descriptor: only who knows the secret is let in."""

import asyncio
import pickle
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from detent.realtime import system
from detent.workbench import joining

SECRET = bytes(range(joining.SECRET))


@asynccontextmanager
async def door() -> AsyncIterator[tuple[int, "asyncio.Task[socket.socket]"]]:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.setblocking(False)
        waiting = asyncio.create_task(joining._who_knows(SECRET, listener))
        yield listener.getsockname()[1], waiting
        (await waiting).close()


async def said(port: int, words: bytes) -> bytes:
    """What somebody hears who says this and nothing more."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(words)
    writer.write_eof()
    try:
        heard = await reader.read()
    except ConnectionError:
        heard = b""
    writer.close()
    return heard


@pytest.mark.parametrize(
    "words", [b"", b"GET / HTTP/1.1\r\n\r\n", SECRET[:-1], SECRET[:-1] + b"?", pickle.dumps("x") * 9]
)
def test_who_says_something_else_is_sent_away_unheard(words: bytes) -> None:
    async def scene() -> None:
        async with door() as (port, waiting):
            assert await said(port, words) == b""
            assert not waiting.done()
            _, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(SECRET)
            await waiting
            writer.close()

    asyncio.run(scene())


def test_who_says_nothing_keeps_nobody_waiting() -> None:
    async def scene() -> None:
        async with door() as (port, waiting):
            _, silent = await asyncio.open_connection("127.0.0.1", port)
            _, writer = await asyncio.open_connection("127.0.0.1", port)
            for byte in SECRET:  # however it is cut
                writer.write(bytes([byte]))
                await writer.drain()
            await waiting
            assert not silent.is_closing()
            silent.close()
            writer.close()

    asyncio.run(scene())


@pytest.mark.parametrize("inherits", [True, False])
def test_an_engine_comes_either_way_and_ends_with_its_pipe(inherits: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(system, "INHERITS", inherits)

    async def scene() -> int:
        process, ours = await joining.started()
        ours.close()
        return await process.wait()

    assert asyncio.run(scene()) == 0
