"""What the Program page asks of the server: facts of the language, checks, memory and breakpoints.

Everything is a call that a window makes (see `live`); texts and answers are plain data. Files and drafts
are in `filing`.
"""

from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from detent.assembler import ImageError
from detent.workbench.answers import CheckedProgram, ComparedProgram, ProgramFacts
from detent.workbench.beside import beside
from detent.workbench.drafts import LONGEST
from detent.workbench.live import Live
from detent.workbench.programs import Checked, Program
from detent.workbench.stops import BOARDS
from detent.workbench.words import words

if TYPE_CHECKING:
    from detent.workbench.client import Bench

Text = Annotated[str, Field(max_length=LONGEST)]
Name = Annotated[str, Field(max_length=1024)]
Address = Annotated[int, Field(ge=0, le=1 << 16)]

CALLS = ("about", "check", "load", "save", "compare", "fetch", "breakpoint", "breaks", "run_to")


class Editing:
    """The calls of the Program page, offered as ``program_about`` and so on."""

    def __init__(self, bench: "Bench", live: Live) -> None:
        """Offers the calls, and shows the breakpoints of each unit as ``u.UNIT.breaks`` from now on."""
        self._bench, self._live = bench, live
        self._memory: dict[str, tuple[int, bytes]] = {}  # by unit: the count of changes, and what was read then
        for name in CALLS:
            live.offer(f"program_{name}", getattr(self, name), moves=BOARDS if name in ("load", "save") else "")
        bench.on_change(self._show_breakpoints)
        self._show_breakpoints()

    def _show_breakpoints(self) -> None:
        state = self._bench.state
        self._live.put({f"u.{unit}.breaks": [*sorted(state.breakpoints.get(unit, ()))] for unit in state.units})

    def _program(self, unit: str) -> Program:
        try:
            return self._bench.program(unit)
        except KeyError:
            raise ValueError(f"there is no unit {unit!r}") from None

    # -- the text ------------------------------------------------------------------------------------------

    async def about(self, unit: Name) -> ProgramFacts:
        """What the editor must know of a unit, and the text that it begins with where there is no draft."""
        program, picture = self._program(unit), self._bench.picture.units[unit]
        source = self._bench.sources.get(unit, "")
        if not source and program.language is not None and picture.capacity:
            source = await self._listed(unit)
        return {
            "unit": unit, "model": picture.model, "title": picture.title, "language": program.language is not None,
            "comment": program.comment, "capacity": program.capacity, "nonvolatile": picture.nonvolatile,
            "words": [
                {
                    "spelling": word.spelling, "whole": word.whole,
                    "rows": [
                        {
                            "form": row.command, "takes": row.argument, "bytes": row.bytes, "when": row.when,
                            "what": row.what, "section": row.section, "stored": row.bytes > 0,
                        }
                        for row in word.rows
                    ],
                }
                for word in words(picture.model)
            ],
            "file": picture.file, "source": source, "line": picture.line,
        }  # fmt: skip

    async def check(self, unit: Name, text: Text) -> CheckedProgram:
        """Errors, addresses and labels of a text, and whether it is what program memory holds."""
        checked = await beside(self._program(unit).check, text)
        return {
            "errors": [(wrong.line, wrong.column, wrong.length, wrong.message) for wrong in checked.errors],
            "places": [(line, place.address, len(place.code)) for line, place in checked.places.items()],
            "labels": dict(checked.labels), "used": checked.used, "capacity": checked.capacity,
            "loaded": not checked.errors and await self._holds(unit, checked),
        }  # fmt: skip

    # -- memory --------------------------------------------------------------------------------------------

    async def load(self, unit: Name, text: Text, start: bool) -> str:
        """Put a text into program memory, and start it if wanted. What came of it, in words."""
        checked = await self._sound(unit, text)
        await self._bench.load(unit, checked.image, checked.base)
        if start:
            await self._bench.start(unit)
        return f"{checked.used} bytes loaded" + (", and started" if start else "")

    async def save(self, unit: Name) -> str:
        """Keep program memory without supply, by the unit's own command. What it answered."""
        return await self._bench.save(unit)

    async def compare(self, unit: Name, text: Text, kept: bool) -> ComparedProgram:
        """Read memory back (`kept`: what is kept without supply): the lines that differ, and words for it."""
        checked = await self._sound(unit, text)
        image = await self._bench.read_back(unit, kept=kept)
        lines = await beside(self._program(unit).differences, text, image)
        where = "what is kept without supply" if kept else "program memory"
        if not lines and self._holds_all(unit, checked, image):
            return {"lines": [], "words": f"{where} holds just this program", "same": True}
        if not image:
            words = f"{where} is empty"
        elif lines:
            words = f"{where} differs in {len(lines)} line{'s' * (len(lines) != 1)}"
        else:
            words = f"{where} holds more: {len(image)} bytes, the text has {checked.used}"
        return {"lines": [*lines], "words": words, "same": False}

    async def fetch(self, unit: Name, kept: bool) -> str:
        """Read memory back as source."""
        image = await self._bench.read_back(unit, kept=kept)
        if not image:
            raise ValueError("there is no program")
        try:
            return self._program(unit).disassemble(image)
        except ImageError as error:
            raise ValueError(str(error)) from None

    async def _sound(self, unit: str, text: str) -> Checked:
        """The text assembled, beside the loop. ValueError with its first error."""
        checked = await beside(self._program(unit).check, text)
        if checked.errors:
            first, more = checked.errors[0], len(checked.errors) - 1
            others = f" ({more} more)" if more else ""
            raise ValueError(f"line {first.line}: {first.message}{others}")
        return checked

    async def _listed(self, unit: str) -> str:
        """Program memory as source; "" if it holds none."""
        try:
            return await self.fetch(unit, False)
        except ValueError:
            return ""

    async def _holds(self, unit: str, checked: Checked) -> bool:
        """Whether program memory, read anew when it has changed, holds the checked text."""
        state = self._bench.state.units.get(unit)
        if state is None or not state.powered:
            return False
        known = self._memory.get(unit)
        if known is None or known[0] != state.memory:
            known = self._memory[unit] = state.memory, await self._bench.read_back(unit)
        return self._holds_all(unit, checked, known[1])

    def _holds_all(self, unit: str, checked: Checked, image: bytes) -> bool:
        """Whether `image` is the checked text, and no more where a program is all that memory can hold."""
        language = self._program(unit).language
        if language is None or not checked.places:
            return False
        if language.closed and len(image) != len(checked.image):
            return False
        return all(image[place.address : place.end] == place.code for place in checked.places.values())

    # -- the debugger --------------------------------------------------------------------------------------

    async def breakpoint(self, unit: Name, address: Address, on: bool) -> None:
        """A breakpoint of a unit is there from now on, or not; the others stay."""
        await self._bench.set_breakpoint(unit, address, on=on)

    async def breaks(self, unit: Name, addresses: Annotated[list[Address], Field(max_length=1000)]) -> None:
        """The breakpoints of a unit."""
        await self._bench.set_breakpoints(unit, addresses)

    async def run_to(self, unit: Name, address: Address) -> None:
        """Go on, and stop at an address."""
        await self._bench.run_to(unit, address)
