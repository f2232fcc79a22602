"""A cell that is served, looked at and meddled with: the verbs of `realtime.verbs`, arguments in, answers out.

What can be looked at and meddled with so is a `realtime.subject.Subject`.

Nothing here knows who asks. `Control.do` is for the thread that serves; `ask` and `call` are for every other one.
"""

import threading
from collections.abc import Callable, Mapping
from concurrent.futures import CancelledError, Future
from concurrent.futures import TimeoutError as TooLate
from typing import Final

from detent.cell.actions import Break, Discard, Mend, Power, Release, Send, SetPin, SetSwitch, TimedAction, Type
from detent.cell.cell import Cell
from detent.cell.history import Broken
from detent.pins import LOW
from detent.realtime import breaking, verbs
from detent.realtime.boards.driven import Driven
from detent.realtime.names import Names
from detent.realtime.picture import level_of, pins_of, real_state, switches_of, time_of, whole_state
from detent.realtime.plain import as_json
from detent.realtime.subject import Subject
from detent.realtime.verbs import Answer, AskedWrongly, Json
from detent.realtime.waiting import Condition, at_position, at_time
from detent.realtime.watch import Watch
from detent.ticks import SECOND, Ns

SLICE: Final = 200  # events of a long step between which others have their turn
LONGEST_QUEUE: Final = 60 * SECOND  # that characters take which wait on a line

Given = dict[str, object]


class Ending(RuntimeError):
    """The cell is not served any more."""


class Control:
    """The verbs of one `subject`, which must be observed."""

    def __init__(self, subject: Subject) -> None:
        """Raises ValueError for one that is not observed."""
        if subject.watched is None or subject.watch is None:
            raise ValueError("the service keeps no watch: make it with observed=True")
        self._subject, self._pace = subject, subject.pace
        self._watched = subject.watched
        self._watched.lost = lambda: {"reached": False, **whole_state(subject)}
        self._lock = threading.Lock()  # over the two that follow
        self._ended = False
        self._waited_for: set[Future[Answer]] = set()
        self._stepping: Future[Answer] | None = None  # a step that takes long
        self._does: Mapping[str, Callable[[Given], Answer | Future[Answer]]] = {
            "state": self._state,
            "pins": self._pins,
            "set": self._set,
            "release": self._release,
            "switch": self._switch,
            "power": self._power,
            "pause": self._stand,
            "resume": self._go,
            "present": self._present,
            "step": self._step,
            "run-for": self._run_for,
            "pace": self._change_pace,
            "type": self._type,
            "send": self._send,
            "clear": self._clear,
            "wait": self._wait,
            "journal": self._journal,
            "faults": self._faults,
            "fault": self._fault,
            "mend": self._mend,
            "stop": self._emergency_stop,
            "recover": self._recover,
            "board": self._boards,
        }

    def do(self, verb: str, given: Mapping[str, object]) -> Answer | Future[Answer]:
        """Do it, now, on the thread that serves. Raises AskedWrongly, and what the cell raises.

        The answer of a verb that `waits` may be to come: cancel it to wait no longer.
        """
        arguments = verbs.verb(verb).read(given)
        self._refuse_on_real_pins(verb, arguments)
        try:
            answer = self._does[verb](arguments)
        except (ValueError, KeyError, Broken) as error:
            if isinstance(error, AskedWrongly):
                raise
            raise AskedWrongly.of(error) from None
        self._watched.look()
        return answer

    @property
    def _cell(self) -> Cell:
        return self._subject.cell

    @property
    def _names(self) -> Names:
        return Names(self._subject.cell)

    def ask(self, verb: str, given: Mapping[str, object]) -> "Future[Answer]":
        """The same from any thread; cancelled when the cell is not served any more. Raises Ending."""
        promised: Future[Answer] = Future()
        with self._lock:
            if self._ended:
                raise Ending("the cell is not served any more")
            self._waited_for.add(promised)
        promised.add_done_callback(self._waited_for.discard)
        asked = self._subject.ask(lambda: self.do(verb, given))

        def pass_on(done: "Future[Answer]") -> None:
            if done.cancelled():
                promised.cancel()
            elif promised.set_running_or_notify_cancel():
                error = done.exception()
                if error is not None:
                    promised.set_exception(error)
                else:
                    promised.set_result(done.result())

        def begun(done: "Future[Answer | Future[Answer]]") -> None:
            if done.cancelled():
                promised.cancel()
                return
            error = done.exception()
            if error is not None:
                if promised.set_running_or_notify_cancel():
                    promised.set_exception(error)
                return
            answer = done.result()
            if isinstance(answer, Future):
                later = answer
                promised.add_done_callback(lambda ended: later.cancel() if ended.cancelled() else None)
                later.add_done_callback(pass_on)
            elif promised.set_running_or_notify_cancel():
                promised.set_result(answer)

        asked.add_done_callback(begun)
        return promised

    @staticmethod
    def late(verb: str) -> Answer:
        """What is answered, with the state, when the time is over before what is waited for. Raises Ending."""
        if not verbs.verb(verb).waits:
            raise Ending("the cell does not answer")
        return {"reached": False}

    def call(self, verb: str, given: Mapping[str, object]) -> Answer:
        """The same, and wait for the answer: not on the thread that serves. Raises AskedWrongly, Ending.

        Where the time is over before what is waited for, the answer says ``"reached": false``.
        """
        patience = verbs.verb(verb).patience(given)
        promised = self.ask(verb, given)
        try:
            return promised.result(patience)
        except TooLate:
            promised.cancel()
        except CancelledError:
            raise Ending("the cell is not served any more") from None
        return self.late(verb) | self.call("state", {})

    def end(self) -> None:
        """Whoever waits for an answer is told that it ends, and whoever asks from now on. From any thread."""
        with self._lock:
            self._ended = True
            waiting = list(self._waited_for)
        for promised in waiting:
            promised.cancel()

    # -- looking -----------------------------------------------------------------------------------------

    def _state(self, _: Given) -> Answer:
        return {**whole_state(self._subject), "faults": self._list_faults()}

    def _pins(self, given: Given) -> Answer:
        units = [self._names.unit(given)] if "unit" in given else list(self._names.units)
        return {"time_ns": self._cell.now, "pins": {unit: pins_of(self._subject, unit) for unit in units}}

    def _journal(self, given: Given) -> Answer:
        forgotten, journal = self._subject.journal()
        last = given.get("last", 100)
        assert isinstance(last, int)
        newest = journal[-last:] if last else []
        return {"deeds": forgotten + len(journal), "complete": not forgotten, "journal": [_told(a) for a in newest]}

    def _faults(self, _: Given) -> Answer:
        return {"time_ns": self._cell.now, "faults": self._list_faults()}

    def _list_faults(self) -> list[Json]:
        cell = self._cell
        listed: list[Json] = []
        for number, fault in cell.faults.standing.items():
            found: dict[str, Json] = {"fault": number, **breaking.arguments_of(cell, fault)}
            tally = cell.faults.tally(number)
            if tally is not None:
                found |= {"met": tally.met, "struck": tally.struck}
            listed.append(found)
        return listed

    # -- real pins ---------------------------------------------------------------------------------------

    def _watch(self) -> Watch:
        watch = self._subject.watch
        assert watch is not None
        return watch

    def _refuse_on_real_pins(self, verb: str, given: Given) -> None:
        """What a motor cannot follow, or what would make the cell blind to a switch of the machine."""
        driven = self._subject.driven
        if driven is None:
            return
        if verb in ("pause", "resume", "step", "run-for", "pace") or (verb == "wait" and given.get("pause")):
            raise AskedWrongly("real pins are driven, and their time does not stand", "stop the motors with stop")
        if verb in ("set", "release", "fault"):
            if verb == "fault":
                unit, _, pin = str(given["where"]).partition(".")
            else:
                unit, pin = self._names.pin(given)
            if (unit, pin) in driven.plan.inputs.values():
                raise AskedWrongly(f"{unit}.{pin} is an input of a board", "its level is that of the pin")

    def _driven(self) -> Driven:
        driven = self._subject.driven
        if driven is None:
            raise AskedWrongly("no real pins are driven", "serve the cell with --real")
        return driven

    def _emergency_stop(self, _: Given) -> Answer:
        self._driven().stop()
        return self._boards({})

    def _recover(self, _: Given) -> Answer:
        waits = self._driven().recover()
        return {"waits_for": waits, **self._boards({})}

    def _boards(self, _: Given) -> Answer:
        return {"time_ns": self._cell.now, **real_state(self._driven())}

    # -- hands -------------------------------------------------------------------------------------------

    def _set(self, given: Given) -> Answer:
        unit, pin = self._names.pin(given)
        self._subject.do(SetPin(unit, pin, breaking.level(given)))
        return self._now()

    def _release(self, given: Given) -> Answer:
        unit, pin = self._names.pin(given)
        self._subject.do(Release(unit, pin))
        return self._now()

    def _switch(self, given: Given) -> Answer:
        known = switches_of(self._subject)
        name = str(given["switch"])
        if name not in known:
            raise verbs.unknown("switch", name, list(known))
        if name not in self._cell.wiring.names:
            raise AskedWrongly(f"{name} is moved by a rotor", f"let it stick: fault {name} stuck")
        self._subject.do(SetSwitch(name, breaking.level(given)))
        return self._now()

    def _power(self, given: Given) -> Answer:
        self._subject.do(Power(self._names.unit(given), bool(given["on"])))
        return self._now()

    def _type(self, given: Given) -> Answer:
        unit, text = self._names.unit(given), str(given["text"])
        foreign = next((character for character in text if not character.isascii()), None)
        if foreign is not None:
            raise AskedWrongly(f"{foreign!r} is on no line of these units", "write ASCII, or bytes with send")
        line = self._cell.wiring.line_of[self._cell.unit(unit)]
        if line >= 0:
            self._refuse_a_long_queue(line, len(self._cell.serial_unit(unit).frame(text)))
        self._subject.do(Type(unit, text))
        return self._now()

    def _send(self, given: Given) -> Answer:
        try:
            data = str(given["data"]).encode("latin-1").decode("unicode_escape").encode("latin-1")
        except UnicodeError:
            raise AskedWrongly("data has characters that are no bytes", r"write them like \r or \x1b") from None
        line = self._names.line(given.get("line"))
        self._refuse_a_long_queue(line, len(data))
        self._subject.do(Send(line, data))
        return self._now()

    def _clear(self, given: Given) -> Answer:
        self._subject.do(Discard(self._names.line(given.get("line"))))
        return self._now()

    def _refuse_a_long_queue(self, number: int, more: int) -> None:
        line = self._cell.lines[number]
        waits = max(line.host_busy_until - self._cell.now, 0)
        if waits + line.format.duration(more) > LONGEST_QUEUE:
            name = self._cell.wiring.line_names[number]
            told = f"{waits / SECOND:.1f} s of characters wait on line {name}, and these would be {more} more"
            raise AskedWrongly(
                told, f"at most {LONGEST_QUEUE // SECOND} s of them wait: send fewer, or drop them (clear)"
            )

    # -- time --------------------------------------------------------------------------------------------

    def _now(self) -> Answer:
        return time_of(self._subject)

    def _stand(self, _: Given) -> Answer:
        self._end_step()
        self._subject.stand()
        return self._now()

    def _go(self, _: Given) -> Answer:
        self._end_step()
        self._subject.go()
        return self._now()

    def _present(self, _: Given) -> Answer:
        self._subject.present()
        return self._now()

    def _step(self, given: Given) -> "Answer | Future[Answer]":
        self._end_step()
        time = given.get("time")
        if isinstance(time, int):
            stepping: Future[Answer] = Future()
            self._step_on(self._cell.now + time, stepping)
            return stepping.result() if stepping.done() else stepping
        self._subject.step_event()
        return self._now()

    def _step_on(self, goal: Ns, stepping: "Future[Answer]") -> None:
        """Go on towards `goal` for a while; then it is the turn of the lines and of other requests."""
        if stepping.done():  # nobody waits for it any more, or another word about time has ended it
            return
        self._stepping = stepping
        try:
            for _ in range(SLICE):
                at = self._cell.next_event()
                goes_on = self._subject.run_on(goal if at is None else min(at, goal))
                self._watched.look()
                if stepping.done() or self._cell.now == goal:
                    break
                if not goes_on:
                    self._end_step()
                    break
        except Exception as error:
            if not stepping.done() and stepping.set_running_or_notify_cancel():
                stepping.set_exception(error)
            raise
        finally:
            self._pace.hold(self._cell.now)
        if stepping.done():
            return
        if self._cell.now < goal:
            following = self._subject.ask(lambda: self._step_on(goal, stepping))
            following.add_done_callback(lambda ended: stepping.cancel() if ended.cancelled() else None)
        elif stepping.set_running_or_notify_cancel():
            stepping.set_result(self._now())

    def _end_step(self) -> None:
        """Another word about time ends a step that takes long: whoever waits for it is told where the cell stands."""
        stepping, self._stepping = self._stepping, None
        if stepping is not None and not stepping.done() and stepping.set_running_or_notify_cancel():
            stepping.set_result({"reached": False, **whole_state(self._subject)})

    def _run_for(self, given: Given) -> "Future[Answer]":
        time = given["time"]
        assert isinstance(time, int)
        goal = at_time(lambda: self._cell, self._cell.now + time)
        return self._going(self._watched.wait([goal], self._reached_and_stand))

    def _going(self, reached: "Future[Answer]") -> "Future[Answer]":
        """Time goes on, for the one who waits. Raises AskedWrongly, and then nobody waits."""
        try:
            self._go({})
        except Exception:
            reached.cancel()
            raise
        return reached

    def _reached(self) -> Answer:
        return {"reached": True, **self._now()}

    def _reached_and_stand(self) -> Answer:
        self._stand({})
        return self._reached()

    def _change_pace(self, given: Given) -> Answer:
        pace = given["pace"]
        assert pace is None or isinstance(pace, float)
        held = self._pace.held
        self._subject.change_pace(pace)
        assert self._pace.held == held
        return self._now()

    def _wait(self, given: Given) -> "Future[Answer]":
        conditions: list[Condition] = []
        if "state" in given:
            unit = self._names.unit(given)
            words = [word.strip() for word in str(given["state"]).split(",")]
            axis = self._names.axis(unit, given)
            conditions.append(Condition(lambda: self._course(unit, axis) in words))
        if "position" in given:
            unit, position = self._names.unit(given), given["position"]
            assert isinstance(position, int)
            where = self._names.axis(unit, given)
            conditions.append(at_position(lambda: self._cell, self._watch, unit, where, position))
        if "pin" in given:
            name, text = self._names.pin(given, outputs=True)
            level = given.get("level", LOW)
            conditions.append(Condition(lambda: level_of(self._subject, name, text) == level))
        elif "level" in given:
            raise AskedWrongly("wait: a level of what", "name the pin too")
        if isinstance(time := given.get("time"), int):
            conditions.append(at_time(lambda: self._cell, time))
        if not conditions:
            raise AskedWrongly("wait: for what", "name a state, a position, a pin with its level, or a time")
        reached = self._watched.wait(conditions, self._reached_and_stand if given.get("pause") else self._reached)
        return self._going(reached) if given.get("resume") and not reached.done() else reached

    def _course(self, unit: str, axis: str) -> str:
        return self._cell.controller(unit).status(self._cell.now, axis).state

    # -- faults ------------------------------------------------------------------------------------------

    def _fault(self, given: Given) -> Answer:
        lasting = given.get("for")
        assert lasting is None or isinstance(lasting, int)
        self._subject.do(Break(breaking.fault_of(self._names, given), lasting))
        return {"fault": self._cell.faults.last, **self._now()}

    def _mend(self, given: Given) -> Answer:
        number = given.get("fault")
        standing = list(self._cell.faults.standing)
        if number is None:
            numbers = standing
        elif isinstance(number, int) and self._cell.faults.known(number):
            numbers = [one for one in standing if one == number]  # it may be over already
        else:
            raise verbs.unknown("fault", str(number), [str(known) for known in standing])
        for one in numbers:
            self._subject.do(Mend(one))
        mended: list[Json] = list(numbers)
        return {"mended": mended, **self._now()}


def _told(action: TimedAction) -> Json:
    """An entry of the journal."""
    return {"at_ns": action.at, "deed": type(action.what).__name__, **as_json(action.what)}
