"""A trip, a poll, a wait is served when the manual says, whatever instruction is just being fetched or executed.

Programs are made by number and run; where each instruction is reached is compared with `plain_cycle`, which is told
when the motor stepped and how the inputs were.
"""

from collections.abc import Mapping, Sequence
from random import Random
from typing import NamedTuple

import pytest
from tests.controllers.laws import dcb274, genstepper, gsc200, supersigma
from tests.controllers.laws.adapter import history, ready
from tests.controllers.laws.bench import Bench, Put, Say, Wait
from tests.controllers.laws.histories import ORDINARY, THOROUGH, History, gap, hold
from tests.controllers.laws.plain_cycle import Input, Line, Simple, Smc, Steps, outputs

from detent.axis import MotionStarted
from detent.controllers.device import Executing
from detent.pins import HIGH, LOW, PinSet
from detent.ticks import MS, SECOND, Ns
from detent.uart import Sent


class Program(NamedTuple):
    """Instructions at their addresses, and the times at which an input changes, beginning with HIGH."""

    lines: tuple[Line, ...]
    changes: Mapping[int, tuple[Ns, ...]]  # by the number of the input


def stepped(bench: Bench) -> Steps:
    """What the motor did."""
    times: list[Ns] = []
    places: list[int] = []
    motions: list[tuple[Ns, Ns]] = []
    for item in bench.out:
        if isinstance(item, MotionStarted):
            last = item.train.steps or 0
            times += item.train.times(1, last).tolist()
            places += [item.shaft + item.direction * n for n in range(1, last + 1)]
            motions.append((item.at, times[-1]))
    return Steps(times, places, motions)


def reached(bench: Bench) -> list[tuple[Ns, int]]:
    return [(item.at, item.address) for item in bench.out if isinstance(item, Executing)]


def changes(draw: Random) -> tuple[Ns, ...]:
    now, found = 0, []
    for _ in range(draw.randrange(6)):
        now += draw.choice((1 * MS + 7, 3 * MS + 11, 40 * MS + 13, 300 * MS + 17)) + draw.randrange(2 * MS)
        found.append(now)
    return tuple(found)


def compare(bench: Bench, expected: Sequence[tuple[Ns, int]], lines: Sequence[Line]) -> None:
    told = reached(bench)
    for n, (one, other) in enumerate(zip(told, expected, strict=False)):
        assert one == other, f"instruction {n}: {other[1]} is due at {other[0]} ns, and {one[1]} is reached at {one[0]}"
    assert len(told) == len(expected), f"{len(told)} instructions are reached, and {len(expected)} are due: {lines}"


def play(bench: Bench, program: Program, pins: Mapping[int, str], long: Ns) -> Ns:
    """Let inputs change as the program has it; when it began."""
    begun = bench.now
    actions = sorted((at, pin, n) for pin, times in program.changes.items() for n, at in enumerate(times))
    for at, pin, n in actions:
        bench.play((Wait(begun + at - bench.now), Put(pins[pin], HIGH if n % 2 else LOW)))
    bench.play((Wait(max(begun + long - bench.now, 0)),))
    return begun


# -- DCB-274 ---------------------------------------------------------------------------------------------------


def smc_program(draw: Random) -> Program:
    """Indexes, waits, ports, and a trip whose routine stands in RAM or in NV memory."""
    vector = draw.choice((128, 100, 160, 64))
    address, lines = 0, []

    def add(letter: str, *numbers: int) -> None:
        nonlocal address
        lines.append(Line(address, letter, numbers))
        address += Smc.LENGTHS[letter]

    add("T", draw.choice((0, 1, 2, 3, 20, 97, 100, -5, -40, 130)), vector)
    if draw.random() < 0.3:
        add("K", draw.choice((0, 5)), 5)
    for _ in range(draw.randint(1, 6)):
        match draw.randrange(9):
            case 0 | 1 | 2:
                add(draw.choice("+-+"), draw.choice((1, 2, 3, 20, 100, 130, 30)))
            case 3:
                add("W", draw.choice((0, 0, 1, 3)))
            case 4:
                add("A", draw.choice((0, 8, 16)))
            case 5:
                add("L", draw.choice((2048, 2048, address)), draw.choice((0, 1)))
            case 6:
                add("T", draw.choice((1, 20, 100, 101, -40)), draw.choice((vector, vector, 0)))
            case 7:
                add("I", 800)
            case 8:
                add("J", draw.choice([line.address for line in lines]), draw.randrange(3))
    path = [0]
    for line in lines:
        if line.letter in "+-":
            way = 1 if line.letter == "+" else -1
            path += range(path[-1] + way, path[-1] + way * (line.numbers[0] + 1), way)
    if draw.random() < 0.7:
        lines[0] = lines[0]._replace(numbers=(draw.choice(path), vector))
    address = vector
    for _ in range(draw.randrange(4)):
        if draw.random() < 0.6:
            add("A", draw.choice((0, 8)))
        else:
            add("T", draw.choice((2, 21, 110, -41)), vector)
    return Program(tuple(lines), {1: changes(draw)})


def store(bench: Bench, program: Program) -> None:
    """Type a program into program mode of a DCB-274, each part at its address, and leave that mode."""
    here = None
    for line in program.lines:
        if line.address != here:
            bench.play(() if here is None else (Say("P"), Wait(5 * MS)))
            bench.play((Say(f"P {line.address}"), Wait(5 * MS)))
        bench.play((Say(f"{line.letter} {' '.join(map(str, line.numbers))}"), Wait(8 * MS)))
        here = line.address + Smc.LENGTHS[line.letter]
    bench.play((Say("P"), Wait(5 * MS)))


def smc_runs_as_the_manual_says(_: History, program: Program) -> bool:
    bench = ready(dcb274.MODELS[0], History({}, (), ()))
    store(bench, program)
    bench.play((Say("G 0"),))
    begun = play(bench, program, {1: "P1"}, 2 * SECOND)
    port = Input(tuple(begun + at for at in program.changes[1]))
    plain = Smc({line.address: line for line in program.lines}, stepped(bench), port, bench.now)
    compare(bench, plain.run(begun + Smc.OTHERS), program.lines)  # G executes for 0.5 ms
    return any(address >= 64 for _, address in reached(bench))


def special_program(draw: Random) -> Program:
    """A program that sets special trips, at rest and in motion, and what stands at 128."""
    address, lines = 0, []

    def add(letter: str, *numbers: int) -> None:
        nonlocal address
        lines.append(Line(address, letter, numbers))
        address += Smc.LENGTHS[letter]

    def place() -> int:
        nonlocal ahead
        ahead += draw.choice((0, 1, 2, 17))
        return draw.choice((ahead, ahead, ahead, draw.randrange(-20, 120)))

    ahead = draw.randrange(30)
    for n in range(draw.randint(2, 6)):
        match draw.randrange(7) if n > 1 else 2 * n:
            case 0 | 1:
                add(draw.choice("kki"), place(), draw.choice((0, 8, 16, 24)))
            case 2 | 3 | 4:
                add(draw.choice("++-"), draw.choice((1, 3, 60, 150, 200)))
            case 5:
                add("W", draw.choice((0, 1)))
            case 6:
                add("A", draw.choice((0, 8, 16)))
    address = 128
    for _ in range(draw.randint(1, 5)):
        add(draw.choice("kkkkiA"), place(), draw.choice((0, 8, 16, 24)))
        if lines[-1].letter == "A":
            lines[-1] = lines[-1]._replace(numbers=lines[-1].numbers[-1:])
    return Program(tuple(lines), {})


def special_trips_act_at_their_very_step(_: History, program: Program) -> bool:
    """ "There actions are performed in real time" (page 42)."""
    bench = ready(dcb274.MODELS[0], History({}, (), ()))
    store(bench, program)
    bench.out.clear()
    bench.play((Say("G 0"),))
    begun = play(bench, program, {}, 2 * SECOND)
    lines = {line.address: line for line in program.lines}
    steps = stepped(bench)
    plain, times = Smc(lines, steps, Input(()), bench.now), set(steps.times)
    compare(bench, plain.run(begun + Smc.OTHERS), program.lines)
    expected: list[tuple[Ns, str, int]] = []
    levels = {"P4": HIGH, "P5": HIGH}
    for at, data in outputs(plain.done, lines, steps):
        for pin, bit in (("P4", 8), ("P5", 16)):
            level = LOW if data & bit else HIGH
            if levels[pin] != level:
                levels[pin] = level
                expected.append((at, pin, level))
    told = [(item.at, item.pin, item.level) for item in bench.out if isinstance(item, PinSet) and item.pin in levels]
    assert told == expected, f"{told} is told, and {expected} is due"
    return any(at in times for at, _, _ in expected)  # at a step


# -- GS-C200 ---------------------------------------------------------------------------------------------------


def simple_program(draw: Random) -> Program:
    address, lines = 0, []
    loop = False
    for _ in range(draw.randint(1, 9)):
        match draw.randrange(8):
            case 0 | 1:
                found: tuple[str, int] = "+", draw.choice((1, 7, 60))
            case 2:
                found = "D", draw.choice((1, 2))
            case 3:
                found = draw.choice("AC"), draw.randint(1, 3)
            case 4 | 5:
                found = "W", draw.randint(1, 3)
            case 6:
                found, loop = ("L", draw.randint(2, 3) if loop else 0), not loop
            case _:
                found = ("U" if address and not any(line.letter == "L" for line in lines) else "A"), draw.randint(1, 3)
        lines.append(Line(address, found[0], found[1:]))
        address += Simple.LENGTHS[found[0]]
    return Program(tuple(lines), {pin: changes(draw) for pin in (1, 2, 3)})


def jumping_program(draw: Random) -> Program:
    """The same with the jumps of the GS-C200S: back, ahead, to itself, and behind the last instruction's begin."""
    program = simple_program(draw)
    lines: list[Line] = []
    address = 0
    for line in program.lines:
        letter, numbers = (line.letter, line.numbers) if line.letter not in "LU" else ("A", (1,))
        if draw.random() < 0.4:
            letter, numbers = draw.choice((("j", (0,)), ("jc", (draw.choice((7, 7, 6, 5, 3)), 0))))
        lines.append(Line(address, letter, numbers))
        address += Simple.LENGTHS[letter]
    starts = [line.address for line in lines]
    lines = [line._replace(numbers=(*line.numbers[:-1], draw.choice(starts))) if line.letter[0] == "j" else line
             for line in lines]  # fmt: skip
    return Program(tuple(lines), program.changes)


def simple_runs_as_the_datasheet_says(_: History, program: Program) -> bool:
    return runs_as_the_datasheet_says(gsc200.MODELS[0], "P", program)


def jumps_lead_where_the_datasheet_says(_: History, program: Program) -> bool:
    return runs_as_the_datasheet_says(gsc200.MODELS[1], "Po", program)


def runs_as_the_datasheet_says(model: gsc200.Module, enter: str, program: Program) -> bool:
    bench = ready(model, History({}, (), ()))
    bench.play((Say("S50"), Wait(2 * MS), Say("T200"), Wait(2 * MS), Say(enter)))
    bench.play(Say(f"{line.letter}{','.join(map(str, line.numbers))}") for line in program.lines)
    bench.out.clear()
    bench.play((Say("E"),))
    begun = play(bench, program, {1: "UI1", 2: "UI2", 3: "UI3"}, 2 * SECOND)
    inputs = {pin: Input(tuple(begun + at for at in times)) for pin, times in program.changes.items()}
    plain = Simple({line.address: line for line in program.lines}, stepped(bench), inputs, bench.now)
    compare(bench, plain.run(begun), program.lines)
    return len(reached(bench)) > 1


# -- GenStepper and SUPERSIGMA: what is asked is answered for the very instant -----------------------------------


def a_wait_for_idle_ends_with_the_motion(past: History, wait: Ns) -> bool:
    """I: "not received until the motion completes" (page 29); RDY is high when both motors rest (page 22)."""
    bench = ready(genstepper.MODELS[0], past)
    bench.play((*past.actions, Say("0V"), Wait(wait)))
    if not genstepper.hears(bench) or bench.pin("RDY") == HIGH:
        return False
    bench.play((Say("B"), Wait(2 * MS), Say("I")))
    place = len(bench.out)
    bench.go_to(bench.now + 100 * SECOND)
    later = bench.out[place:]
    risen = [item.at for item in later if isinstance(item, PinSet) and item.pin == "RDY" and item.level == HIGH]
    told = [item.at for item in later if isinstance(item, Sent)]
    if not risen:  # it has come to rest before I came, or it never does
        assert len(told) == (bench.pin("RDY") == HIGH), f"I is answered {len(told)} times"
        return False
    assert len(told) == 1, f"I is answered {len(told)} times"
    late = told[0] - risen[0]
    assert 0 <= late <= 2 * MS, f"I is answered {late} ns behind RDY"  # without times an answer waits for a character
    return True


def status_tells_the_steps_of_its_instant(past: History, wait: Ns) -> bool:
    """ "The CCU is able to interrogate the microcomputer about the number of steps performed" (Status)."""
    bench = ready(supersigma.MODELS[0], past)
    bench.play((*past.actions, Wait(wait)))
    if bench.device.status(bench.now).state == "off":
        return False
    travel, place, now = bench.travels[""], len(bench.out), bench.now
    moving, steps = travel.moving, travel.given(bench.now)
    bench.play((Say("status"), Wait(1 * MS)))
    told = [item.char.value for item in bench.out[place:] if isinstance(item, Sent)][-3:]
    assert len(told) == 3, f"status is not answered at {now} ns"
    assert bool(told[2] & 1) is moving, f"the flags {told[2]} at {now} ns, and it {'moves' if moving else 'rests'}"
    if moving:
        assert told[0] << 8 | told[1] == steps & 0xFFFF, f"{told[:2]} steps are told at {now} ns, and {steps} were done"
    return moving


LAWS = {
    "dcb-274": (smc_runs_as_the_manual_says, smc_program),
    "dcb-274, special trips": (special_trips_act_at_their_very_step, special_program),
    "gs-c200": (simple_runs_as_the_datasheet_says, simple_program),
    "gs-c200s": (jumps_lead_where_the_datasheet_says, jumping_program),
}


def check(model: str, count: int) -> None:
    law, program = LAWS[model]
    told = hold(law, lambda draw: (History({}, (), ()), program(draw)), count, f"programs of {model}")
    assert told > count // 4


ASKED = {
    "bs0610": (a_wait_for_idle_ends_with_the_motion, genstepper.MODELS[0]),
    "supersigma": (status_tells_the_steps_of_its_instant, supersigma.MODELS[0]),
}


def check_asked(model: str, count: int) -> None:
    law, adapter = ASKED[model]

    def make(draw: Random) -> tuple[History, Ns]:
        return history(adapter, draw), gap(draw) % SECOND

    assert hold(law, make, count, f"questions to {model}") > count // 8


@pytest.mark.parametrize("model", LAWS)
def test_programs_run_as_the_manual_says(model: str) -> None:
    check(model, ORDINARY // 2)


@pytest.mark.parametrize("model", ASKED)
def test_what_is_asked_is_answered_for_its_instant(model: str) -> None:
    check_asked(model, ORDINARY // 2)


@pytest.mark.slow
@pytest.mark.parametrize("model", LAWS)
def test_many_more_programs_run_as_the_manual_says(model: str) -> None:
    check(model, THOROUGH)


@pytest.mark.slow
@pytest.mark.parametrize("model", ASKED)
def test_what_is_asked_is_answered_for_many_more_instants(model: str) -> None:
    check_asked(model, THOROUGH)
