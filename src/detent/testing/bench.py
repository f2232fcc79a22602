"""Controllers served in a thread of the test process, so that a test can look at them and break them.

A thread, because it is there at once, needs no second interpreter and tells its errors; the pulses are exact all the
same, as a cell's time is computed and not slept for. The test itself never sleeps: it waits for what it wants to see.
"""

import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from detent.cell.description import Description, Problem, parse, single
from detent.controllers import catalogue
from detent.realtime import verbs
from detent.realtime.control import Control
from detent.realtime.endpoints.spec import EndpointSpec
from detent.realtime.images import Images, cell_name
from detent.realtime.service import Service, models
from detent.realtime.texts import read_text
from detent.realtime.verbs import Answer, AskedWrongly

CLOSING: Final = 30.0  # seconds that the serving thread has to end


class Serving:
    """A service, the thread that runs it, and its memories on disk."""

    def __init__(self, service: Service, images: Images, control: Control) -> None:
        self.service, self.images, self.control = service, images, control
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="detent", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            self.service.run()
        except BaseException as error:  # the test is told when it closes
            self._error = error
        finally:
            self.control.end()

    @property
    def alive(self) -> bool:
        """Whether it still serves."""
        return self._thread.is_alive()

    def close(self) -> None:
        """End it. Raises what went wrong while it served. May be called twice."""
        if self.alive:
            self.service.stop()
            self._thread.join(CLOSING)
        self.service.close()
        self.images.close()
        error, self._error = self._error, None
        if error is not None:
            raise error


class Served:
    """A unit that is served, and through it the cell that it is in; `cell["bar"]` is the unit bar of that cell.

    Methods that do something raise `AskedWrongly` (a ValueError) with the remedy.
    """

    def __init__(self, serving: Serving, unit: str) -> None:
        self._serving, self.unit = serving, unit

    def __getitem__(self, unit: str) -> "Served":
        """Another unit of the same cell. Raises AskedWrongly."""
        known = list(self._serving.service.description.units)
        if unit not in known:
            raise verbs.unknown("unit", unit, known)
        return Served(self._serving, unit)

    # -- where a host finds it ---------------------------------------------------------------------------

    @property
    def port(self) -> str:
        """The device of a pseudo-terminal on its line: what a program opens as a serial port."""
        return self._address("pty")

    @property
    def tcp(self) -> str:
        """HOST:PORT of a TCP port on its line, if it was served with `tcp=True`."""
        return self._address("tcp")

    def _address(self, kind: str) -> str:
        service = self._serving.service
        line = service.cell.wiring.line_of[service.cell.unit(self.unit)]
        for number, found, address in service.addresses():
            if (number, found) == (line, kind):
                return address
        raise AskedWrongly(
            f"{self.unit} has no {kind}", "serve it with tcp=True, or ask for the unit in front of its line"
        )

    # -- verbs -------------------------------------------------------------------------------------------

    def do(self, verb: str, **given: object) -> Answer:
        """Any verb of `detent control`, with its arguments; ``for_`` stands for ``for``."""
        return self._serving.control.call(verb, {name.rstrip("_"): value for name, value in given.items()})

    def state(self) -> dict[str, Any]:
        """How this unit stands: powered, state, axes, pins, executing, refused."""
        units: Any = self.do("state")["units"]
        found: dict[str, Any] = units[self.unit]
        return found

    def position(self, axis: str | None = None) -> int:
        """Where an axis is, the first unless it is named."""
        axes: dict[str, Any] = self.state().get("axes", {})
        found = next(iter(axes.values()), None) if axis is None else axes.get(axis)
        if found is None:
            known = "leave the axis out" if len(axes) == 1 else f"there are: {', '.join(axes) or 'none'}"
            raise AskedWrongly(f"{self.unit} has no axis {axis or ''!r}", known)
        return int(found["position"])

    def wait(self, **conditions: object) -> Answer:
        """Wait until everything is so at once: state, position, pin and level, time. Raises TimeoutError.

        `resume=True` lets a cell that stands go on for this, `pause=True` lets it stand at that very instant; `timeout`
        are seconds of the wall clock.
        """
        answer = self.do("wait", **self._mine(conditions, "state", "position", "axis"))
        if not answer["reached"]:
            told = ", ".join(f"{name} {value}" for name, value in conditions.items())
            raise TimeoutError(f"{self.unit} has not come to {told}: {self.state()}")
        return answer

    def fault(self, kind: str, where: str | None = None, **options: object) -> int:
        """Something breaks: this unit, its line, or what `where` names; the number of the fault."""
        place = self.unit if where is None else self._pin(where)
        number = self.do("fault", kind=kind, where=place, **options)["fault"]
        assert isinstance(number, int)
        return number

    def mend(self, fault: int | None = None) -> None:
        """A fault is mended, if it is not over already; all faults of the cell without a number."""
        self.do("mend", **({} if fault is None else {"fault": fault}))

    def type(self, text: str) -> None:
        """The host of this unit's line sends it a command line, besides whoever is connected."""
        self.do("type", text=text, unit=self.unit)

    def power(self, on: bool) -> None:
        """Switch its supply."""
        self.do("power", on=on, unit=self.unit)

    def set(self, pin: str, level: int | str) -> None:
        """Give an input a level."""
        self.do("set", pin=f"{self.unit}.{pin}", level=level)

    def release(self, pin: str) -> None:
        """Leave an input to its wire again."""
        self.do("release", pin=f"{self.unit}.{pin}")

    def switch(self, name: str, level: int | str) -> None:
        """Put a switch of the cell to a level."""
        self.do("switch", switch=name, level=level)

    def pause(self) -> None:
        """Let the cell time stand."""
        self.do("pause")

    def resume(self) -> None:
        """Let the cell time go on."""
        self.do("resume")

    def run_for(self, time: str | float, timeout: float = verbs.SHORT_WAIT) -> None:
        """Let the cell go on for so long, then stand. Raises TimeoutError where that takes longer than `timeout`.

        `time` is of the cell, `timeout` seconds of the wall clock.
        """
        if not self.do("run-for", time=time, timeout=timeout)["reached"]:
            raise TimeoutError(f"{self.unit} has not run for {time} within {timeout} s of the wall clock")

    def pace(self, factor: float | None) -> None:
        """So many times as fast as real time; None: as fast as it can."""
        self.do("pace", pace=factor)

    def close(self) -> None:
        """End the whole cell, before the test does."""
        self._serving.close()

    def _mine(self, given: Mapping[str, object], *about: str) -> dict[str, object]:
        """The arguments, with this unit where they are about one."""
        found = dict(given)
        if "pin" in found:
            found["pin"] = self._pin(str(found["pin"]))
        return found | ({"unit": self.unit} if "unit" not in found and found.keys() & {*about} else {})

    def _pin(self, where: str) -> str:
        """UNIT.PIN for a pin of this unit; anything else as it is."""
        cell = self._serving.service.cell
        own = any(pin.name == where for pin in cell.parts[cell.unit(self.unit)].pins)
        return f"{self.unit}.{where}" if own else where


class Bench:
    """What serves controllers and cells for one test, and ends them all. Use it as a context manager.

    Non-volatile memories are kept in `folder`: a unit that is served again, after `close`, has its memory.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._open: list[tuple[str, Serving]] = []

    def serve(
        self,
        target: str | Path,
        *,
        straps: Mapping[str, int | str] | None = None,
        options: Mapping[str, int | float | str] | None = None,
        program: str | Path | None = None,
        pace: float | None = 1.0,
        line_timing: bool = True,
        tcp: bool = False,
    ) -> Served:
        """Serve a model by name, or a cell file. Straps, options and program are those of a model.

        `pace` None: as fast as it can. Raises ValueError with the remedy: `detent.cell.description.Problem` for what
        is wrong with a cell file, `CatalogueError` for a model that there is not.
        """
        description = self._description(str(target), straps, options, program)
        name = cell_name(str(target), is_file=bool(description.file))
        same = sum(other == name and serving.alive for other, serving in self._open)
        folder = self.folder / (f"eeprom-{same + 1}" if same else "eeprom")  # two at once have their own
        images = Images.of(folder, str(target), models(description), is_file=bool(description.file))
        endpoints = [
            EndpointSpec.usual(),
            *([EndpointSpec("tcp", "127.0.0.1:0")] if tcp else []),
        ]
        beside = Path(description.file).parent if description.file else Path()
        try:
            service = Service(
                description,
                lambda file: read_text(beside / file),
                endpoints,
                pace=1 if pace is None else pace,
                line_timing=line_timing,
                images=images,
                observed=True,
            )
        except BaseException:
            images.close()
            raise
        if pace is None:
            service.pace.change(None, service.cell.now)
        serving = Serving(service, images, Control(service))
        self._open.append((name, serving))
        return Served(serving, next(iter(description.units)))

    def close(self) -> None:
        """End everything. Raises the first thing that went wrong while it was served."""
        errors = []
        while self._open:
            try:
                self._open.pop()[1].close()
            except BaseException as error:
                errors.append(error)
        if errors:
            raise errors[-1]

    def __enter__(self) -> "Bench":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _description(
        self,
        target: str,
        straps: Mapping[str, int | str] | None,
        options: Mapping[str, int | float | str] | None,
        program: str | Path | None,
    ) -> Description:
        if not (target.endswith(".toml") or "/" in target):
            catalogue.model(target)
            return single(target, straps=straps, options=options, program=None if program is None else str(program))
        if straps or options or program:
            raise Problem(target, "", "a cell file has its own straps, options and programs: write them there")
        try:
            text = read_text(Path(target))
        except OSError as error:
            raise Problem(target, "", f"cannot read it: {error.strerror}") from None
        return parse(text, target)
