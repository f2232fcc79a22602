"""The verb `wiring`: which lead of a motor goes where."""

import json as json_text
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from detent.controllers.genstepper.wiring import Found


def wiring(readings: Sequence[str] = (), /, *, motor: str | None = None, json: bool = False) -> None:
    """Find a motor's windings from the resistances between its leads.

    Measure every pair of leads with an ohmmeter and give the readings. What is found is followed by the orders in which
    the leads may be connected, for the sequence test: with the power off between tries, connect the leads, then let
    the motor go to 1000 and back. Only when the motor is wired correctly will it move smoothly both ways.

    For example: `detent wiring 1-2=10 1-3=open 1-4=open 2-3=open 2-4=open 3-4=10`

    Parameters
    ----------
    readings
        LEAD-LEAD=OHMS as the meter shows it (10, 5ohm, 1.2k), or LEAD-LEAD=open (or OL), for all pairs of 4, 5 or 6
        leads. Without any: the orders for leads A, B, C, D.
    motor
        Instead: the wiring of a motor in the manual's examples, by its catalogue number.
    json
        Print the result as JSON.
    """
    from detent.cli.endings import asked_wrongly
    from detent.controllers.catalogue import unknown
    from detent.controllers.genstepper import motors
    from detent.controllers.genstepper.wiring import WiringError, find

    if motor is not None:
        found_motor = motors.example(motor)
        if found_motor is None:
            asked_wrongly(unknown("motor", motor, [example.number for example in motors.EXAMPLES]))
        _print_motor(found_motor, json)
        return
    try:
        found = find(dict(map(_reading, readings))) if readings else None
    except (ValueError, WiringError) as error:
        asked_wrongly(error)
    _print_windings(found, json)


def _reading(text: str) -> tuple[tuple[int, int], float]:
    """A reading as it is written. ValueError."""
    pair, equals, value = text.partition("=")
    one, dash, other = pair.partition("-")
    try:
        ohms = _ohms(value)
        leads = int(one), int(other)
    except ValueError:
        dash = ""
    if not (equals and dash):
        raise ValueError(
            f"{text!r} is no reading: write LEAD-LEAD=OHMS, leads numbered from 1, like 1-2=10 or 1-3=open"
        )
    return (min(leads), max(leads)), ohms


def _ohms(text: str) -> float:
    """What a meter shows: ohms, with k or M and a unit if one likes; OL for a circuit that is open. ValueError."""
    shown = text.strip().lower()
    if shown in ("open", "inf", "ol", "0l", "o.l", "0.l", "o.l.", "over"):
        return math.inf
    for unit in ("ohms", "ohm", "\N{GREEK SMALL LETTER OMEGA}", "r"):
        shown = shown.removesuffix(unit)
    shown = shown.strip()
    scale = {"k": 1e3, "m": 1e6}.get(shown[-1:], 1.0)  # nobody's meter shows a winding in milliohms with one letter
    return scale * float(shown[:-1] if scale != 1.0 else shown)


def _print_windings(found: "Found | None", json: bool) -> None:
    from detent.controllers.genstepper.wiring import Found, Kind, Order, orders, reversed_order, sensible

    shown = found or Found(Kind.BIPOLAR, (), (), (1, 2, 3, 4), "")
    rows = [(order, sensible(shown, order)) for order in orders(shown)]

    def lead(number: int) -> str:
        return str(number) if found else "ABCD"[number - 1]

    def names(order: Order) -> dict[str, str]:
        return {end.upper(): lead(number) for end, number in order._asdict().items()}

    if json:
        facts: dict[str, object] = {"orders": [{**names(order), "fits": fits} for order, fits in rows]}
        if found:
            facts |= {"kind": found.kind.value, "windings": found.pairs, "commons": found.commons, "ends": found.ends,
                      "remark": found.remark}  # fmt: skip
        print(json_text.dumps(facts))
        return
    if found:
        print(found.kind.value[0].upper() + found.kind.value[1:])
        for number, pair in enumerate(found.pairs):
            common = f", common {found.commons[number]}" if found.commons else ""
            print(f"  one winding: {pair[0]} and {pair[1]}{common}")
        if not found.pairs:
            print(f"  winding ends: {', '.join(map(str, found.ends))}")
            print(f"  common: {' and '.join(map(str, found.commons))}")
        print(f"  ({found.remark})\n")
    print("     WA1 WA2 WB1 WB2")
    for number, (order, fits) in enumerate(rows, 1):
        print(f"{number:3}  {'   '.join(names(order).values())}{'' if fits else '   (splits a winding)'}")
    other_way = "   ".join(names(reversed_order(rows[0][0])).values())
    print(f"\nThe other way round, if 1 turns backwards:  {other_way}")


def _print_motor(motor: "object", json: bool) -> None:
    from detent.controllers.genstepper.motors import PINS, Example

    assert isinstance(motor, Example)
    if json:
        print(json_text.dumps({**motor._asdict(), "leads": dict(zip(PINS, motor.leads, strict=True))}))
        return
    kind = "unipolar" if motor.unipolar else "bipolar"
    step = "" if motor.degrees is None else f", {motor.degrees:g} deg a step"
    print(f"{motor.number}: {kind}, {motor.volts:g} V, {motor.amperes:g} A a winding{step}")
    if motor.remark:
        print(f"  ({motor.remark})")
    for number, (pin, lead) in enumerate(zip(PINS, motor.leads, strict=True), 1):
        print(f"  {number}  {pin:8}  {lead or '-'}")
