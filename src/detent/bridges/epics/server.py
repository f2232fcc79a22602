"""Channel Access as a motor record needs it: nothing that a client sends ends the server, and puts keep their order.

caproto hands a monitor from queue to queue, and answers a put past them. Here the answer to a put stands in the same
line as the monitors of its circuit, behind those that came before it: a client that has waited for its put has seen
all that the put did. What clients hold has a bound, and each gets its turn: none keeps another's STOP waiting.
"""

import asyncio
import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any, Final
from weakref import ref

import caproto
from caproto import CAStatus
from caproto.asyncio import server
from caproto.server.common import DisconnectedCircuit

from detent.bridges.epics.client_limits import CLIENTS, ClientLimits
from detent.bridges.epics.values import Refused, not_whole

OFTEN: Final = 10  # lines about what clients sent wrongly, and then
PAUSE: Final = 60.0  # one line in so many seconds, with the number of those that were left out
LONGEST: Final = 300  # characters of a line

PUTS: Final = 256  # of one client under way; as many again of those that stop
MESSAGE: Final = 16_384  # bytes of one message: what EPICS allows unless it is told otherwise
DATAGRAM: Final = 4_096  # bytes: clients search with 1 472 at most
NEWEST: Final = 32  # values of one monitor that are kept for a client which does not read


class Circuit(server.VirtualCircuit):  # type: ignore[misc]  # caproto has no types
    """A client's connection. What it is sent stands in one line: monitors, and the answers to its puts."""

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        self.subscription_queue = _Line()
        self.heard = time.monotonic()  # when it said something last

    @property
    def held(self) -> int:
        """How many channels and monitors it has."""
        return len(self.circuit.channels) + sum(len(subs) for subs in self.subscriptions.values())

    def watching(self, field: Any) -> int:
        """How many monitors of a field it has."""
        return sum(len(subs) for spec, subs in self.subscriptions.items() if spec.db_entry is field)

    async def recv(self) -> None:
        """Read on. A client that begins a message of more than `MESSAGE` bytes is left."""
        await super().recv()
        self.heard = time.monotonic()
        if len(self.circuit._data) > MESSAGE:  # noqa: SLF001 (what is not yet a whole message; caproto has no other way in)
            self.log.warning("a client that sent a message of more than %d bytes was left", MESSAGE)
            await self.leave()
            raise DisconnectedCircuit

    async def _command_queue_iteration(self, command: Any) -> Any:
        await asyncio.sleep(0)  # others have their turn between two commands of this client
        return await super()._command_queue_iteration(command)

    async def _process_command(self, command: Any) -> Any:
        if isinstance(command, caproto.WriteRequest | caproto.WriteNotifyRequest):
            channel, _ = self._get_db_entry_from_command(command)
            why = self._no_put(channel, command)
            if why is not None:
                self.log.warning("%s: %s", channel.name, why.why)
                waits = isinstance(command, caproto.WriteNotifyRequest)
                return [channel.write(ioid=command.ioid, status=why.status, data_count=1)] if waits else []
        answer = await super()._process_command(command)
        if isinstance(command, caproto.CreateChanRequest | caproto.EventAddRequest):
            watched = isinstance(command, caproto.EventAddRequest)
            field = self._get_db_entry_from_command(command)[1] if watched else None
            await self.context.make_room(field)
        return answer

    def _no_put(self, channel: Any, command: Any) -> Refused | None:
        """Why a put is not carried out."""
        stops = channel.name.partition("{")[0].endswith((".STOP", ".SPMG"))
        if len(self.tasks.tasks) > PUTS * (1 + stops) + 2:  # besides its puts it has two
            return Refused(f"more than {PUTS} puts of one client are under way", CAStatus.ECA_PUTFAIL)
        return not_whole(command)

    async def send(self, *commands: Any) -> None:
        """Send at once, but for the answer to a put: it waits behind the monitors that were posted before."""
        if any(isinstance(command, caproto.WriteNotifyResponse) for command in commands):
            if self.subscription_queue.qsize() > 2 * caproto.MAX_TOTAL_SUBSCRIPTION_BACKLOG:
                raise DisconnectedCircuit("a client puts and does not read")
            for command in commands:
                self.subscription_queue.put_nowait(partial(_itself, command))
        else:
            await super().send(*commands)

    async def subscription_queue_loop(self) -> None:
        """Send what stands in line, in its order. A monitor that is old news, or is no more wanted, is left out."""
        self.events_on.set()
        try:
            while self.connected:
                line = [await self.subscription_queue.get()]
                while not self.subscription_queue.empty():
                    line.append(self.subscription_queue.get_nowait())
                wanted = {sub.subscriptionid for subs in self.subscriptions.values() for sub in subs}
                commands = [command for command in (item() for item in line) if command is not None]
                commands = [it for it in commands if getattr(it, "subscriptionid", None) in (*wanted, None)]
                if commands:
                    await super().send(*commands)
        except asyncio.CancelledError:
            return  # who cancels this waits for its end
        except DisconnectedCircuit:
            await self.leave()
        except Exception:
            self.log.exception("a client could not be told")
            await self.leave()

    async def command_queue_loop(self) -> None:
        """Do what the client says. One that breaks the protocol beyond repair is left, and the others go on."""
        try:
            await super().command_queue_loop()
        except Exception:
            self.log.exception("a client that broke the protocol was left")
            await self.leave()

    async def leave(self) -> None:
        """Be rid of this client at once, whatever it has not taken yet."""
        if asyncio.current_task() is getattr(self, "_sub_task", None):
            self._sub_task: Any = None  # it ends by itself
        self.client.writer.transport.abort()
        await self._on_disconnect()
        self.circuit.disconnect()
        await self.context.circuit_disconnected(self)

    async def _on_disconnect(self) -> None:
        specs, here = list(self.subscriptions), self.connected
        await super()._on_disconnect()
        if here:
            self.context.forget(self, specs)


def _itself(command: Any) -> Any:
    return command


class _Line(asyncio.Queue):  # type: ignore[type-arg]
    """What a client is to be sent, as functions that give it, or None where it is old news.

    A client that does not read holds up nobody: when its line is full the monitors in it are dropped, and answers kept.
    """

    async def put(self, item: Any) -> None:
        if self.qsize() >= caproto.MAX_TOTAL_SUBSCRIPTION_BACKLOG:
            raise asyncio.QueueFull
        self.put_nowait(item)

    def clear(self) -> None:
        """Drop the monitors that wait."""
        kept = [item for item in (self.get_nowait() for _ in range(self.qsize())) if not isinstance(item, ref)]
        for item in kept:
            self.put_nowait(item)


class Context(server.Context):  # type: ignore[misc]
    """The server. `report` is told, in one line each and not too often, what clients did that it cannot make sense of.

    `interfaces` are addresses to listen on, None: those of $EPICS_CAS_INTF_ADDR_LIST, or all.
    """

    CircuitClass = Circuit

    def __init__(self, pvs: dict[str, Any], interfaces: list[str] | None) -> None:
        super().__init__(pvs, interfaces)
        self.subscription_queue = _AtOnce(self)
        self._limits = ClientLimits(self.circuits)
        for channel in pvs.values():
            channel.max_subscription_backlog = NEWEST

    async def close(self) -> None:
        """Leave the clients that are still there."""
        for circuit in list(self.circuits):
            circuit.client.close()
        await asyncio.sleep(0)

    async def tcp_handler(self, client: Any, address: Any) -> None:
        """Serve a client. Where there are `CLIENTS` already, the one that was silent longest leaves."""
        silent = self._limits.too_silent()
        if silent is not None:
            self.log.warning("more than %d clients: the one that was silent longest was left", CLIENTS)
            await silent.leave()
        await super().tcp_handler(client, address)

    def forget(self, circuit: Circuit, specs: list[Any]) -> None:
        """Keep nothing of a client that left, nor of what it monitored in its own way."""
        for spec in specs:
            if not self.subscriptions[spec]:
                del self.subscriptions[spec]
        for kept in (self.last_dead_band, self.last_sync_edge_update):
            for sub in [sub for sub in kept if sub.circuit is circuit]:
                del kept[sub]

    async def make_room(self, field: Any | None) -> None:
        """A channel was made, or a monitor of `field`: leave the client that has most, where all have too many."""
        found = self._limits.too_many(field)
        if found is not None:
            circuit, why = found
            circuit.log.warning("%s: the client with most of them was left", why)
            await circuit.leave()

    async def _broadcaster_recv_datagram(self, data: bytes, address: Any) -> None:
        if len(data) <= DATAGRAM:
            await super()._broadcaster_recv_datagram(data, address)

    async def subscription_queue_loop(self) -> None:
        """Nothing to do: updates go to the circuits when they are posted."""

    async def tell(self, update: Any) -> None:
        """Put an update of a channel into the line of each client that monitors it."""
        await self._subscription_queue_iteration(*update)

    async def _subscription_queue_send(self, sub_spec: Any, sub: Any, **update: Any) -> None:
        try:
            await super()._subscription_queue_send(sub_spec, sub, **update)
        except Exception:
            self.log.exception("a monitor of %s could not be told", sub.channel.name)


class _AtOnce:
    """In place of a queue of updates: each goes to the lines of the clients when it is posted. Nothing waits here."""

    def __init__(self, context: Context) -> None:
        self._context = context

    async def put(self, update: Any) -> None:
        await self._context.tell(update)


class _Told(logging.Handler):
    """Each record as one line, without a traceback; many of them as few."""

    def __init__(self, tell: Callable[[str], object], clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(logging.WARNING)
        self._tell, self._clock = tell, clock
        self._told, self._left, self._last = 0, 0, clock()

    def emit(self, record: logging.LogRecord) -> None:
        if record.msg.startswith("Failed to send beacon"):
            return  # nobody listens for them there: no fault
        self.line(record.getMessage(), record.exc_info[1] if record.exc_info else None)

    def line(self, text: str, error: BaseException | None) -> None:
        """Tell it, unless much was told lately."""
        now = self._clock()
        if now - self._last >= PAUSE:
            self._told = 0
        if self._told >= OFTEN:
            self._left += 1
            return
        self._told, self._last = self._told + 1, now
        if error is not None:
            text = f"{text}: {type(error).__name__} {error}"
        text = " ".join(text.split())
        more = f" ({self._left} more like it were not told)" if self._left else ""
        end = "; what follows is told once a minute" if self._told == OFTEN else ""
        self._left = 0
        self._tell((text if len(text) <= LONGEST else text[: LONGEST - 3] + "...") + more + end)


@contextmanager
def quietly(tell: Callable[[str], object]) -> Iterator[None]:
    """While this lasts `tell` has what caproto would log, and what its tasks leave behind, in a line each."""
    told = _Told(tell)
    log = logging.getLogger("caproto")
    before = log.propagate
    log.addHandler(told)
    log.propagate = False
    loop = asyncio.get_running_loop()

    def left(_: asyncio.AbstractEventLoop, what: dict[str, Any]) -> None:
        told.line(str(what.get("message", "a task failed")), what.get("exception"))

    loop.set_exception_handler(left)
    try:
        yield
    finally:
        loop.set_exception_handler(None)
        log.removeHandler(told)
        log.propagate = before
