"""The feed of the Scope page: a WebSocket on which a window asks for a view and gets frames, as fast as it paints them.

A window sends JSON: ``{"view": ...}`` (`View`), ``{"find": ...}`` (`Find`), ``{"export": ...}`` (`Export`), and an
empty message when a frame is painted. It gets JSON with the traces there are and with answers, and frames: binary, as
`frame` packs them. A window that is slow or hidden gets fewer frames, never a queue.
"""

import asyncio
import contextlib
import json
import math
import re
import struct
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Final, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from starlette.websockets import WebSocket, WebSocketDisconnect

from detent.ticks import Ns
from detent.workbench.live import MISTAKES
from detent.workbench.scope import ScopeData, Trace, Trigger

if TYPE_CHECKING:
    from detent.workbench.client import Bench

PATH: Final = "/scope-feed"
FRAME: Final = 1 / 25  # s from a frame to the next, at least
LONGEST: Final = 1 << 16  # characters of a message from a window
MOST_MARKS: Final = 200  # in a frame
BEFORE: Final = 0.25  # of the view lies before the trigger
MOST_FOUND: Final = 1_000_000  # times of a trigger that one search brings
PIN_KINDS: Final = {"rise": ("rise",), "fall": ("fall",), "both": ("edge",)}  # of `Trigger`
CURVE_KINDS: Final = {"rise": ("up",), "fall": ("down",), "both": ("up", "down")}
LOOK_BACK: Final = 40  # views that a trigger, once set, is looked for in the past

Instant = Annotated[int, Field(ge=-(1 << 62), le=1 << 62)]


class _Message(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True)


class TriggerCondition(_Message):
    """A trigger as a window sets it: an edge of a pin, a curve that crosses `level`, or ``error``."""

    source: str
    edge: Literal["rise", "fall", "both"] = "rise"
    level: float = 0.0


class View(_Message):
    """What a window shows: `traces` by key, from `begin` to `end`, or as much time before the present (`follow`)."""

    traces: Annotated[tuple[str, ...], Field(max_length=64)]
    points: Annotated[int, Field(ge=50, le=8000)]  # columns of pixels
    follow: bool
    begin: Instant
    end: Instant
    cursors: tuple[Instant | None, Instant | None] = (None, None)
    trigger: TriggerCondition | None = None  # holds a view that follows


class Find(TriggerCondition):
    """Ask for the next moment from `begin` on (`direction` 1), or the one before (-1), at which the trigger is met."""

    begin: Annotated[Instant, Field(alias="from")]
    direction: Literal[1, -1]


class Export(_Message):
    """Ask for a file."""

    kind: str
    traces: tuple[str, ...]
    begin: Instant
    end: Instant


class Feed:
    """What one window is sent."""

    def __init__(self, bench: "Bench", socket: WebSocket) -> None:
        self._bench, self._socket = bench, socket
        self._view: View | None = None
        self._stale = asyncio.Event()  # there is something new to show
        self._painted = asyncio.Event()  # the window has dealt with the last frame
        self._painted.set()
        self._exporting: asyncio.Task[None] | None = None
        self._picture: object = None
        self._traces: dict[str, Trace] = {}
        self._shown: tuple[Ns, int] | None = None  # the present of the last frame, and the cut of the bench then
        self._found: Ns | None = None  # where the trigger was met last
        self._searched: tuple[TriggerCondition, int, Ns] | None = None  # trigger, cut, and up to when it was looked for

    async def serve(self) -> None:
        """From the socket's opening to its end."""
        await self._socket.accept()
        forget = self._bench.on_change(self._changed)
        sender = asyncio.create_task(self._send())
        try:
            while True:
                text = await self._socket.receive_text()
                if not text:
                    self._painted.set()
                elif len(text) <= LONGEST:
                    await self._hear(text)
        except (WebSocketDisconnect, RuntimeError, KeyError):  # gone, or it sent what is no text
            pass
        finally:
            forget()
            tasks = {sender} if self._exporting is None else {sender, self._exporting}
            for task in tasks:
                task.cancel()
            await asyncio.wait(tasks)

    # -- what the window says ------------------------------------------------------------------------------

    async def _hear(self, text: str) -> None:
        try:
            said = json.loads(text)
            if "view" in said:
                self._view = View.model_validate(said["view"])
                self._stale.set()
            elif "find" in said:
                found = self._find(Find.model_validate(said["find"]))
                await self._socket.send_text(json.dumps({"found": found}))
            elif "export" in said:
                wanted = Export.model_validate(said["export"])
                if self._exporting is not None and not self._exporting.done():
                    raise ValueError("an export is under way: wait for it")
                self._exporting = asyncio.create_task(self._export(wanted))
        except ValidationError as error:
            await self._wrong(error.errors()[0]["msg"])
        except MISTAKES as error:
            await self._wrong(str(error.args[0] if error.args else error))

    async def _wrong(self, words: str) -> None:
        await self._socket.send_text(json.dumps({"error": words}))

    async def _export(self, wanted: Export) -> None:
        """Send a file, beside the frames."""
        picture = self._bench.picture
        name = re.sub(r"[^A-Za-z0-9]+", "-", picture.title or picture.target).strip("-").lower()[:40] or "cell"
        words = ""
        try:
            data = await self._bench.export(wanted.kind, max(wanted.begin, 0), wanted.end, wanted.traces)
        except MISTAKES as error:
            words = str(error.args[0] if error.args else error)
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            if words:
                await self._wrong(words)
            else:
                await self._socket.send_bytes(packed({"file": f"{name}.{wanted.kind}"}, [data]))

    def _find(self, wanted: Find) -> Ns | None:
        """The time of the nearest one in that direction."""
        state = self._bench.state
        if wanted.direction > 0:
            found = self._search(wanted, wanted.begin + 1, state.now, 1)
            return found[0] if found else None
        high, width = min(wanted.begin - 1, state.now), 1_000_000_000
        while high >= state.begin:
            low = max(high - width, state.begin)
            found = self._search(wanted, low, high, MOST_FOUND)
            if found:
                return found[-1]
            high, width = low - 1, width * 4
        return None

    # -- what it is sent -----------------------------------------------------------------------------------

    def _changed(self) -> None:
        """The bench has something new; it is sent if the view can show it."""
        state, view = self._bench.state, self._view
        present = state.now, self._bench.cut
        if self._bench.picture is not self._picture or (
            view is not None and present != self._shown and (view.follow or self._reaches(view.end, state.now))
        ):
            self._stale.set()

    def _reaches(self, end: Ns, now: Ns) -> bool:
        """Whether something before `end` is new."""
        return self._shown is None or self._shown[1] != self._bench.cut or min(self._shown[0], now) < end

    async def _send(self) -> None:
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            await self._tell_traces()
            while True:
                await self._stale.wait()
                await self._painted.wait()
                self._stale.clear()
                if self._bench.picture is not self._picture:  # before anything is drawn of it
                    await self._tell_traces()
                if self._view is None:
                    continue
                try:
                    packed_frame = self._frame(self._view)
                except MISTAKES as error:  # of this view: the window may ask for another
                    await self._wrong(str(error.args[0] if error.args else error))
                    continue
                self._painted.clear()
                await self._socket.send_bytes(packed_frame)
                await asyncio.sleep(FRAME)

    async def _tell_traces(self) -> None:
        """The traces there are, and which of them a window shows that has not chosen."""
        bench = self._bench
        self._picture = bench.picture
        self._traces = {trace.key: trace for trace in bench.traces}
        rows = [
            {
                "id": trace.key, "unit": owner(trace), "name": trace.name, "title": trace.help, "units": trace.measure,
                "level": trace.digital, "shape": shape(trace), "lane": lane(trace),
            }
            for trace in bench.traces
        ]  # fmt: skip
        wired = [wire.source for wire in bench.picture.wires]
        news = {"cell": bench.picture.target, "traces": rows, "first": first_traces(bench.traces, wired)}
        await self._socket.send_text(json.dumps(news))

    def _frame(self, view: View) -> bytes:
        bench, state = self._bench, self._bench.state
        begin, end = view.begin, max(view.end, view.begin + 1)
        span = end - begin
        trigger = None
        if view.follow:
            begin, end = state.now - span, state.now
            if view.trigger is not None:
                trigger = self._last_trigger(view.trigger, span)
                if trigger is not None:
                    begin = trigger - round(span * BEFORE)
                    end = begin + span
        keys = [key for key in view.traces if key in self._traces]
        data = bench.scope(keys, begin, end, view.points)
        readings = [self._readings(key, view) for key in keys]
        self._shown = state.now, bench.cut
        marks = [{"at": mark.at, "kind": mark.kind} for mark in state.marks if begin <= mark.at <= end][-MOST_MARKS:]
        header = {
            "from": begin, "to": end, "now": state.now, "first": state.begin, "trigger": trigger, "marks": marks,
        }  # fmt: skip
        return frame(header, keys, readings, data)

    def _readings(self, key: str, view: View) -> tuple[float | None, float | None]:
        """The exact values at the cursors; without any, of the present."""
        first, second = view.cursors
        if first is None and second is None:
            return self._value(key, self._bench.state.now), None
        return self._value(key, first), self._value(key, second)

    def _value(self, key: str, at: Ns | None) -> float | None:
        value = math.nan if at is None else self._bench.value_at(key, at)
        return None if math.isnan(value) else value

    def _last_trigger(self, wanted: TriggerCondition, span: Ns) -> Ns | None:
        """Where the trigger was met last, so long ago that what follows fills the view."""
        if wanted.source != "error" and wanted.source not in self._traces:
            return None  # of a cell that was shown before
        state, cut = self._bench.state, self._bench.cut
        until = state.now - round(span * (1 - BEFORE))
        if self._searched is None or self._searched[:2] != (wanted, cut) or self._searched[2] > until:
            self._found, begin = None, max(state.begin, until - LOOK_BACK * span)
        else:
            begin = self._searched[2] + 1
        self._searched = wanted, cut, until
        if begin <= until:
            met = self._search(wanted, begin, until, MOST_FOUND)
            self._found = met[-1] if met else self._found
        return self._found

    def _search(self, wanted: TriggerCondition, begin: Ns, end: Ns, most: int) -> list[Ns]:
        """When the trigger is met, in order. ValueError for a trace that there is not."""
        if wanted.source == "error":
            return self._bench.search(Trigger("error"), begin, end, most)
        trace = self._traces.get(wanted.source)
        if trace is None:
            raise ValueError(f"there is no trace {wanted.source!r}")
        kinds = PIN_KINDS[wanted.edge] if trace.digital else CURVE_KINDS[wanted.edge]
        triggers = (Trigger(kind, wanted.source, wanted.level) for kind in kinds)
        return sorted({at for trigger in triggers for at in self._bench.search(trigger, begin, end, most)})


def owner(trace: Trace) -> str:
    """Whose it is, in words: of two motors of a unit each has a name of its own."""
    return trace.unit if trace.digital else trace.key.rpartition(".")[0]


def shape(trace: Trace) -> str:
    """How it is drawn: what changes by pulses or edges holds its value, a speed or a current runs on."""
    return "step" if trace.digital or trace.name in ("position", "pulses") else "line"


def lane(trace: Trace) -> str:
    """Traces of one lane share it: the two phase currents of a motor do."""
    return f"{trace.unit}.{trace.name.rpartition('_')[0]}" if trace.name in ("current_a", "current_b") else trace.key


def first_traces(traces: Sequence[Trace], wired: Sequence[str]) -> list[str]:
    """What a window shows that has not chosen: speeds, a position, a motor's torque, and the wires between units."""
    speeds = [trace.key for trace in traces if trace.name == "speed"][:2]
    position = [trace.key for trace in traces if trace.name == "position"][:1]
    torque = [trace.key for trace in traces if trace.name == "torque"][:1]
    wires = [trace.key for trace in traces if trace.digital and trace.key in wired][:4]
    chosen = {*speeds, *position, *torque, *wires}
    return [trace.key for trace in traces if trace.key in chosen]


def frame(
    header: Mapping[str, object], keys: Sequence[str], readings: Sequence[tuple[float | None, float | None]],
    data: ScopeData,
) -> bytes:  # fmt: skip
    """A frame: the columns of each trace as float32 above its base, which is the first value that is known."""
    traces, parts = [], []
    for row, (key, reading) in enumerate(zip(keys, readings, strict=True)):
        low, high = data.low[row], data.high[row]
        known = low[np.isfinite(low)]
        base = float(known[0]) if len(known) else 0.0
        traces.append({"id": key, "base": base, "values": reading})
        parts += [(values - base).astype("<f4").tobytes() for values in (low, high)]
    columns = {"begin": data.begin, "width": data.width, "count": data.columns, "traces": traces}
    return packed({**header, **columns}, parts)


def packed(header: Mapping[str, object], parts: Sequence[bytes]) -> bytes:
    """Length of the header (uint32, little-endian), the header as JSON, zeros to a multiple of 8, then the parts."""
    text = json.dumps(header).encode()
    filling = -(4 + len(text)) % 8
    return b"".join((struct.pack("<I", len(text)), text, bytes(filling), *parts))
