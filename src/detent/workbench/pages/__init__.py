"""The pages of the workbench, and the conventions that they share.

A page is a module here with a function ``build(bench, window) -> None``, called within NiceGUI's slot for the page
each time a window comes to it, and an entry in `detent.workbench.server.PAGES`. The shell around it (title, tabs,
the bar with the time line) belongs to `detent.workbench.shell`. Neither Tailwind nor NiceGUI's storage is used.

**What changes.** The bench pushes its state to one place (`detent.workbench.live.Live`), about 20 times a second;
all windows get the same changes, as keys and values (see `detent.workbench.board.table` for the keys). Markup binds
itself to keys, and nothing has to be registered or let go:

- ``data-live="KEY"``: the text of the element is the value; ``data-form="time|steps|rate|level|..."`` says how
- ``data-level="KEY"``: its attribute ``data-value`` is the value, for style sheets
- ``data-var="KEY"``: its custom property ``--value`` is the value, for transforms
- ``data-pressed="KEY"``: ``aria-pressed`` (of a switch ``aria-checked``) says whether the value is true
- ``data-help="TEXT"``: help when one hovers, focuses or holds it
- ``data-do="CALL" data-args='["bar", "!u.bar.powered"]'``: a click makes the call; ``"!KEY"`` stands for the
  opposite of what KEY is, ``"=KEY"`` for what it is

A script is a module in ``assets/`` that the page names in its entry; it gets hold of elements by
``detent.part(NAME, setup)``: `setup` is called with every element that has ``data-part="NAME"`` when it appears and
may return a function for its end. ``detent.on(PREFIX, f)`` calls f(key, value) for changes, ``detent.frame(f)`` once
after each push, ``detent.get(KEY)`` tells a value, ``await detent.call(NAME, ...args)`` makes a call,
``detent.toast(text, "error")`` says something, ``detent.failed(error)`` what was thrown,
``detent.onTheme(f)`` calls f("light" or "dark") now and at each change.

In Python, `Window.each_state` calls back at each push as long as the page is shown, `Window.each_picture` when the
cell is another, and `Live.offer` adds a call for scripts; what a call raises is shown to the person who made it.

**Looks.** Colours, sizes and type are the custom properties at the top of ``assets/workbench.css`` (``--panel``,
``--ink``, ``--ink-2``, ``--line``, ``--accent``, ``--led-on``, ``--trace-1`` to ``--trace-8`` and more), which follow
the theme: no other colours. Shared classes: ``panel``, ``panel-head``, ``readout``, ``key`` (a button; ``key small``,
``key primary``), ``led``, ``mono``, ``quiet``, ``field``, ``row``, ``grow``, ``scroll-x``. A page must not be wider
than its window at 390 px, and what is tapped is at least 36 px high there
(``@media (pointer: coarse), (max-width: 560px)``).
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from fastapi import FastAPI

    from detent.workbench.client import Bench
    from detent.workbench.live import Live
    from detent.workbench.messages import Picture


STOP_KEY = """<button type="button" class="key stop" data-part="stop" hidden
  data-help="Stop every unit that is connected, and every board (Esc twice); again: at once">STOP</button>"""
"""The red key. Above every page there is one; a dialog that covers it has one of its own."""


class Page(NamedTuple):
    """A page: its name on the tab, its path, the name of its icon in `workbench.icons`, how it is built.

    `scripts` and `styles` are files in ``assets/``; `offer` is called once, when the server starts, and adds what
    the page needs of routes and calls.
    """

    name: str
    path: str
    icon: str
    build: "Callable[[Bench, Window], None]"
    scripts: tuple[str, ...] = ()
    styles: tuple[str, ...] = ()
    offer: "Callable[[FastAPI, Bench, Live], None] | None" = None


class Window:
    """One browser window, as long as it is open."""

    def __init__(self, bench: "Bench") -> None:
        self.bench = bench
        self._leave: list[Callable[[], None]] = []

    def each_state(self, handler: Callable[[], None]) -> None:
        """Call `handler` at each push of the bench's state, until the page is left or the window closed."""
        self._leave.append(self.bench.on_change(handler))

    def each_picture(self, part: "Callable[[Picture], object]", handler: Callable[[], object]) -> None:
        """The same whenever `part` of the picture of the cell is another: where another cell is shown, say."""
        seen, before = self.bench.picture, part(self.bench.picture)

        def look() -> None:
            nonlocal seen, before
            if self.bench.picture is not seen:
                seen, last = self.bench.picture, before
                before = part(seen)
                if before != last:
                    handler()

        self.each_state(look)

    def leave(self) -> None:
        """The page is left: everything that it asked for ends."""
        handlers, self._leave = self._leave, []
        for handler in handlers:
            handler()
