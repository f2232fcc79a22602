"""What every wire must carry, worked out pulse by pulse and bit by bit: slow, and not with the code under test."""

from fractions import Fraction

from detent.cell.recording import InputSet, Received, Recording
from detent.controllers.device import Powered
from detent.outputs.units import UnitView
from detent.pins import PinKind, PinSet
from detent.uart import Sent

UNKNOWN = 2


def pulses(recording: Recording, unit: str, until: int) -> list[tuple[int, int, int]]:
    """(time, direction, position) of every step pulse."""
    return [
        (span.train.time_of(n), span.direction, span.shaft + span.direction * n)
        for span in recording.motion(unit, until)
        for n in range(span.first, span.last + 1)
        if span.train.time_of(n) <= until
    ]


def level_changes(recording: Recording, view: UnitView, until: int) -> dict[str, list[tuple[int, int]]]:
    """The changes of every pin, the level before 0 first (at -1). Several at one instant: only the last one counts."""
    changes: dict[str, list[tuple[int, int, int]]] = {}
    powered = [(entry.at, entry.on) for entry in recording.of(view.name) if isinstance(entry, Powered)]

    def is_on(t: int) -> bool:
        return [view.powered, *(on for at, on in powered if at <= t)][-1]

    for order, entry in enumerate(recording.of(view.name)):
        match entry:
            case PinSet(at, pin, level) | InputSet(at, pin, level):
                changes.setdefault(pin, []).append((at, order, level))
            case Powered(at, on):
                for pin in view.pins:
                    if pin.kind.drives or pin.name == "TXD":
                        rest = 1 if pin.name == "TXD" else pin.rest
                        changes.setdefault(pin.name, []).append((at, order, rest if on else UNKNOWN))
            case Sent(at, port, char, done) | Received(done, port, char, at):
                for t, level in bits(view, char, at, done):
                    if port == "RXD" or is_on(t):
                        changes.setdefault(port, []).append((t, order, level))
    output = view.pulse_output
    if output is not None:
        given = pulses(recording, view.name, until)
        for (t, direction, _), follower in zip(given, [*given[1:], (1 << 90, 0, 0)], strict=False):
            pin = output.pins[direction]
            changes.setdefault(pin, []).append((t, -1, output.active))
            end = t + output.width
            if is_on(end) and follower[0] > end:
                changes[pin].append((end, -1, 1 - output.active))
    found = {}
    for pin in view.pins:
        if pin.kind in (PinKind.SUPPLY, PinKind.STRAP):
            continue
        output_pin = pin.kind.drives or pin.name == "TXD"
        level = UNKNOWN if output_pin and not view.powered else pin.rest
        found[pin.name] = settled(
            [(-1, level), *((t, to) for t, _, to in sorted(changes.get(pin.name, [])) if t <= until)]
        )
    return found


def bits(view: UnitView, char, at: int, done: int) -> list[tuple[int, int]]:
    """Level and beginning of every bit of an undamaged character, and the rest behind it."""
    form = view.line_format
    data = [char.value >> k & 1 for k in range(form.data_bits)]
    parity = {"none": [], "even": [sum(data) % 2], "odd": [1 - sum(data) % 2]}[form.parity]
    levels = [0, *data, *parity, *[1] * form.stop_bits, 1]
    return [(at + int(Fraction(k * (done - at), form.bits) + Fraction(1, 2)), level) for k, level in enumerate(levels)]


def settled(changes: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Of the changes of one instant the last one, and only what differs from the level before."""
    last = dict(changes)  # keeps the first key's place, the last value
    found: list[tuple[int, int]] = []
    for t, level in last.items():
        if not found or found[-1][1] != level:
            found.append((t, level))
    return found
