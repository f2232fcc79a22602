"""The web server of the workbench: one bench, its pages, and nothing that is loaded from elsewhere."""

import asyncio
import contextlib
import hashlib
import socket
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import nicegui
import uvicorn
from fastapi import FastAPI, WebSocket
from fastapi.staticfiles import StaticFiles
from nicegui import ui

import detent
from detent.realtime.endpoints.endpoint import OUT_OF_DESCRIPTORS
from detent.realtime.polling import allow_many
from detent.realtime.system import ended_by_signals
from detent.workbench import filing, shell
from detent.workbench.beginning import Beginning
from detent.workbench.board import Board
from detent.workbench.connections import LimitedConnection
from detent.workbench.drafts import Drafts
from detent.workbench.folder import Folder
from detent.workbench.guard import Guard, names_of_this_machine
from detent.workbench.listening import Listening, Place
from detent.workbench.live import Live
from detent.workbench.pages import Page, Window, begin, cell, motion, program, scope, terminal, unit
from detent.workbench.stopping import Stopping
from detent.workbench.stops import BOARDS
from detent.workbench.units.registry import Units

if TYPE_CHECKING:
    from detent.workbench.client import Bench

PAGES: tuple[Page, ...] = (
    cell.PAGE, program.PAGE, terminal.PAGE, scope.PAGE, motion.PAGE, unit.PAGE, begin.PAGE,
)  # fmt: skip
"""The pages in the order of their tabs."""

PATIENCE = 1  # s that open windows are given when the server ends


def application(bench: "Bench", folder: Folder, drafts: Drafts, place: Place, state: Path) -> tuple[Guard, Units]:
    """The pages of `bench` behind their guard, an ASGI application; and who talks to real units, to be closed after it.

    Once in a process: NiceGUI has but one. What a restore replaces in a unit is kept below `state`. Raises ValueError
    for an address that needs a token.
    """
    live = Live()
    stopping = Stopping(live)
    if bench.state.real is not None:

        async def stop_boards() -> str:
            await bench.stop_motors()
            return "every board has stopped, and its axes stand until somebody says Recover"

        stopping.add(BOARDS, stop_boards)
        bench.check_moves = partial(live.stops.check, BOARDS)
    units = Units(live, stopping, folder, state)
    units.follow(bench)
    site = FastAPI(title="Detent", docs_url=None, redoc_url=None, openapi_url=None)
    guard = Guard(site, place.host, place.token, names_of_this_machine())
    Board(bench, live)
    filing.offer(live, folder, drafts)
    Beginning(bench, live, folder, drafts)

    async def live_socket(socket: WebSocket) -> None:
        await live.serve(socket)

    site.add_api_websocket_route("/live", live_socket)
    with as_file(files("detent.workbench") / "assets") as assets:
        site.mount("/assets", StaticFiles(directory=assets))
        version = _version(assets)
    for page in PAGES:
        if page.offer is not None:
            page.offer(site, bench, live)
    ui.add_head_html(shell.head(PAGES, version), shared=True)

    def root() -> None:
        window = Window(bench)
        ui.context.client.on_delete(window.leave)
        shell.build(window, PAGES)

    icon = "data:image/svg+xml;utf8," + shell.FAVICON
    ui.run_with(site, root=root, title="Detent", favicon=icon, dark=None, tailwind=False, show_welcome_message=False,
                reconnect_timeout=20, binding_refresh_interval=None, language="en-US")  # fmt: skip
    return guard, units


async def serve(application: Guard, listening: Listening, ready: Callable[[], None]) -> None:
    """Serve until SIGINT, SIGTERM or SIGHUP. `ready` is called once a browser may come."""
    config = uvicorn.Config(
        application, http=LimitedConnection, log_level="error", lifespan="on", ws="wsproto",
        ws_per_message_deflate=False, timeout_graceful_shutdown=PATIENCE, access_log=False, server_header=False,
        ws_max_size=4 << 20,
    )  # fmt: skip
    server = _Server(config)
    loop = asyncio.get_running_loop()
    loop.set_exception_handler(_told)
    allow_many()
    with ended_by_signals(loop, server.end):
        serving = asyncio.create_task(server.serve(sockets=[listening.socket]))
        telling = asyncio.create_task(server.told_started(ready))
        try:
            await serving
        finally:
            telling.cancel()


def _told(loop: asyncio.AbstractEventLoop, told: dict[str, Any]) -> None:
    """What goes wrong beside everything; not that descriptors run out, which a client may bring about at will."""
    error = told.get("exception")
    if not isinstance(error, OSError) or error.errno not in OUT_OF_DESCRIPTORS:
        loop.default_exception_handler(told)


class _Server(uvicorn.Server):
    """A server that leaves signals to us and says when it has started."""

    def __init__(self, config: uvicorn.Config) -> None:
        super().__init__(config)
        self._up = asyncio.Event()

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self._up.set()

    async def told_started(self, ready: Callable[[], None]) -> None:
        """Call `ready` once the server has started."""
        await self._up.wait()
        ready()

    def end(self) -> None:
        """End soon: open windows get `PATIENCE`."""
        self.should_exit = True

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield


def _version(assets: Path) -> str:
    """Some digits that change when an asset or NiceGUI does, so that browsers may keep what they have."""
    digest = hashlib.sha256(f"{detent.__version__} {nicegui.__version__}".encode())
    contents: Mapping[str, bytes] = {path.name: path.read_bytes() for path in sorted(assets.iterdir())}
    for name, data in contents.items():
        digest.update(name.encode() + data)
    return digest.hexdigest()[:10]
