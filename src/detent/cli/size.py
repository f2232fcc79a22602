"""The verb `size`: supplies and currents as a controller's manual computes them, a page for each."""

import json as json_text
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple


class Quantity(NamedTuple):
    """Something that a page asks: how it is written, its unit, what it is if nobody says; None: it must be given."""

    name: str
    read: Callable[[str], Any]  # ValueError
    takes: str
    default: str | None
    help: str


class Line(NamedTuple):
    """A line of the answer."""

    what: str
    value: str


class Answer(NamedTuple):
    """What a page computes: lines for people, the same as data, and warnings."""

    lines: Sequence[Line]
    facts: Mapping[str, Any]
    warnings: Sequence[str]


class Page(NamedTuple):
    """A page of a manual: what it asks, and how it answers. `answer` raises ValueError."""

    title: str
    quantities: Sequence[Quantity]
    answer: Callable[[Mapping[str, Any]], Answer]


def size(page: str | None = None, values: Sequence[str] = (), /, *, json: bool = False) -> None:
    """Compute supplies and currents for a controller, as its manual does.

    Its warnings are told, too. Without a page the pages are listed, without values what a page asks.

    For example: `detent size gs-c200-slew`

    Parameters
    ----------
    page
        A page, like bs0610 or gs-c200-slew.
    values
        What is known, each NAME=VALUE.
    json
        Print the result as JSON.
    """
    from detent.cli.endings import asked_wrongly
    from detent.controllers.catalogue import unknown

    if page is None:
        _list(PAGES, json)
        return
    if page not in PAGES:
        own = {name: found for name, found in PAGES.items() if name.startswith(f"{page.removesuffix('s')}-")}
        if not own:
            asked_wrongly(unknown("page", page, tuple(PAGES)))
        if values:
            asked_wrongly(f"the {page} has {len(own)} pages: {' and '.join(own)}; say which")
        _list(own, json)
        return
    chosen = PAGES[page]
    if not values:
        _print_questions(page, chosen, json)
        return
    try:
        given = _read(chosen, values)
        answer = chosen.answer(given)
    except ValueError as error:
        asked_wrongly(error)
    if json:
        print(json_text.dumps({"page": page, **answer.facts, "warnings": list(answer.warnings)}))
        return
    width = max(len(line.what) for line in answer.lines)
    for line in answer.lines:
        print(f"{line.what:{width}}  {line.value}")
    for warning in answer.warnings:
        print(f"  ! {warning}")


def _list(pages: Mapping[str, Page], json: bool) -> None:
    if json:
        print(json_text.dumps({"pages": {name: page.title for name, page in pages.items()}}))
        return
    for name, found in pages.items():
        print(f"{name:15}  {found.title}")
    print(f"\nWhat it asks: detent size {next(iter(pages))}")


def _print_questions(name: str, page: Page, json: bool) -> None:
    if json:
        asked = [
            {"name": one.name, "takes": one.takes, "default": one.default, "help": one.help} for one in page.quantities
        ]
        print(json_text.dumps({"page": name, "title": page.title, "quantities": asked}))
        return
    print(page.title)
    width = max(len(quantity.name) for quantity in page.quantities)
    for quantity in page.quantities:
        default = "" if not quantity.default else f" [{quantity.default}]"
        print(f"  {quantity.name:{width}}  {quantity.help}: {quantity.takes}{default}")
    needed = " ".join(f"{quantity.name}=..." for quantity in page.quantities if quantity.default is None)
    print(f"\nLike: detent size {name} {needed}")


def _read(page: Page, values: Sequence[str]) -> dict[str, Any]:
    """The values as the page takes them. ValueError with the remedy."""
    from detent.controllers.catalogue import unknown

    known = {quantity.name: quantity for quantity in page.quantities}
    written: dict[str, str] = {}
    for item in values:
        name, equals, value = item.partition("=")
        if not equals:
            raise ValueError(f"{item!r}: write NAME=VALUE; names are {', '.join(known)}")
        if name not in known:
            raise unknown("quantity", name, tuple(known))
        written[name] = value
    read: dict[str, Any] = {}
    for name, quantity in known.items():
        text = written.get(name, quantity.default)
        if text is None:
            raise ValueError(f"{name} is missing: {quantity.help}, {quantity.takes}")
        try:
            read[name] = quantity.read(text)
        except OutOfRange as error:
            raise ValueError(f"{name}={text}: {quantity.help}, {quantity.takes}: it takes {error}") from None
        except ValueError:
            raise ValueError(f"{name} cannot be {text!r}; it takes {quantity.takes}") from None
    return read


class OutOfRange(ValueError):
    """A number that is read, and that no answer can be made of."""


def number_with(unit: str, *, above: bool = False) -> Callable[[str], float]:
    """A reader of plain numbers that may carry their unit; 0 is one unless they are to be `above` it."""

    def read(text: str) -> float:
        value = float(text.strip().removesuffix(unit))
        if not 0 <= value < 1e9 or (above and not value):
            raise OutOfRange(f"a number {'above 0' if above else 'of 0 or more'} and below 1e9")
        return value

    return read


def one_of(**meanings: Any) -> Callable[[str], Any]:
    """A reader of words, in either case."""

    def read(text: str) -> Any:
        found = {word.lower(): meaning for word, meaning in meanings.items()}
        if text.strip().lower() not in found:
            raise ValueError(text)
        return found[text.strip().lower()]

    return read


def _genstepper(given: Mapping[str, Any]) -> Answer:
    from detent.controllers.genstepper.supply import DRIVER_DROP, STEP_MODES, Question, size, voltage_for

    values = dict(given)
    current = values.pop("current")
    if current is not None and values["voltage"] is not None:
        raise ValueError("say voltage or current, not both: a winding takes the voltage through its resistance")
    if current is not None:
        values["voltage"] = voltage_for(current, values["resistance"])
    if values["voltage"] is None:
        raise ValueError("voltage is missing: of the motor supply, or current=A to have it computed")
    question = Question(**values)
    sheet = size(question)
    mode = STEP_MODES[question.mode]
    lines = [
        Line("motor supply", f"{question.voltage:.3g} V"),
        Line("left for the motor", f"{sheet.motor_volts[0]:.3g} to {sheet.motor_volts[1]:.3g} V, by temperature: the "
             f"drivers drop {DRIVER_DROP[0]:g} to {DRIVER_DROP[1]:g} V (page 78)"),
        Line("winding current", f"{sheet.winding_current:.3g} A"),
        Line(f"{question.motors} motor{'s' * (question.motors > 1)}, {mode.name}",
             f"{sheet.motor_current[0]:.3g} A, recommended {sheet.motor_current[1]:.3g} A"),
        Line("logic", f"{sheet.logic_current:.3g} A"),
        Line("single supply" if question.supply == "SS" else "motor supply alone",
             f"{sheet.supply_current[0]:.3g} A, recommended {sheet.supply_current[1]:.3g} A"),
    ]  # fmt: skip
    facts = {
        "voltage_v": question.voltage,
        "winding_a": sheet.winding_current,
        "motor_v": {"least": sheet.motor_volts[0], "most": sheet.motor_volts[1]},
        "motors_a": {"absolute": sheet.motor_current[0], "recommended": sheet.motor_current[1]},
        "logic_a": sheet.logic_current,
        "supply_a": {"absolute": sheet.supply_current[0], "recommended": sheet.supply_current[1]},
    }
    return Answer(lines, facts, sheet.warnings)


def _gsc200_current(given: Mapping[str, Any]) -> Answer:
    from detent.controllers.gsc200.application import CONFLICT, Resistors, currents, resistors, standard

    drive = given["drive"]
    found = resistors(given["rest"], given["slew"], given["ramp"], drive)
    bought = Resistors(*map(standard, found))
    made = dict(zip(("rest", "slew", "ramp"), currents(bought, drive), strict=True))
    meaning = {"r1": "to 5 V by Tr1, while ramping", "r2": "to ground by Tr2, at rest", "r3": "to ground, always"}
    lines = [Line(f"{name.upper()} ({what})", f"{getattr(found, name):.0f} ohm") for name, what in meaning.items()]
    lines.append(Line("with the nearest of E24", " and ".join(f"{ohms:g}" for ohms in bought) + " ohm: "
                      + ", ".join(f"{name} {amps:.3g} A" for name, amps in made.items())))  # fmt: skip
    facts = {f"{name}_ohm": getattr(found, name) for name in meaning}
    facts["e24"] = {**{f"{name}_ohm": getattr(bought, name) for name in meaning},
                    **{f"{name}_a": amps for name, amps in made.items()}}  # fmt: skip
    return Answer(lines, facts, [CONFLICT] if drive == "GS-D200S" else [])


def _gsc200_slew(given: Mapping[str, Any]) -> Answer:
    from detent.controllers.gsc200.application import SLEW_CONFLICT, slew_rate

    turns = slew_rate(given["force"], given["length"], given["time"], given["torque"])
    rate = turns / 60 * given["steps"]
    if rate < 5:
        raise ValueError(f"the load needs {rate:.3g} steps/s: T begins at 10 steps/s (T1); take a gear, or more steps")
    lines = [
        Line("speed", f"{turns:.4g} turns/min"),
        Line("slew rate", f"{rate:.4g} steps/s: T{min(max(round(rate / 10), 1), 1000)}"),
    ]
    warnings = [SLEW_CONFLICT]
    if rate > 10_000:
        warnings.append("the module gives at most 10 000 steps/s")
    return Answer(lines, {"turns_per_min": turns, "steps_per_s": rate}, warnings)


def _dcb274(given: Mapping[str, Any]) -> Answer:
    from detent.controllers.dcb274.current import FULL_CURRENT
    from detent.controllers.dcb274.sizing import MORE, MOST_SUPPLY, advise

    found = advise(**given)
    enough = found.least_supply <= MOST_SUPPLY
    supply = (
        f"{found.least_supply:.3g} to {MOST_SUPPLY:g} V" if enough else f"at most {MOST_SUPPLY:g} V, too little here"
    )
    amps = FULL_CURRENT * found.run / 100
    lines = [
        Line("hold and run current", f"Y {found.hold} {found.run}: {FULL_CURRENT * found.hold / 100:.3g} and "
             f"{amps:.3g} A a phase, 100 is {FULL_CURRENT:g} A; hold begins 1 s behind a move (page 52)"),
        Line("the right run current", f"the least that works reliably (page 62), and {(MORE[0] - 1) * 100:.0f} to "
             f"{(MORE[1] - 1) * 100:.0f} % more (page 64)"),
        Line("supply", f"{supply}, unregulated; the higher the faster (pages 11, 13, 64; page 2 prints 45 V)"),
        Line("heat of the windings", f"{found.watts:.3g} W at run current"),
        Line("decay", f"b {found.decay}: fast above {found.steps_per_s} steps/s, slow below and at rest (page 36)"),
        Line("slow decay", "smooth, less resonance, less heat; poor regulation of low currents (pages 36, 65)"),
        Line("fast decay", "better regulation, more heat; as a rule above 200 to 300 rev/min (pages 36, 65)"),
    ]  # fmt: skip
    facts = {
        "hold_percent": found.hold, "run_percent": found.run, "run_a": amps, "rated_v": found.rated_volts,
        "supply_v": {"least": found.least_supply, "most": MOST_SUPPLY}, "windings_w": found.watts,
        "decay": found.decay, "decay_steps_per_s": found.steps_per_s,
    }  # fmt: skip
    return Answer(lines, facts, found.warnings)


def _maybe(read: Callable[[str], Any]) -> Callable[[str], Any]:
    return lambda text: read(text) if text else None


def _steps(text: str) -> int:
    if int(text) < 1:
        raise ValueError(text)
    return int(text)


_YES_NO = one_of(yes=True, no=False)
_BOARD = (
    Quantity("resistance", number_with("ohm"), "ohm", None, "of one winding"),
    Quantity("voltage", _maybe(number_with("V")), "V", "", "of the motor supply"),
    Quantity("current", _maybe(number_with("A")), "A", "", "wanted in a winding, instead of the voltage"),
    Quantity("mode", int, "0 to 3, as O", "3", "step mode"),
    Quantity("motors", int, "1 or 2", "1", "how many motors alike"),
    Quantity(
        "supply", one_of(SS="SS", DS="DS", **{"5VO": "5VO"}), "SS, DS or 5VO", "SS", "the power jumper: one or two"
    ),
    Quantity("logic_voltage", _maybe(number_with("V")), "V", "", "at Vc, with two supplies"),
    Quantity("half_power", _YES_NO, "yes or no", "no", "1H or the jumper"),
    Quantity("double_current", _YES_NO, "yes or no", "no", "one motor on both connectors"),
    Quantity("tap", number_with("A"), "A", "0", "from the board's 5 V, for a fan or other logic"),
)

_CURRENTS = (
    Quantity("rest", number_with("A"), "A", "0.25", "phase current at rest"),
    Quantity("slew", number_with("A"), "A", "0.5", "phase current at constant speed"),
    Quantity("ramp", number_with("A"), "A", None, "phase current in the ramps"),
    Quantity(
        "drive", one_of(**{"GS-D200": "GS-D200", "GS-D200S": "GS-D200S"}), "GS-D200 or GS-D200S", "GS-D200", "drive"
    ),
)
_SLEW = (
    Quantity("force", number_with("lb", above=True), "lb", None, "to be overcome"),
    Quantity("length", number_with("in", above=True), "inches", None, "to be moved"),
    Quantity("time", number_with("s", above=True), "s", None, "for it"),
    Quantity("torque", number_with("ozin", above=True), "oz in", None, "of the motor at that speed"),
    Quantity("steps", _steps, "a whole number of 1 or more", "200", "steps in a turn"),
)

_CHOPPER = (
    Quantity("current", number_with("A"), "A", None, "rated, of one phase as it is connected"),
    Quantity("resistance", number_with("ohm"), "ohm", None, "of one phase as it is connected"),
    Quantity("supply", number_with("V"), "V", "40", "at J5"),
    Quantity("hold", _maybe(number_with("A")), "A", "", "at rest, instead of half the run current"),
    Quantity("speed", number_with("rpm"), "rev/min", "250", "at which decay changes"),
    Quantity(
        "resolution", one_of(**{"1/8": 0, "1/4": 1, "1/2": 2, "full": 3, "wave": 5}), "1/8, 1/4, 1/2, full or wave",
        "1/4", "step table (H)",
    ),
)  # fmt: skip

PAGES: dict[str, Page] = {
    "gs-c200-current": Page(
        "GS-C200 with a GS-D200: resistors for the phase currents by MOV and RAMP (datasheet, figure 11)",
        _CURRENTS,
        _gsc200_current,
    ),
    "gs-c200-slew": Page("GS-C200: slew speed of a load (datasheet, slew speed selection)", _SLEW, _gsc200_slew),
    "bs0610": Page("BS0610: power supply requirements (manual, pages 62 to 68)", _BOARD, _genstepper),
    "bs0710": Page("BS0710: power supply requirements (manual, pages 62 to 68)", _BOARD, _genstepper),
    "dcb-274": Page("DCB-274: current, supply and decay (manual, pages 11, 13, 36, 52, 61 to 65)", _CHOPPER, _dcb274),
}
