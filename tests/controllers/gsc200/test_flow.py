"""Where programs go: against a plain interpreter written from the specification ("Language": loops, U, jumps)."""

from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from tests.generated import examples

from detent.controllers.device import Executing
from detent.controllers.gsc200.firmware import GsC200
from detent.uart import Char, Sent

SIZES = {"A": 2, "C": 2, "L": 2, "j": 2, "U": 2, "W": 2, "S": 4}
MOST = 150  # instructions


def interpreted(program: list[str], inputs: int) -> tuple[list[int], str]:
    """The addresses a program comes to, with its inputs held, and what F answers at its end ("B": no end)."""
    at, code = 0, {}
    for text in program:
        code[at] = text
        at += SIZES[text[0]]
    end, address, seen = at, 0, []
    loops: list[list[int]] = []  # [the L0, or the L<n> without one; begin of the body; rounds begun]
    jumped, guard = False, 0
    while len(seen) < MOST:
        text = code.get(address)
        if text is None:
            if jumped:
                return seen, "E4"
            assert address == end
            if not guard or not inputs & 1 << guard - 1:
                return seen, "R"
            address, loops, guard = 0, [], 0
            continue
        seen.append(address)
        here, jumped = address, False
        address += SIZES[text[0]]
        if text == "L0":
            for depth, loop in enumerate(loops):
                if loop[0] == here:
                    del loops[depth:]
                    break
            loops.append([here, address, 1])
        elif text[0] == "L":
            if not loops or (loops[-1][1] == 0 and loops[-1][0] != here):
                loops.append([here, 0, 1])
            if loops[-1][2] == int(text[1:]):
                loops.pop()
            else:
                loops[-1][2] += 1
                address = loops[-1][1]
        elif text.startswith("jc"):
            wanted, target = text[2:].split(",")
            if inputs == int(wanted):
                address, jumped = int(target), True
        elif text[0] == "j":
            address, jumped = int(text[1:]), True
        elif text[0] == "U":
            if here == 0:
                guard = int(text[1:])
            elif inputs & 1 << int(text[1:]) - 1:
                address, loops = 0, []
    return seen, "B"


def say(module: GsC200, text: str, now: int) -> str:
    module.receive("RXD", [Char(ord(letter)) for letter in text + "\r"], now)
    return "".join(chr(item.char.value) for item in module.drain() if isinstance(item, Sent)).strip()


def executed(program: list[str], inputs: int) -> tuple[list[int], str]:
    """The same with the firmware."""
    module = GsC200("gs-c200s", {"CHS": 0}, line_timing=False)
    for number in range(3):
        module.set_pin(f"UI{number + 1}", inputs >> number & 1, 0)
    module.power(True, 0)
    for text in ["Po", *program]:
        assert say(module, text, 0) == "Y"
    module.receive("RXD", [Char(ord("E")), Char(13)], 0)
    seen: list[int] = []
    while True:
        seen += [item.address for item in module.drain() if isinstance(item, Executing)]
        deadline = module.next_deadline()
        if deadline is None or len(seen) >= MOST:
            break
        module.advance(deadline)
    answer = say(module, "F", 10**9 if len(seen) < MOST else deadline - 1)
    return seen, answer


INSTRUCTIONS = st.one_of(
    st.sampled_from(["A1", "C1", "S10", "L0", "L0", "L1", "L2", "L3", "U1", "U2", "U3"]),
    st.integers(0, 30).map("j{}".format),
    st.builds("jc{},{}".format, st.integers(0, 7), st.integers(0, 30)),
)
PROGRAMS = st.lists(INSTRUCTIONS | st.sampled_from(["L0", "L2", "L3", "A1"]), min_size=1, max_size=12)


@settings(max_examples=examples(300), deadline=None, suppress_health_check=list(HealthCheck))
@given(PROGRAMS, st.integers(0, 7))
@example(["L0", "A1", "L2", "C1", "L3"], 0)
@example(["A1", "L2", "C1", "L3"], 0)
@example(["L0", "L0", "A1", "L2", "L2", "L2"], 0)
@example(["L0", "A1", "C1", "jc7,0", "L2", "C1", "L3"], 6)
@example(["U1", "L0", "A1", "L2", "j0"], 1)
@example(["j2"], 0)
@example(["A1", "j1"], 0)
def test_a_program_goes_where_the_specification_says(program: list[str], inputs: int) -> None:
    """Specification, "Language": loops nest, marks met again, U first and elsewhere, jumps and where they may lead."""
    expected = interpreted(program, inputs)
    seen, answer = executed(program, inputs)
    assert (seen[:MOST], answer) == expected


def test_re_met_marks_do_not_pile_up() -> None:
    """Specification: "meeting the same L0 again drops the marks above it"."""
    module = GsC200("gs-c200s", {"CHS": 0}, line_timing=False)
    module.power(True, 0)
    for text in ["Po", "L0", "L0", "A1", "j0", "E"]:
        say(module, text, 0)
    for _ in range(4000):
        deadline = module.next_deadline()
        assert deadline is not None
        module.advance(deadline)
    flow = module._running._flow
    assert len(flow._marks) <= 2
