"""Looks for controllers on the ports of this computer: asks what `detent.hosts.finding` wants asked, on real ports."""

from collections.abc import Iterable
from typing import NamedTuple, Protocol, cast

from detent.hosts.exchange import NOTHING, Answer, Ask, Blocking, Clear, Driver, Port, Step, Steps, Watch
from detent.hosts.finding import PATIENCE, Found, Pass, Tune, plan, search
from detent.realtime.addresses import Address, PortError
from detent.realtime.ports import RealPort
from detent.uart import Format

FAR_PATIENCE = 0.25  # seconds, where a network lies between
MOST_HEARD = 4096  # bytes: who says more without being asked is no controller


class Listed(NamedTuple):
    """A serial port of this computer, and what is known of it without opening it."""

    device: str
    what: str


def listed() -> list[Listed]:
    """The serial ports of this computer, by name. Raises PortError where nothing is there that lists them."""
    try:
        from serialx import list_serial_ports  # only here: it takes a while
    except Exception as error:  # it is not for every system, and says so in many ways
        why = f"serialx, which lists serial ports, cannot be loaded: {error}"
        raise PortError(f"{why}; name a port yourself, as HOST:PORT") from error

    found = []
    for port in list_serial_ports():
        words = dict.fromkeys(word for word in (port.manufacturer, port.product, port.serial_number) if word)
        found.append(Listed(str(port.device), " ".join(words)))
    return sorted(found)


class FormattedPort(Port, Protocol):
    """A port whose format can be changed."""

    def set_format(self, form: Format, /) -> object:
        """Go on in another format."""


class Talks(RuntimeError):
    """What is on the line is no controller: it talks unasked and without end, or sends back all it hears."""


def passes_for(address: Address, models: Iterable[str], rates: Iterable[int] | None) -> list[Pass]:
    """The passes of a search at a port. Raises ValueError."""
    patience = PATIENCE if address.kind == "device" else FAR_PATIENCE
    return plan(tuple(models), rates=rates, formless=address.formless, patience=patience)


def find(address: Address, passes: list[Pass], watch: Watch | None = None) -> list[Found]:
    """Look for controllers at a port; `watch` is told how far it is. Raises PortError, PortLost, Talks."""
    port = RealPort(address, passes[0].form)
    port.open()
    try:
        return search_at(port, passes, watch)
    finally:
        port.close()


def search_at(port: FormattedPort, passes: list[Pass], watch: Watch | None = None) -> list[Found]:
    """The same at an open port, or at the line of a cell."""
    searcher = _Searcher(_Nobody(), port, watch)
    found = searcher.perform(cast("Steps[list[Found]]", search(passes)))  # steps of an operation, and `Tune`
    if not found and searcher.echoes > searcher.others:
        raise Talks("nobody answers, and what is sent comes back: the line is looped or crossed, or an adapter echoes")
    return found


class _Nobody(Driver):
    """Who it is that answers is not known yet."""

    title = "a search"


class _Searcher(Blocking):
    """Carries out the steps of a search."""

    port: FormattedPort
    echoes = others = 0  # answers that were the question, and answers that were none

    def _do(self, step: Step | Tune) -> Answer:
        match step:
            case Tune(form):
                self.port.set_format(form)
            case Clear():
                heard = 0
                while data := self.port.receive(0.0):
                    heard += len(data)
                    if heard > MOST_HEARD:
                        raise Talks("something talks there without being asked: no controller")
            case Ask(data):
                answer = super()._do(step)
                if answer.data:
                    echo = data.startswith(answer.data)
                    self.echoes, self.others = self.echoes + echo, self.others + (not echo)
                return answer
            case _:
                return super()._do(step)
        return NOTHING
