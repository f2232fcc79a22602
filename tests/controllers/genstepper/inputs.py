"""What may reach a BS0610 or BS0710: commands, garbage, damaged characters, levels; and the boards themselves."""

from hypothesis import strategies as st
from tests.controllers.conformance import Candidate

from detent.controllers.genstepper import pins
from detent.controllers.genstepper.firmware import GenStepper
from detent.ticks import MS, US, Ns
from detent.uart import Char

INPUTS = (*pins.LIMITS, *pins.SLEWS, "NXT", "RST", "VC", "SI", "R1K")

numbers = st.one_of(st.integers(-300, 300), st.integers(-(2**32), 2**32), st.sampled_from([0, 1, 62_500])).map(str)
commands = st.one_of(
    st.builds(str.__add__, numbers, st.sampled_from("GSRKPMOWAHTVE=?!")),
    st.sampled_from(
        ["+S", "-S", "Z", "X", "Y", "B", "I", "L", "0?", "1E", "2E", "0E", "200G", "-100S", "900R", "-12?"]
    ),
    st.text(st.sampled_from("0123456789+-GSZRK=?xyb ,\r"), max_size=5),
    st.binary(max_size=4).map(lambda data: data.decode("latin-1")),
)


def _frame(text: str, gap: Ns, damaged: int) -> list[tuple[Ns, Char]]:
    return [(gap, Char(ord(letter), framing_ok=n != damaged)) for n, letter in enumerate(text)]


frames = st.builds(_frame, commands, st.sampled_from([0, 0, 1_041_667]), st.sampled_from([-1] * 6 + [0, 1]))
gaps = st.sampled_from([0, 0, 1, 8 * US, 16 * US, 20 * MS, 300 * MS]) | st.integers(0, 40 * MS)

CANDIDATES = (
    Candidate("bs0610", lambda: GenStepper("bs0610"), frames, INPUTS, "SI", gaps),
    Candidate("bs0610, no line timing", lambda: GenStepper("bs0610", line_timing=False), frames, INPUTS, "SI", gaps),
    Candidate("bs0710 in E mode, hard limits", lambda: GenStepper("bs0710", e_mode=2, hard_stop=True), frames, INPUTS,
              "SI", gaps),
)  # fmt: skip
