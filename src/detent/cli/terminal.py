"""The verb `terminal`: typing to a unit, with history, and with completion and help from its command table."""

import json as json_text
import queue
import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from detent.cli.codes import FAILED
from detent.cli.send import escaped, shown
from detent.cli.unit import NO_UNIT_OPTIONS, UnitOptions

if TYPE_CHECKING:
    from prompt_toolkit import PromptSession
    from prompt_toolkit.completion import CompleteEvent, Completion
    from prompt_toolkit.document import Document
    from prompt_toolkit.history import History

    from detent.hosts.exchange import Blocking
    from detent.workbench.words import Word

    Words: TypeAlias = tuple[Word, ...]

LOOK = 0.2  # seconds between looks for what nobody has asked for
EMULATED = UnitOptions(patience=10.0)  # what shares this process may take its time


def terminal(
    model: str,
    port: str | None = None,
    *,
    json: bool = False,
    unit: UnitOptions = NO_UNIT_OPTIONS,
) -> None:
    """Talk to a unit: type command lines, see answers and meaning.

    Checksums, CR, names and echoes are seen to. Tab completes commands, the bottom line says what the one being typed
    does, the arrow keys go through what was typed before, Ctrl-C gives up waiting for an answer, Ctrl-D ends.
    On a DCB-274 the words ESC, ^C, ^P and ^N NAME stand for those characters.

    Lines that come from a pipe or a file are sent one after the other; it ends with 1 if one was refused or failed.

    For example: `detent terminal gs-c200 /dev/ttyUSB0`

    Parameters
    ----------
    model
        The controller: gs-c200, dcb-274, ...
    port
        A serial device or a link to one, HOST:PORT, or rfc2217://HOST:PORT. Without it a unit is emulated here, in
        real time, for as long as you talk to it.
    json
        Print a line of JSON for each exchange.
    unit
        Which unit is meant, and its line.
    """
    from detent.cli.endings import asked_wrongly
    from detent.cli.unit import unit as connected
    from detent.controllers import catalogue
    from detent.workbench.words import words

    try:
        known = words(model)
    except catalogue.CatalogueError as error:
        asked_wrongly(error)
    with ExitStack() as stack:
        where = port
        if where is None:
            where, unit = stack.enter_context(_emulated(model, unit)), EMULATED
        found = stack.enter_context(connected(model, where, unit))
        piped: _Piped | None = None
        if sys.stdin.isatty():
            if not json:
                emulated = "an emulated " if port is None else "the "
                print(f"Talking to {emulated}{catalogue.model(model).title} at {where}. Tab completes, Ctrl-D ends.")
            lines: Iterable[str] = _typed(prompt(model, known), found, json)
        else:
            lines = piped = _Piped(echo=not json)
        sound = True
        for line in lines:
            if line.strip():
                sound &= _exchange(found, line, json, piped)
    if not sound and not sys.stdin.isatty():
        raise SystemExit(FAILED)


def _exchange(unit: "Blocking", line: str, json: bool, piped: "_Piped | None") -> bool:
    """Say one line and print what comes of it, until a program that it has started ends. Whether it was taken."""
    from detent.hosts.errors import DriverError
    from detent.hosts.typed import MOTION, cuts_in, listen, say

    printed: list[str] = []

    def heard(text: str) -> None:
        printed.append(escaped(text.strip().encode("latin-1")))
        if not json:
            print(f"| {printed[-1]}", flush=True)

    def enough() -> bool:
        return piped is not None and cuts_in(unit.driver, piped.next_line)

    try:
        unasked = unit.port.receive(0.0)
        for text in () if json else _texts(unasked):
            print(f"< {text}  (came without being asked)")
        said = unit.perform(say(unit.driver, line, MOTION, heard))
        if not json:
            print(shown(said), flush=True)
        patience = MOTION if piped is not None else float("inf")  # a person presses Ctrl-C
        became = unit.perform(listen(unit.driver, patience, heard, enough))
        if became and not json:
            print(f"< ({became})", flush=True)
    except (DriverError, ValueError, OSError) as error:
        if json:
            print(json_text.dumps({"sent": line, "error": str(error)}), flush=True)
        else:
            print(f"! {getattr(error, 'told', error)}", flush=True)
        return False
    except KeyboardInterrupt:
        unit.driver.forget()  # half an exchange is under way
        print("! not waited for any longer", file=sys.stderr)
        return False
    if json:
        facts = {"sent": line, **said._asdict(), "printed": printed, "unasked": escaped(unasked)}
        print(json_text.dumps(facts | ({"program": became} if became else {})), flush=True)
    return not said.refused


class _Piped:
    """The lines of standard input, each shown before it is sent; the one behind can be seen while one is said."""

    def __init__(self, *, echo: bool) -> None:
        self._echo = echo
        self._lines: queue.Queue[str | None] = queue.Queue()
        threading.Thread(target=self._read, name="standard input", daemon=True).start()

    def _read(self) -> None:
        for line in sys.stdin:
            self._lines.put(line)
        self._lines.put(None)

    @property
    def next_line(self) -> str:
        """The line that will be said next, as far as it has come."""
        with self._lines.mutex:
            return (self._lines.queue[0] or "") if self._lines.queue else ""

    def __iter__(self) -> Iterator[str]:
        while (line := self._lines.get()) is not None:
            if self._echo and line.strip():
                print(f"> {line.strip()}")
            yield line.rstrip("\r\n")


def _texts(came: bytes) -> list[str]:
    """The lines in what came, for people."""
    return [escaped(line.strip().encode("latin-1")) for line in came.decode("latin-1").splitlines() if line.strip()]


def _typed(session: "PromptSession[str]", unit: "Blocking", json: bool) -> Iterator[str]:
    """The lines that are typed, until Ctrl-D; Ctrl-C empties the line. What comes meanwhile is shown above it."""
    while True:
        try:
            with _overheard(unit, json):
                line = session.prompt()
            yield line
        except KeyboardInterrupt:
            continue
        except EOFError:
            return


@contextmanager
def _overheard(unit: "Blocking", json: bool) -> Iterator[None]:
    """Show what a unit says while nobody has asked it anything: continuous reports, a program that a switch started."""
    from prompt_toolkit.patch_stdout import patch_stdout

    over = threading.Event()

    def hear() -> None:
        while not over.wait(LOOK):
            try:
                with unit.port.turn():
                    came = unit.port.receive(0.0)
            except OSError:
                return  # the next line tells
            for text in _texts(came):
                print(json_text.dumps({"unasked": text}) if json else f"< {text}  (came without being asked)")

    with patch_stdout():
        thread = threading.Thread(target=hear, name="overhearing", daemon=True)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()


def prompt(model: str, known: "Words") -> "PromptSession[str]":
    """A prompt with history, completion and help."""
    from prompt_toolkit import PromptSession
    from prompt_toolkit.completion import Completer, Completion

    class Commands(Completer):
        """The commands that may be meant by what has been typed."""

        def get_completions(self, document: "Document", complete_event: "CompleteEvent") -> "Iterator[Completion]":
            begun, fitting = fits(known, document.text_before_cursor)
            # a command with several spellings is offered once, the shortest of them
            rows = {row: word for word in fitting for row in word.rows}
            for row, word in sorted(rows.items(), key=lambda item: item[1].spelling.lower()):
                text = word.spelling + " " * word.whole
                yield Completion(text, -len(begun), display=row.command, display_meta=row.what)

    session: PromptSession[str] = PromptSession(
        f"{model}> ", history=_history(model), completer=Commands(), complete_while_typing=False
    )
    session.bottom_toolbar = lambda: " " + explained(known, session.default_buffer.document.text_before_cursor)
    return session


def _history(model: str) -> "History":
    """What was typed to this model before, if it can be kept."""
    from prompt_toolkit.history import FileHistory, InMemoryHistory

    from detent.realtime.images import default_folder

    file = Path(default_folder()) / f"{model}.history"
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
    except OSError as error:
        print(f"detent: {file}: {error.strerror}: what is typed is not kept", file=sys.stderr)
        return InMemoryHistory()
    return FileHistory(str(file))


def fits(known: "Words", text: str) -> "tuple[str, Words]":
    """How much of `text` belongs to a command that is being typed, and the words that it may become.

    Words of several letters begin a line. One-letter commands of a line without spaces follow one another.
    """
    begun = text.lstrip()
    fitting = tuple(word for word in known if word.spelling.startswith(begun))
    if fitting or not _in_a_row(known):
        return begun, fitting
    return "", known


def explained(known: "Words", text: str) -> str:
    """One line of help for the command that is being typed, or that was typed last."""
    typed = text.strip()
    if _in_a_row(known):
        letters = [letter for letter in typed if any(letter == word.spelling for word in known)]
        typed = letters[-1] if letters else ""
    for word in known:  # the longest first
        if typed and typed.startswith(word.spelling):
            return "   ".join(
                f"{row.command}: {row.what}" + (f" ({row.argument})" if row.argument else "") for row in word.rows
            )
    return "Tab: the commands"


def _in_a_row(known: "Words") -> bool:
    """Whether a line holds many commands, with their numbers before them, as those of GenStepper."""
    return any(row.type == "choice" for word in known for row in word.rows)


@contextmanager
def _emulated(model: str, options: UnitOptions) -> Iterator[str]:
    """A unit of this process, served in real time on a pseudo-terminal: its address."""
    from detent.cell.description import single
    from detent.cli.endings import asked_wrongly
    from detent.realtime.service import Service
    from detent.ticks import SECOND

    if options != NO_UNIT_OPTIONS:
        asked_wrongly(ValueError("without PORT a unit as it is by default is emulated: leave the other options out"))

    def no_file(name: str) -> str:
        raise FileNotFoundError(name)

    with Service(single(model), no_file) as service:
        service.cell.run_to(SECOND)  # it has been on for a while: a board that is reset says nothing at first
        with service.in_thread():
            yield service.endpoints[0].address
