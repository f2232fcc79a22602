"""Everything on one board: its steppers, stops, inputs, outputs and drivers, each with its object in the firmware."""

import json
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from heapq import heapify, heappop, heapreplace

from detent.realtime.boards.core import Core
from detent.realtime.boards.dictionary import Value
from detent.realtime.boards.drivers import Driver, Wire
from detent.realtime.boards.inputs import Inputs
from detent.realtime.boards.lag import Lag, settle
from detent.realtime.boards.outputs import DigitalOut
from detent.realtime.boards.setup import DriverSetup, InputSetup, SetupProblem
from detent.realtime.boards.stepper import Stepper
from detent.realtime.boards.stops import Stop
from detent.realtime.boards.undo import Undo, kept, together
from detent.realtime.pace import WallNs
from detent.ticks import NEVER, Ns

ONE_RUN = 40  # bytes of messages at most, with a direction and a clock
ONE_TIMEOUT = 9


class Equipment:
    """What `core.setup` has on the board, by name. SetupProblem for a driver that cannot be reached so."""

    def __init__(self, core: Core) -> None:
        setup = core.setup
        self._core = core
        self._oids = 0
        self.steppers: dict[str, Stepper] = {}
        self.stops: dict[str, Stop] = {}
        stoppers: dict[str, int] = {}  # an endstop of each input that stops something
        for stepper in setup.steppers:
            axis = Stepper(core, stepper, [self._oid() for _ in range(1 if stepper.minus is None else 2)])
            self.steppers[stepper.name] = axis
            mine: dict[str, tuple[InputSetup, int]] = {}
            for entry in setup.inputs:
                if stepper.stops is None or entry.name in stepper.stops:
                    mine[entry.name] = entry, self._oid()
                    stoppers.setdefault(entry.name, mine[entry.name][1])
            self.stops[stepper.name] = Stop(core, axis, self._oid(), mine, self._heard, self._level)
        self.inputs = Inputs(core, setup.inputs, stoppers, self.stops, self._oid)
        self.starved = False  # steps had to wait for room on the wire
        self.outputs = {out.name: DigitalOut(core, out, self._oid()) for out in setup.outputs}
        self._wires: dict[tuple[str, str], Wire] = {}
        self.drivers = {chip.name: Driver(core, chip, self._wire(chip)) for chip in setup.drivers}
        self._triggers = {stop.oid: stop for stop in self.stops.values()}

    def _oid(self) -> int:
        self._oids += 1
        return self._oids - 1

    def _heard(self, name: str, level: bool, wall: WallNs) -> None:
        self.inputs.heard(name, level, wall)

    def _level(self, name: str) -> bool:
        return self.inputs.levels[name]

    def _wire(self, chip: DriverSetup) -> Wire:
        key = ("uart", chip.uart.name) if chip.uart is not None else ("spi", chip.select.name if chip.select else "")
        if chip.uart is None and (
            chip.select is None or (chip.bus is None and None in (chip.clock, chip.mosi, chip.miso))
        ):
            raise SetupProblem(chip.name, "uart", "a driver is reached by its uart pin, or by select and a bus (or "
                               "clock, mosi and miso)")  # fmt: skip
        if (chip.uart is None) is not (chip.kind in ("tmc2130", "tmc5160")):
            way = "uart" if chip.kind in ("tmc2208", "tmc2209") else "select and a bus"
            raise SetupProblem(chip.name, "kind", f"a {chip.kind} is reached by {way}")
        if not 0 <= chip.address <= (3 if chip.kind == "tmc2209" else 0):
            raise SetupProblem(chip.name, "address", f"a {chip.kind} has no address {chip.address}")
        if key not in self._wires:
            self._wires[key] = Wire(self._core, self._oid(), chip)
        return self._wires[key]

    # -- its configuration

    def config(self) -> list[tuple[str, dict[str, Value | str]]]:
        """The commands that make it all; pins by name."""
        commands: list[tuple[str, dict[str, Value | str]]] = [("allocate_oids", {"count": self._oids})]
        for axis in self.steppers.values():
            commands += axis.config()
        for stop in self.stops.values():
            commands += stop.config()
        commands += self.inputs.config()
        commands += [out.config() for out in self.outputs.values()]
        for wire in self._wires.values():
            commands += wire.config()
        return commands

    def crc(self) -> int:
        """By which a configuration is known again, of this firmware."""
        return zlib.crc32(json.dumps([self._core.dictionary.version, self.config()]).encode())

    def configure(self) -> Iterator[frozenset[str]]:
        """Send the configuration, a command whenever it is asked for the next: the pins which that is about."""
        for name, values in self.config():
            self._core.command(name, **self._numbered(values))
            yield frozenset(v for key, v in values.items() if isinstance(v, str) and key != "spi_bus")
        self._core.command("finalize_config", crc=self.crc())

    def _numbered(self, values: Mapping[str, Value | str]) -> dict[str, Value]:
        found: dict[str, Value] = {}
        for key, value in values.items():
            if isinstance(value, str):
                value = self._core.dictionary.number("spi_bus" if key == "spi_bus" else "pin", value)
            found[key] = value
        return found

    # -- what it does

    def begin(self, raw: Mapping[str, bool], wall: WallNs) -> None:
        """The board is ready; `raw` are the levels of its input pins. Outputs are begun one by one."""
        self.inputs.begin(raw, wall)
        for axis in self.steppers.values():
            axis.halt(stopped=False)
        for wire in self._wires.values():
            wire.clear()
        for driver in self.drivers.values():
            driver.began()

    def fall(self, *, shut_down: bool) -> None:
        """The board has shut down, or is gone."""
        for axis in self.steppers.values():
            axis.halt(stopped=shut_down)
        for stop in self.stops.values():
            stop.clear()
        for out in self.outputs.values():
            out.shut_down()
        for driver in self.drivers.values():
            driver.shut_down()

    def commit(self, now: Ns, firm: Ns, wall: WallNs, most: int) -> bool:
        """The cell is at `now`: send what is certain, `most` runs of steps; nothing is taken back up to `firm`.

        Whether an output waits until stops were heard of.
        """
        waits, heard = False, self.heard()
        settle(self.steppers.values(), now, wall)  # outputs come later with the steps
        for lag in self._lags:
            lag.settle_outputs(wall, heard)
        waits |= self._change(wall, heard, firm)
        for stop in self.stops.values():
            if stop.dry(wall) and not self.steppers[stop.stepper].resting:
                stop.ask_dry(wall)
        for name, stop in self.stops.items():
            if stop.pending and not self.steppers[name].of.waits:
                settle([axis for axis in self.steppers.values() if axis.of is self.steppers[name].of], now, wall)
                stop.commit(wall)
        settle(self.steppers.values(), now, wall)
        for name, due in self._dues().items():
            if not self.steppers[name].of.waits:
                self.stops[name].before_steps(due, wall)
        self._send([axis for axis in self.steppers.values() if not axis.of.waits], now, wall, most)
        for name, due in self._dues().items():
            self.stops[name].behind_steps(due, wall)
        return waits | self._change(wall, heard, firm)

    def _change(self, wall: WallNs, heard: WallNs | None, firm: Ns) -> bool:
        """Give outputs what is due soon. Whether one waits until stops were heard of."""
        waits = False
        for out in self.outputs.values():
            if out.wants(wall):
                waits |= out.commit(wall, heard, firm)
        return waits

    @property
    def _lags(self) -> Iterable[Lag]:
        """Of the units whose outputs are here."""
        return {id(out.of): out.of for out in self.outputs.values() if out.of is not None}.values()

    @property
    def renewing(self) -> int:
        """Bytes that follow steps: what says that the next ones may come."""
        return ONE_TIMEOUT * len(self.steppers)

    def _dues(self) -> dict[str, int | None]:
        """The tick before which no stepper of its unit has a step to come: what is late stops all of them at once."""
        found: dict[Lag, int] = {}
        for axis in self.steppers.values():
            due = axis.due()
            if due is not None:
                found[axis.of] = min(due, found.get(axis.of, due))
        return {name: None if axis.resting else found.get(axis.of) for name, axis in self.steppers.items()}

    def _send(self, axes: Sequence[Stepper], now: Ns, wall: WallNs, most: int) -> None:
        """Their pulses in `most` runs, those first that are due first, and none that would wait for an acknowledgement.

        What would have to is made when it has come: it might be late by then.
        """
        turns: list[tuple[int, int, Iterator[int]]] = []
        for number, axis in enumerate(axes):
            runs = axis.sending(now, wall)
            due = next(runs, None)
            if due is not None:
                turns.append((due, number, runs))
        heapify(turns)
        while turns and most and self._core.link.enough(ONE_RUN + self.renewing):
            most -= 1
            _, number, runs = turns[0]
            due = next(runs, None)
            if due is None:
                heappop(turns)
            else:
                heapreplace(turns, (due, number, runs))
        self.starved = bool(turns)

    def talk(self, wall: WallNs) -> None:
        """Begin to write to driver chips what was commanded: that has no time of its own."""
        for driver in self.drivers.values():
            driver.commit(wall)

    def kept(self, wall: WallNs) -> Undo:
        """As it is now, again: what `commit` and `feed` change at `wall`."""
        changing: list[Undo] = [self._core.kept()]
        for name, stop in self.stops.items():
            if stop.pending or stop.alive or not self.steppers[name].resting:
                changing.append(kept(stop))
                changing.append(self.steppers[name].kept())
        changing += [kept(out) for out in self.outputs.values() if out.wants(wall)]
        changing += [kept(lag) for lag in self._lags]
        return together(changing)

    def deadlines(self) -> list[WallNs | None]:
        """When watchdogs are to be fed, counts compared, driver chips looked after."""
        return [
            *(out.deadline() for out in self.outputs.values()),
            *(axis.proof_due() for axis in self.steppers.values()),
            *(stop.deadline() for stop in self.stops.values()),
            *(driver.deadline() for driver in self.drivers.values()),
        ]

    def hungry(self, wall: WallNs) -> bool:
        """Whether a watchdog wants to be fed."""
        return any(at is not None and wall >= at for at in (out.deadline() for out in self.outputs.values()))

    def feed(self, wall: WallNs, _: int) -> bool:
        """Feed watchdogs. Whether an output waits until stops were heard of."""
        waits, heard = False, self.heard()
        for out in self.outputs.values():
            at = out.deadline()
            if at is not None and wall >= at:
                waits |= out.commit(wall, heard)
        return waits

    def due(self, wall: WallNs) -> None:
        """Compare counts, and look after driver chips, where it is time."""
        for axis in self.steppers.values():
            at = axis.proof_due()
            if at is not None and wall >= at:
                axis.prove(wall)
        for name, stop in self.stops.items():
            at = stop.deadline()
            if at is not None and wall >= at:
                stop.behind_steps(self._dues()[name], wall)
        for driver in self.drivers.values():
            driver.due(wall)

    def heard(self) -> WallNs | None:
        """Whatever its stops did up to this wall time was told; None: none of them can do anything."""
        return min((at for stop in self.stops.values() if (at := stop.heard()) is not None), default=None)

    @property
    def firm(self) -> Ns:
        """Nothing up to this cell time is taken back by what an input does."""
        return min((stop.firm for stop in self.stops.values()), default=NEVER)

    def trigger(self, oid: int) -> Stop | None:
        """The stop whose trigger is that object."""
        return self._triggers.get(oid)
