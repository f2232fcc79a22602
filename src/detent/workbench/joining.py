"""How the process of the engine gets its end of the pipe.

Where a child inherits descriptors it is given one of a pair of sockets, and nobody else can come between. Elsewhere it
connects to a socket that listens on loopback for it alone: it proves itself by a secret that it is told on its standard
input, where no other user reads it, and whoever else comes is sent away unheard.
"""

import asyncio
import contextlib
import hmac
import secrets
import socket
import sys
from asyncio.subprocess import DEVNULL, PIPE, Process

from detent.realtime import system

SECRET = 32  # bytes
PATIENCE = 60.0  # seconds that a process may take to start and to come
_MODULE = ("-P", "-m", "detent.workbench.process")


async def started() -> tuple[Process, socket.socket]:
    """A process of the engine, and our end of the pipe to it. Raises OSError, TimeoutError."""
    return await (_inheriting() if system.INHERITS else _coming())


def joined(words: list[str]) -> socket.socket:
    """The engine's own end, by what stands on its command line. Raises OSError."""
    kind, number = words
    if kind == "descriptor":
        return socket.socket(fileno=int(number))
    end = socket.create_connection(("127.0.0.1", int(number)))
    end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    end.sendall(sys.stdin.buffer.read(SECRET))
    return end


async def _inheriting() -> tuple[Process, socket.socket]:
    ours, theirs = socket.socketpair()
    with theirs:
        # a session of its own: Ctrl-C at the terminal is for the workbench, which then ends it
        process = await asyncio.create_subprocess_exec(
            sys.executable, *_MODULE, "descriptor", str(theirs.fileno()), pass_fds=(theirs.fileno(),),
            stdin=DEVNULL, stdout=DEVNULL, start_new_session=True,
        )  # fmt: skip
    ours.setblocking(False)
    return process, ours


async def _coming() -> tuple[Process, socket.socket]:
    secret = secrets.token_bytes(SECRET)
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen(8)
        listener.setblocking(False)
        process = await asyncio.create_subprocess_exec(
            sys.executable, *_MODULE, "loopback", str(listener.getsockname()[1]), stdin=PIPE, stdout=DEVNULL
        )
        assert process.stdin is not None
        process.stdin.write(secret)
        process.stdin.close()
        try:
            return process, await asyncio.wait_for(_who_knows(secret, listener), PATIENCE)
        except BaseException:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()
            raise


async def _who_knows(secret: bytes, listener: socket.socket) -> socket.socket:
    """The first who comes and says the secret. Several may say something else, or nothing, meanwhile."""
    loop, found = asyncio.get_running_loop(), asyncio.Queue[socket.socket]()

    async def hear(end: socket.socket) -> None:
        said = bytearray()
        try:
            with contextlib.suppress(OSError):
                while len(said) < SECRET and (more := await loop.sock_recv(end, SECRET - len(said))):
                    said += more
        finally:
            if hmac.compare_digest(bytes(said), secret):
                end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                found.put_nowait(end)
            else:
                end.close()

    async def let_in() -> None:
        async with asyncio.TaskGroup() as heard:
            while True:
                end, _ = await loop.sock_accept(listener)
                heard.create_task(hear(end))

    door = asyncio.create_task(let_in())
    try:
        return await found.get()
    finally:
        door.cancel()
        await asyncio.gather(door, return_exceptions=True)
