"""Writes the parts of the pages that come from the tables and from the firmware itself: `make docs`.

Such a part stands between `<!-- generated: NAME -->` and `<!-- end -->`; `PARTS` has a function for each name. What a
command does in which mode is not copied from a table but asked of the firmware, by sending it.
"""

import json
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from functools import cache, partial
from itertools import product
from pathlib import Path
from typing import Final

from detent.axis import Axis
from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import single
from detent.cell.parts import PARTS as CELL_PARTS
from detent.cli import VERBS
from detent.cli.control import usage
from detent.cli.models import reference
from detent.controllers import catalogue
from detent.controllers.genstepper import commands as genstepper_commands
from detent.controllers.gsc200 import commands, pins, program
from detent.controllers.gsc200.commands import GS_C200, GS_C200S, Instruction, Op, Row
from detent.controllers.gsc200.link import LONGEST
from detent.controllers.gsc200.motion import Motion
from detent.controllers.supersigma import link as supersigma_link
from detent.controllers.supersigma.program import OFFSET
from detent.pins import LOW, PinDriver
from detent.ramps.differences import PAPER
from detent.ramps.rate_generator import CLOCK_HZ
from detent.ramps.short_movements import choose, movement
from detent.ramps.ways import Way
from detent.realtime import openapi, verbs
from detent.ticks import show_duration

sys.path.insert(0, str(Path(__file__).parent))

import cell_keys
import mode_diagram

DOCS: Final = Path(__file__).parent
MARKED: Final = re.compile(r"(<!-- generated: (.+?) -->\n).*?(<!-- end -->)", re.DOTALL)


def page(text: str) -> str:
    """The page with every generated part as it should be. KeyError for a part that nobody makes."""
    return MARKED.sub(lambda match: f"{match[1]}\n{PARTS[match[2]]().strip()}\n\n{match[3]}", text)


def names(text: str) -> list[str]:
    """The generated parts of a page."""
    return [match[2] for match in MARKED.finditer(text)]


def pages() -> list[Path]:
    """All pages."""
    return sorted(page for page in DOCS.rglob("*.md") if "_build" not in page.parts)


def main() -> None:
    """Rewrite what has changed."""
    for path, text in ((DOCS / name, make()) for name, make in FILES.items()):
        if not path.exists() or path.read_text() != text:
            path.write_text(text)
            print(f"{path.relative_to(DOCS.parent)} rewritten", file=sys.stderr)
    for path in pages():
        before = path.read_text()
        after = page(before)
        if after != before:
            path.write_text(after)
            print(f"{path.relative_to(DOCS.parent)} rewritten", file=sys.stderr)


def table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table in Markdown."""
    lines = ["| " + " | ".join(columns) + " |", "|" + " --- |" * len(columns)]
    lines += ["| " + " | ".join(str(cell).replace("|", "\\|") for cell in row) + " |" for row in rows]
    return "\n".join(lines)


# -- from the tables of the GS-C200 ------------------------------------------------------------------------


def section(model: str, title: str) -> str:
    """One table of `detent models MODEL --markdown`, with its heading."""
    text = reference(catalogue.model(model))
    return next(part for part in re.split(r"^(?=### )", text, flags=re.MULTILINE) if part.startswith(f"### {title}"))


def pin_table() -> str:
    """The pins, which are the same for both models."""
    found = [section(model, "Pins") for model in commands.MODELS]
    assert found[0].partition("\n")[2] == found[1].partition("\n")[2]
    return found[0].partition("\n")[2]


def addresses() -> str:
    """The addresses of the SEL straps, in the datasheet's order."""
    rows = []
    for sel0, sel1, sel2 in product((0, 1), repeat=3):
        address = pins.address({"SEL0": sel0, "SEL1": sel1, "SEL2": sel2})
        protocol = "point to point" if address is None else "multipoint"
        rows.append((sel2, sel1, sel0, "-" if address is None else address, protocol))
    return table(("SEL2", "SEL1", "SEL0", "address", "protocol"), rows)


def rates() -> str:
    """The line formats of the BR straps, in the datasheet's order."""
    rows = []
    for br2, br1, br0 in product((0, 1), repeat=3):
        form = pins.character_format({"BR0": br0, "BR1": br1, "BR2": br2})
        rows.append((br0, br1, br2, form.baud, str(form), show_duration(form.duration())))
    return table(("BR0", "BR1", "BR2", "baud", "format", "a character takes"), rows)


def numbers() -> str:
    """Constants of the firmware."""
    motion = Motion(Axis([]), PinDriver([]), {}, pins.CLOCK_OUTPUT)
    time = next(option for option in catalogue.model(GS_C200).options if option.name == "instruction_time")
    return table(
        ("what", "value"),
        (
            ("program memory", f"{program.CAPACITY} bytes, addresses 0 to {commands.LAST_ADDRESS}"),
            ("longest frame from the host", f"{LONGEST} characters before CR"),
            ("speeds and ramp until they are set", f"S{motion.start_stop} T{motion.slew} R{motion.ramp}"),
            ("time of an instruction (option `instruction_time`)", time.default),
            ("step pulse: CLOCK low for", show_duration(pins.CLOCK_LOW_NS)),
            ("reset pulse: RESET low for", show_duration(pins.RESET_LOW_NS)),
        ),
    )


EXAMPLES: Final = (
    (GS_C200, "A2 C3 D255 G500000 G+2 G- L0 L10 R50 S30 T300 U2 W2 +500000 -800"),
    (GS_C200S, "f-5 G-5 g+2 g- I3 j40 jc2,74"),
)


def image_bytes() -> str:
    """Instructions with their bytes in an image."""
    rows, shown = [], set()
    for model, examples in EXAMPLES:
        for text in examples.split():
            instruction = commands.parse(model, text)
            shown.add(instruction.op)
            code = program.encode(instruction)
            rows.append((f"`{text}`", model.upper(), len(code), f"`{code.hex(' ').upper()}`"))
    assert shown == {row.op for row in commands.TABLE if row.stored}
    return table(("instruction", "model", "bytes", "image"), rows)


# -- from the firmware: what each command does in each mode ------------------------------------------------

TITLES: Final = {
    "off": "no supply", "ready": "command mode", "programming": "programming mode",
    "running": "running", "homing": "homing",
}  # fmt: skip
ENTER: Final = {GS_C200: "P", GS_C200S: "Po"}


class Probe:
    """One module that is asked what it does. Its line takes no time."""

    def __init__(self, model: str, straps: dict[str, int | str] | None = None) -> None:
        description = single(model, straps=straps)
        self.model = model
        self.cell: Cell = build(description, lambda file: "", line_timing=False)

    @property
    def state(self) -> str:
        """The word that `status` has for its mode."""
        return self.cell.controller(self.model).status(self.cell.now).state

    def send(self, text: str) -> list[str]:
        """The answers to a command line."""
        line = self.cell.lines[0]
        line.take()
        self.cell.type(self.model, text)
        heard = bytes(character.char.value for character in line.take())
        return self.cell.controller(self.model).answers(heard)

    def to(self, state: str) -> "Probe":
        """The module in this state; it has a program of one long delay in memory."""
        for text in (ENTER[self.model], "D255", "E", "K"):
            assert self.send(text) == ["Y"]
        into = {"ready": (), "programming": (ENTER[self.model], "D255"), "running": ("E",), "homing": ("H",)}
        for text in into[state]:
            assert self.send(text) == ["Y"]
        assert self.state == state
        return self


def sample(model: str, row: Row) -> str:
    """A command of this row that is right by itself."""
    found = next(Instruction(row.op, value) for value in (1, 0) if row.argument.admits(value, 0))
    return commands.spell(model, found)


def outcome(model: str, row: Row, state: str) -> tuple[str, str]:
    """What is answered to a command of this row in this state, in words, and the state behind it."""
    probe = Probe(model).to(state)
    answers = probe.send(sample(model, row))
    after = probe.state
    if row.op is Op.QUERY and answers[-1] == "END":
        return "the program", after
    (answer,) = answers
    if state == "programming" and answer == "Y" and after == state and len(probe.send("Q")) > len(["D255", "END"]):
        return "stored", after
    return answer if answer[0] != "V" else "V...", after


def outcomes(model: str) -> str:
    """A table: command by state."""
    states = ("ready", "programming", "running", "homing")
    rows = []
    for row in commands.rows(model):
        cells = []
        for state in states:
            answer, after = outcome(model, row, state)
            cells.append(answer if after == state else f"{answer}, {TITLES[after]}")
        rows.append((" ".join(f"`{form}`" for form in row.forms).replace("`s", "`±") if row.op is Op.MOVE
                     else " ".join(f"`{form}`" for form in row.forms), *cells))  # fmt: skip
    return table(("command", *(TITLES[state] for state in states)), rows)


PLACES: Final = {"off": (520, 45), "homing": (105, 210), "ready": (520, 210), "programming": (935, 210),
                 "running": (520, 430)}  # fmt: skip
"""Where the modes stand in the picture."""


@cache
def ways() -> dict[tuple[str, str], str]:
    """What leads from one mode to another, as the firmware does it: commands, and what happens by itself."""
    found: dict[tuple[str, str], dict[str, list[str]]] = {}
    for model in commands.MODELS:
        for row in commands.rows(model):
            for state in ("ready", "programming", "running", "homing"):
                _, after = outcome(model, row, state)
                if after != state:
                    found.setdefault((state, after), {}).setdefault(row.name, []).append(model)
        for start, end, why in by_itself(model):
            found.setdefault((start, end), {}).setdefault(why, []).append(model)
    order = list(TITLES)
    return {
        way: ", ".join(_only(name, models) for name, models in found[way].items())
        for way in sorted(found, key=lambda way: [order.index(state) for state in way])
    }


def diagram() -> str:
    """The modes and what leads from one to another, drawn and in words."""
    rows = ((TITLES[start], TITLES[end], why) for (start, end), why in ways().items())
    drawn = "![Modes of the GS-C200 and what leads from one to another: the table below](../pictures/gsc200-modes.svg)"
    return f"{drawn}\n\n" + table(("from", "to", "by"), rows)


def mode_picture() -> str:
    """The same as a picture."""
    return mode_diagram.picture(PLACES, TITLES, ways(), {"ready": 18, "homing": 28, "running": 20, "programming": 34})


def by_itself(model: str) -> list[tuple[str, str, str]]:
    """What changes the mode without a command: start, end, reason."""
    found = []

    def note(start: str, probe: Probe, why: str) -> None:
        found.append((start, probe.state, why))

    note("off", Probe(model), "power on")
    running = Probe(model).to("running")
    while running.cell.step() is not None:
        pass
    note("running", running, "the program or command ends")
    homing = Probe(model).to("homing")
    for pin in ("EOT", "HOME"):
        homing.cell.set_pin(model, pin, LOW)
    note("homing", homing, "EOT, then HOME is 0")
    recall = Probe(model, {"REC": "low"})
    recall.cell.power(model, False)
    recall.cell.controller(model).restore(program.encode(commands.parse(model, "D255")))
    recall.cell.power(model, True)
    note("off", recall, "power on with REC low")
    for pin in ("EOT", "HOME"):
        recall.cell.set_pin(model, pin, LOW)
    note("homing", recall, "EOT, then HOME is 0, where it began at power on")
    return found


def _only(name: str, models: Sequence[str]) -> str:
    return name if {*models} == {*commands.MODELS} else f"{name} ({models[0].upper()})"


# -- from the parts of a cell ------------------------------------------------------------------------------


def cell_keys_of(kind: type[object]) -> str:
    """Every key of a table of a cell file."""
    return table(("key", "takes", "default", "what"), cell_keys.rows(kind))


def cell_parts() -> str:
    """Units that are no controllers."""
    text = []
    for part in CELL_PARTS.values():
        text.append(f"### `{part.name}`: {part.title}\n")
        text.append(table(("pin", "kind", "what"), ((f"`{p.name}`", p.kind.value, p.help) for p in part.pins)))
        text.append("")
        rows = ((f"`{o.name}`", o.takes, o.default, o.help) for o in part.options)
        text.append(table(("option", "takes", "default", "what"), rows))
        text.append("")
    return "\n".join(text)


# -- of the SUPERSIGMA drive ---------------------------------------------------------------------------------


def drive_section(title: str) -> str:
    """A table of the drive without its heading."""
    return section("supersigma", title).partition("\n")[2]


def flags() -> str:
    """The bits of the third byte of an answer."""
    rows = ((f"`{flag.bit:02X}h`", flag.word, flag.help) for flag in supersigma_link.FLAGS)
    return table(("bit", "word", "what"), rows)


def movement_times() -> str:
    """What movements of some lengths take, by each way."""
    entries, rows = len(PAPER.differences), []
    for steps in (100, 200, 403, 404, 600, 1000, 1500, 2000, 3000, 4000, 5000, 5143, 5144, 6000):
        row: list[object] = [steps]
        for way in Way:
            ramp = choose(PAPER, steps, OFFSET, way, entries)
            clocks = movement(PAPER, steps, OFFSET, way, entries).clocks
            chosen = ramp.entries if way is Way.FREE else ramp.first
            row.append(f"{clocks * 1e3 / CLOCK_HZ:.1f} ms ({chosen})" if ramp.entries else "constant")
        rows.append([*row, f"{steps * (PAPER.first + 1) * 1e3 / CLOCK_HZ:.1f} ms"])
    return table(("half steps", "hyperbola (N0)", "exact (N0)", "free (entries)", "constant low speed"), rows)


# -- of the BS0610 and BS0710 --------------------------------------------------------------------------------


def board_section(title: str) -> str:
    """A table of the BS0610 without its heading."""
    return section("bs0610", title).partition("\n")[2]


def board_reports() -> str:
    """The reports of `?`."""
    return table(("report", "what"), ((f"`{found.number}`", found.what) for found in genstepper_commands.REPORTS))


def board_actions() -> str:
    """The values of report -8."""
    return table(("-8", "step action"), enumerate(genstepper_commands.ACTIONS))


def board_memory() -> str:
    """The memory locations."""
    return table(("address", "what"), genstepper_commands.MEMORY)


# -- from the table of verbs of a cell that is served -----------------------------------------------------------


def verb_table() -> str:
    """Every verb as it is typed, with its method over HTTP."""
    rows = [
        (f"`{verb.name}`", f"`{usage(verb)}`" if verb.parameters else "", "POST" if verb.changes else "GET", verb.help)
        for verb in verbs.VERBS.values()
    ]
    return table(("verb", "arguments of `detent control`", "HTTP", "what"), rows)


def verb_arguments() -> str:
    """Every argument of every verb."""
    rows = [
        (f"`{verb.name}`", f"`{p.name}`" if p.required else f"[`{p.name}`]", p.kind.takes, p.help)
        for verb in verbs.VERBS.values()
        for p in verb.parameters
    ]
    return table(("verb", "argument", "takes", "what"), rows)


def fault_table() -> str:
    """Every kind of fault."""
    rows = [
        (f"`{kind.name}`", kind.where, ", ".join(f"`{name}`" for name in (*kind.takes, "for")), kind.help)
        for kind in verbs.FAULTS.values()
    ]
    return table(("kind", "where", "arguments", "what"), rows)


# -- from the command line itself -----------------------------------------------------------------------------


def command_line() -> str:
    """Every verb with its options, as `--help` has them."""
    from detent.cli import application

    text = application("*").generate_docs(heading_level=1)
    text = text[: text.index("\n## detent --install-completion")]  # that names the program that runs
    return text[text.index("\n## detent ") :].replace("\n* `", "\n- `")


def verb_list() -> str:
    """Every verb with its line of help."""
    return table(("verb", "what"), ((f"[`{name}`](#detent-{name})", line) for name, (_, line) in VERBS.items()))


PARTS: Final[dict[str, Callable[[], str]]] = {
    "addresses": addresses,
    "baud rates": rates,
    "numbers": numbers,
    "pins": pin_table,
    "straps": lambda: section(GS_C200, "Straps").partition("\n")[2],
    "options": lambda: section(GS_C200, "Options").partition("\n")[2],
    "mode diagram": diagram,
    "modes of the GS-C200": lambda: outcomes(GS_C200),
    "modes of the GS-C200S": lambda: outcomes(GS_C200S),
    "commands of the GS-C200": lambda: section(GS_C200, "Commands"),
    "commands of the GS-C200S": lambda: section(GS_C200S, "Commands"),
    "image bytes": image_bytes,
    "parts of a cell": cell_parts,
    **{f"keys of {name}": partial(cell_keys_of, kind) for name, kind in cell_keys.TABLES.items()},
    "pins of the DCB-274": lambda: section("dcb-274", "Pins").partition("\n")[2],
    "options of the DCB-274": lambda: section("dcb-274", "Options").partition("\n")[2],
    "commands of the DCB-274": lambda: section("dcb-274", "Commands").partition("\n")[2],
    "pins of the drive": lambda: drive_section("Pins"),
    "options of the drive": lambda: drive_section("Options"),
    "op-codes of the drive": lambda: drive_section("Commands"),
    "flags of the drive": flags,
    "times of the drive": movement_times,
    "pins of the boards": lambda: board_section("Pins"),
    "straps of the boards": lambda: board_section("Straps"),
    "options of the boards": lambda: board_section("Options"),
    "commands of the boards": lambda: board_section("Commands"),
    "reports of the boards": board_reports,
    "step actions of the boards": board_actions,
    "memory of the boards": board_memory,
    "command line": command_line,
    "list of verbs": verb_list,
    "verbs": verb_table,
    "verb arguments": verb_arguments,
    "faults": fault_table,
}

FILES: Final[dict[str, Callable[[], str]]] = {
    "pictures/gsc200-modes.svg": mode_picture,
    "reference/control-openapi.json": lambda: json.dumps(openapi.document(), indent=1) + "\n",
}
"""Files that are made as a whole."""

if __name__ == "__main__":
    main()
