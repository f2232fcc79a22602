"""The command that was typed: its four cycles, program mode, listings, NV memory, naming (pages 27, 47, 48, 49).

Entry is the link's. A command is then held until the action before it is complete (the pending period), executes
for its time, and answers with its result and the end of its line. While it is held or waits, only interrupts are
taken; while it executes, characters wait.
"""

from enum import Enum
from typing import Final, Protocol

from detent.controllers.dcb274 import commands, settings
from detent.controllers.dcb274.commands import ROWS, Instruction, Op, Refusal
from detent.controllers.dcb274.link import CR, LF, NO_NAME, Mode, is_name
from detent.controllers.dcb274.memory import PAGE, PARAMETERS, PROTECTED, SIZE
from detent.controllers.dcb274.program import END, SHADOW, allowed, encode
from detent.controllers.dcb274.running import Running
from detent.controllers.dcb274.work import Work
from detent.controllers.device import Output, Refused, StoreImage
from detent.ticks import MS, NEVER, Ns, instants

VERSION: Final = "V1.10"
PAGE_OF_LISTING: Final = 20  # instructions (page 48)


class Stage(Enum):
    """Where the typed command is."""

    FREE = "none"
    HELD = "pending: the action before is not complete"
    EXECUTING = "executing"  # until `timer`
    STORING = "storing"  # until the owner of the NV memory answers, in the same instant
    MOTION = "W: waiting for the motion"
    WAIT = "W: waiting for its time"  # until `timer`
    LISTING = "Q: waiting for a key"
    NAMING = "^N: waiting for the name"


_CLOSED = (Stage.HELD, Stage.MOTION, Stage.WAIT)
_BUSY = (Stage.EXECUTING, Stage.STORING)


class _Stored(Enum):
    """What is being stored, and so what follows when it is."""

    CELLS = "nothing follows"
    FACTORY = "factory values: they are loaded"
    NAME = "the name: the axis has it"
    INSTRUCTION = "an instruction of program mode, or its end mark"


class Speaker(Protocol):
    """Where answers go: the firmware, which knows the mode."""

    @property
    def mode(self) -> Mode:
        """How the controller listens."""

    def send(self, text: str, now: Ns) -> None:
        """Send characters as they are."""

    def spend_contacts(self) -> None:
        """A stop: GO and jog inputs that are active now count again only when they have been open."""


class Desk:
    """The command in hand of one unit. `timer` says when to call `advance`; call `poll` after everything else."""

    INSTANTS = instants(timer=0)

    def __init__(self, work: Work, running: Running, speaker: Speaker, out: list[Output]) -> None:
        self._work, self._running, self._speaker, self._out = work, running, speaker, out
        self.reset()

    def reset(self) -> None:
        """Nothing in hand; not in program mode."""
        self.stage = Stage.FREE
        self.timer: Ns = NEVER
        self.programming = False
        self._address = 0  # of the next instruction in program mode, or in a listing
        self._instruction: Instruction | None = None
        self._image = b""  # what is being stored
        self._cells: range | tuple[int, ...] = ()  # of it
        self._result = ""  # of the command that stores
        self._stored = _Stored.CELLS
        self._name = NO_NAME  # that is being stored
        self._ram = b""  # with the instruction that is being stored
        self._length = 0  # of that instruction

    @property
    def busy(self) -> bool:
        """Whether characters have to wait."""
        return self.stage in _BUSY

    @property
    def closed(self) -> bool:
        """Whether only interrupts are taken: the pending period, and W."""
        return self.stage in _CLOSED

    @property
    def setting_off(self) -> bool:
        """Whether the command in hand would set the axis in motion, and has not done so yet."""
        return (
            self.stage in (Stage.HELD, Stage.EXECUTING)
            and not self.programming
            and self._instruction is not None
            and self._work.moves(self._instruction)
        )

    @property
    def speeds_pending(self) -> bool:
        """Whether an M waits for the ramp of the M before it (page 28)."""
        return self.stage is Stage.HELD and self._instruction is not None and self._instruction.op is Op.VELOCITY

    # -- entry -------------------------------------------------------------------------------------------

    def enter(self, line: str, too_long: bool, now: Ns) -> None:
        """A line is complete. With nothing behind the name it asks whether the axis is there (page 26)."""
        if not line and not too_long and self._speaker.mode.named:
            self._finish("", now)
            return
        try:
            if too_long:
                raise Refusal("the line is too long")
            instruction = commands.parse(line)
            self._check(instruction)
        except Refusal as error:
            self._refuse(line, str(error), now)
            return
        self._instruction = instruction
        self.stage = Stage.HELD
        self.poll(now)

    def _check(self, instruction: Instruction) -> None:
        """Whether it may be typed here. Raises Refusal."""
        row = ROWS[instruction.op]
        if self.programming:
            if instruction.op is Op.PROGRAM:
                return
            if not row.stored:
                raise Refusal(f"{row.letter} cannot be stored")
            if not allowed(self._address, row.length):
                raise Refusal(f"no program byte may stand at {PARAMETERS.start} to {PARAMETERS.stop - 1}, or at {SIZE}")
        elif not row.typed:
            raise Refusal(f"{row.letter} works in programs only")
        elif instruction.op is Op.QUERY and self._speaker.mode.named:
            raise Refusal("Q lists in single mode only")

    def cancel(self, now: Ns) -> None:
        """A stop: the command that waits, or would set off a motion, is answered #."""
        self._finish("#", now)

    # -- execution ---------------------------------------------------------------------------------------

    def poll(self, now: Ns) -> None:
        """Look whether what the command waits for has come."""
        if self.stage is Stage.HELD:
            assert self._instruction is not None
            if self.programming:
                length = ROWS[self._instruction.op].length or 1
                self.stage, self.timer = Stage.EXECUTING, now + self._work.storing(self._address, length)
            elif self.setting_off and self._work.ports.stopped:
                self._refuse(commands.spell(self._instruction), "the soft stop input is active: nothing moves", now)
            elif self._work.ready(self._instruction, now):
                self.stage, self.timer = Stage.EXECUTING, now + self._work.time(self._instruction)
        elif self.stage is Stage.MOTION and not self._work.motion.indexing:
            assert self._instruction is not None
            self.stage, self.timer = Stage.WAIT, now + 10 * MS * self._instruction.values[0]

    def advance(self, at: Ns) -> None:
        """Deal with the deadline `at`."""
        self.timer = NEVER
        if self.stage is Stage.WAIT:
            self._finish("", at)
            return
        instruction = self._instruction
        assert instruction is not None
        try:
            if self.programming:
                self._store_instruction(instruction, at)
            else:
                self._execute(instruction, at)
        except Refusal as error:
            self._refuse(commands.spell(instruction), str(error), at)

    def _execute(self, instruction: Instruction, now: Ns) -> None:
        work, values = self._work, instruction.values
        match instruction.op:
            case Op.WAIT:
                self.stage = Stage.MOTION
                self.poll(now)
            case Op.GO:
                self._finish("", now)
                self._running.go(values[0], bool(values[1]), now)
            case Op.TERMINATE:
                if values[0] in (NO_NAME, work.settings.name):
                    self._speaker.spend_contacts()
                    work.motion.halt(now)
                self._finish("", now)
            case Op.SOFT_STOP:
                self._speaker.spend_contacts()
                self._finish(work.obey(instruction, now, named=self._speaker.mode.named), now)
            case Op.PROGRAM:
                self.programming, self._address = True, values[0]
                self._finish("", now)
            case Op.QUERY:
                self._address = values[0]
                self._speaker.send("\r\n", now)
                self._list(PAGE_OF_LISTING, now)
            case Op.SAVE:
                cells = work.settings.cells() | dict(enumerate(work.memory.ram, SHADOW.start))
                self._store(work.memory.with_bytes(cells), tuple(cells), now, _Stored.CELLS)
            case Op.CLEAR:
                self._clear(values[0], now)
            case Op.WRITE_MEMORY:
                self._store(work.memory.with_bytes({values[0]: values[1]}), (values[0],), now, _Stored.CELLS)
            case _:
                self._finish(work.obey(instruction, now, named=self._speaker.mode.named), now)

    def _clear(self, page: int, now: Ns) -> None:
        """C: reload the parameters (0), write factory values (1), or clear a page (2 to 8)."""
        memory, result = self._work.memory, f" {VERSION}"
        if page == 0:
            self._reloaded(now)
            self._finish(result, now)
            return
        first = (page - 1) * PAGE
        cells = dict.fromkeys(range(first, first + PAGE), END)
        if page == 1:
            cells = {a: v for a, v in {**cells, **settings.factory()}.items() if a not in PROTECTED}
            if (mode := memory.nv[settings.READOUT]) & 1:
                cells[settings.READOUT] = mode - 1  # "Auto Position Readout Off" (page 32); the cell is ours (E)
        self._store(
            memory.with_bytes(cells), tuple(cells), now, _Stored.FACTORY if page == 1 else _Stored.CELLS, result
        )

    def _reloaded(self, now: Ns) -> None:
        work = self._work
        registers, name, resolution = work.settings, work.settings.name, work.settings.resolution
        for_now = registers.plc_for_now
        work.memory.load_shadow()
        registers.load(work.memory)
        registers.plc_for_now = for_now  # "temporarily" is until a reset (page 45)
        if self._speaker.mode is Mode.DAISY:
            registers.name = name  # it has that one "until a hardware reset is made" (page 24)
        if registers.resolution != resolution:
            work.motion.reset_phase(now)
        work.trip.reset(now)
        work.ports.show(now)
        work.motion.options_changed(now)

    # -- NV memory ---------------------------------------------------------------------------------------

    def _store_instruction(self, instruction: Instruction, now: Ns) -> None:
        """Program mode: an instruction, or the end mark of the closing P, which ignores its address."""
        if instruction.op is not Op.PROGRAM:
            data = encode(instruction)
        else:
            data = bytes((END,)) if allowed(self._address) else b""
        cells = tuple(a for a in range(self._address, self._address + len(data)) if a not in SHADOW)
        self._ram, image = self._work.memory.put(self._address, data)
        self._length = len(data)
        if image is None:
            self._entered()
            self._finish("", now)
        else:
            self._store(image, cells, now, _Stored.INSTRUCTION)

    def _entered(self) -> None:
        """An instruction of program mode is in memory, or the end mark, which ends the mode."""
        assert self._instruction is not None
        self._work.memory.ram = self._ram
        self._address += self._length
        self.programming = self._instruction.op is not Op.PROGRAM

    def _store(self, image: bytes, cells: range | tuple[int, ...], now: Ns, what: _Stored, result: str = "") -> None:
        self.stage = Stage.STORING
        self._image, self._cells, self._result, self._stored = image, cells, result, what
        self._out.append(StoreImage(now, image))

    def store_name(self, name: int, now: Ns) -> None:
        """^N: the name is stored at once."""
        self._name = name
        self._store(self._work.memory.with_bytes({settings.NAME: name}), (settings.NAME,), now, _Stored.NAME)

    def stored(self, ok: bool, now: Ns) -> None:
        """The image was stored, or not: then the memory is as it was, and the command is answered #."""
        if self.stage is not Stage.STORING:
            return
        if ok:
            self._work.memory.commit(self._image, self._cells)
            match self._stored:
                case _Stored.NAME:
                    self._work.settings.name = self._name
                case _Stored.INSTRUCTION:
                    self._entered()
                case _Stored.FACTORY:
                    self._reloaded(now)
        self._image, self._name = b"", NO_NAME
        self._finish(self._result if ok else "#", now)

    # -- keys while listing or naming --------------------------------------------------------------------

    def key(self, value: int, now: Ns) -> None:
        """A key in a listing: CR the next 20 lines, any other one line."""
        if value != LF:
            self._list(PAGE_OF_LISTING if value == CR else 1, now)

    def ask_name(self, now: Ns) -> None:
        """^N."""
        self.stage = Stage.NAMING
        self._speaker.send("name?", now)

    def name(self, value: int, now: Ns) -> bool:
        """The name that was asked for; False for a character that is none."""
        if is_name(value):
            self._speaker.send(chr(value), now)
            self.store_name(value, now)
            return True
        self._finish("#", now)
        return False

    def _list(self, lines: int, now: Ns) -> None:
        """Lines of a listing; the last one is the bare end address."""
        self.stage = Stage.LISTING
        for _ in range(lines):
            instruction = self._work.memory.instruction(self._address)
            if instruction is None:
                self._finish(str(self._address), now)
                return
            self._speaker.send(f"{self._address} {commands.spell(instruction)}\r\n", now)
            self._address += ROWS[instruction.op].length

    # -- answers -----------------------------------------------------------------------------------------

    def _refuse(self, line: str, reason: str, now: Ns) -> None:
        self._out.append(Refused(now, line, reason))
        self._finish("#", now)

    def _finish(self, result: str, now: Ns) -> None:
        """Result and the end of the line: CR LF, or LF where lines have names."""
        self.stage, self.timer, self._instruction = Stage.FREE, NEVER, None
        self._speaker.send(result + ("\n" if self._speaker.mode.named else "\r\n"), now)
