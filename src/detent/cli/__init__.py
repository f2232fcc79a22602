"""The command `detent`: one verb a module, each imported only when it is used."""

import atexit
import gc
import os
import signal
import sys
import threading
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NoReturn

from detent.cli.codes import FAILED

if TYPE_CHECKING:
    from cyclopts import App, CycloptsError

TITLE = "Intelligent stepper motor controllers in software, exact to the pulse."
COMPLETION = "Write the script that completes detent in your shell."

VERBS = {
    "demo": ("detent.cli.demo:demo", "Run an example cell, tell what happens, and draw it."),
    "examples": ("detent.cli.examples:examples", "List the examples, or copy one into a folder of yours."),
    "models": ("detent.cli.models:models", "List the controllers, or show one with all its tables."),
    "workbench": ("detent.cli.workbench:workbench", "Show a controller or a cell in a browser, running in real time."),
    "serve": ("detent.cli.serve:serve", "Serve a controller or a cell in real time, until Ctrl-C."),
    "control": ("detent.cli.control:control", "Look at a cell that is served, meddle with it, break it."),
    "boards": ("detent.cli.boards:boards", "Find boards with Klipper firmware; boards check proves a wiring."),
    "service": ("detent.cli.service:service", "Print a systemd unit that serves a cell from power-on."),
    "run": ("detent.cli.run:run", "Run a controller or a cell in virtual time and say where everything ended."),
    "asm": ("detent.cli.assemble:asm", "Assemble a program: labels and comments in, commands or an image out."),
    "list": ("detent.cli.assemble:list_", "List a program source with the address and bytes of every instruction."),
    "disasm": ("detent.cli.assemble:disasm", "Turn a program image back into source, with labels for its jumps."),
    "find": ("detent.cli.find:find", "Look for controllers, at the serial ports of this computer or at those named."),
    "send": ("detent.cli.send:send", "Send command lines to a unit and print what it answers."),
    "terminal": ("detent.cli.terminal:terminal", "Talk to a unit: type command lines, see answers and meaning."),
    "bench": ("detent.cli.link_bench:bench", "Measure reply times and throughput of a link."),
    "backup": ("detent.cli.backup:backup", "Write everything that a unit keeps to a readable file."),
    "restore": ("detent.cli.backup:restore", "Write a backup back to a unit."),
    "upload": ("detent.cli.program:upload", "Assemble a program and store it in a unit, verified."),
    "download": ("detent.cli.program:download", "Read the program of a unit, as source with labels."),
    "compare": ("detent.cli.program:compare", "Compare the program of a unit with a source file."),
    "motor": ("detent.cli.motor:motor", "Say what a motor makes of its pulses: torque against speed, a move judged."),
    "tune": ("detent.cli.tune:tune", "Find the fastest settings with which a motor and its load lose no step."),
    "compare-moves": ("detent.cli.compare_moves:compare_moves", "Compare settings: times, loss rates, torque used."),
    "table": ("detent.cli.table:table", "Compile a curve into the table of differences of a SUPERSIGMA drive."),
    "size": ("detent.cli.size:size", "Compute supplies and currents for a controller, as its manual does."),
    "wiring": ("detent.cli.wiring:wiring", "Find a motor's windings from the resistances between its leads."),
    "docs": ("detent.cli.docs:docs", "Open the documentation in a browser, or say where it is."),
    "epics": ("detent.cli.epics:epics", "Serve axes as EPICS motor records by Channel Access, until Ctrl-C."),
}
"""Each verb's function, and its first line of help, which `detent --help` shows without importing the function."""


def application(asked: str = "") -> "App":
    """The command line. The verb that is `asked` ("*": each) has its whole help, the others have a line of it."""
    from cyclopts import App, Parameter

    import detent

    app = App(
        name="detent",
        help=TITLE,
        version=detent.__version__,
        default_parameter=Parameter(negative=(), show_default=_default),
        exit_on_error=False,
        print_error=False,
    )
    for place, (name, (function, line)) in enumerate(VERBS.items()):
        # A help text given here would replace the function's own, which the verb's --help shows whole.
        short = {} if asked in (name, "*") else {"help": line}
        app.command(function, name=name, sort_key=place, **short)
    app.command("detent.cli.completing:install", name="--install-completion", help=COMPLETION)
    return app


def _default(value: object) -> str | None:
    """A default as help shows it; nothing for one that says nothing."""
    if value is None or value is False or value in ("", (), [], {}):
        return None
    return f"{value:g}" if isinstance(value, float) else str(value)


def command() -> None:
    """The command `detent`: `main` in a process of its own."""
    atexit.register(gc.freeze)  # it ends without being looked through for garbage
    if sys.argv[1:2] == ["motor"]:  # half of its time was spent here
        gc.disable()  # what numba loads stays
        sys.modules["scipy"] = None  # type: ignore[assignment]  # numba would load its linear algebra, to no use
    main()


def main(tokens: Sequence[str] | None = None) -> None:
    """Run the command line and exit: 0, 1 (it failed), 2 (it was asked wrongly)."""
    from detent.cli import endings, overview, plain

    given = list(sys.argv[1:] if tokens is None else tokens)
    plain.open_closed()
    plain.find_columns()
    if overview.is_asked_for(given):
        try:
            overview.show(TITLE, [(name, line) for name, (_, line) in VERBS.items()], COMPLETION)
        except BrokenPipeError:
            _nobody_reads()
        except OSError as error:  # a disk that is full
            endings.failed(endings.of_system(error))
        sys.exit(0)

    from cyclopts import CycloptsError

    from detent.extras import MissingExtra

    plain.make_safe()
    before = _hear_termination()
    try:
        application(given[0] if given else "")(given)
    except CycloptsError as error:
        verb = given[0] if given and given[0] in VERBS else ""
        endings.asked_wrongly(f"{_told(error, given)} See: detent {verb} --help".replace("  ", " "))
    except MissingExtra as error:
        endings.asked_wrongly(error)
    except BrokenPipeError:
        _nobody_reads()
    except OSError as error:  # of a file that a verb has not looked for: a name that is too long, a disk that is gone
        endings.failed(endings.of_system(error))
    except KeyboardInterrupt:
        sys.exit(130)
    finally:
        for ending, handler in before.items():
            signal.signal(ending, handler)


def _told(error: "CycloptsError", given: Sequence[str]) -> str:
    """What is wrong with a command line, in one sentence.

    Where a load may have a force, `--force` is that; elsewhere it means `--overwrite` (see `overwrite`).
    """
    from cyclopts import UnknownOptionError

    told = " ".join(str(error).split()) or "this cannot be read"
    if any(word.split("=")[0] == "--force" for word in given) and not isinstance(error, UnknownOptionError):
        return f"{told} It is a force in N; to write over a file: --overwrite." if "--force" in told else told
    return told


def _nobody_reads() -> NoReturn:
    """Whoever read what is printed has had enough."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(FAILED)


def _hear_termination() -> dict[int, Any]:
    """SIGTERM and a terminal that is closed end a verb as Ctrl-C does, so that it tidies up.

    No temporary file stays, no motor turns on. Returns how it was before; what somebody ignores (nohup) stays so.
    """
    if threading.current_thread() is not threading.main_thread():
        return {}

    def terminated(number: int, _: object) -> None:
        sys.exit(128 + number)

    endings = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    heard = [number for number in endings if signal.getsignal(number) is not signal.SIG_IGN]
    return {number: signal.signal(number, terminated) for number in heard}
