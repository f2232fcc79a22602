"""The Scope page: speeds, positions, pins, currents and torques over time; see ``assets/scope.js``."""

from typing import TYPE_CHECKING

from starlette.websockets import WebSocket

from detent.workbench.pages import Page, Window
from detent.workbench.scope_feed import PATH, Feed

if TYPE_CHECKING:
    from fastapi import FastAPI

    from detent.workbench.client import Bench
    from detent.workbench.live import Live


def build(bench: "Bench", window: Window) -> None:
    """The place in which the script builds the scope. Each window has its own view, so nothing of it is kept here."""
    from nicegui import ui

    ui.html(
        f'<section class="scope" data-part="scope" data-feed="{PATH}" aria-label="Scope"></section>', sanitize=False
    ).classes("scope-page")


def offer(site: "FastAPI", bench: "Bench", live: "Live") -> None:
    """The feed of the traces."""

    async def feed(socket: WebSocket) -> None:
        await Feed(bench, socket).serve()

    site.add_api_websocket_route(PATH, feed)


PAGE = Page("Scope", "/scope", "scope", build, ("scope.js",), ("scope.css",), offer)
