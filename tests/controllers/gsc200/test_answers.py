"""Generated frames: what is refused changes nothing, what is for others is not heard, the rest is answered once.

Datasheet, "Data exchange protocol"; the specification page, "Frames" and "Modes".
"""

import copy
from typing import NamedTuple

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from tests.controllers.gsc200 import inputs
from tests.generated import examples

from detent.controllers.device import Executing, Refused, StoreImage
from detent.controllers.gsc200.firmware import GsC200
from detent.ticks import MS, SECOND
from detent.uart import Char, Sent

SETTINGS = {"deadline": None, "suppress_health_check": list(HealthCheck)}
FAST = settings(max_examples=examples(120), **SETTINGS)
THOROUGH = settings(max_examples=800, **SETTINGS)
SEL = {1: (0, 1, 1), 2: (1, 0, 1), 3: (0, 0, 1), 4: (1, 1, 0), 5: (0, 1, 0), 6: (1, 0, 0), 7: (0, 0, 0)}


class Kind(NamedTuple):
    """One module in one setting."""

    model: str
    address: int | None
    checksums: bool
    revision: tuple[int, int] = (2, 2)

    def make(self) -> GsC200:
        straps = {"CHS": int(self.checksums)}
        if self.address is not None:
            straps |= dict(zip(("SEL2", "SEL1", "SEL0"), SEL[self.address], strict=True))
        options = {"revision": self.revision} if self.model == "gs-c200" else {}
        made = GsC200(self.model, straps, line_timing=False, **options)
        made.power(True, 0)
        return made

    def frame(self, text: str) -> bytes:
        """As the datasheet has it: address, text, checksum, CR."""
        data = (str(self.address or "") + text).encode()
        if self.checksums:
            total = sum(data) % 128
            data += bytes([total if self.model == "gs-c200" and self.revision < (2, 2) else total | 16])
        return data + b"\r"

    def texts(self, sent: bytes) -> list[str]:
        """The answers in `sent`, each with its checksum verified."""
        found = []
        while sent:
            end = sent.index(b"\r")
            if self.checksums and sent[end : end + 2] == b"\r\r":  # the checksum itself is CR
                end += 1
            line, sent = sent[:end], sent[end + 1 :]
            if self.checksums:
                total = sum(line[:-1]) % 128
                old = self.model == "gs-c200" and self.revision < (2, 2)
                assert line[-1] == (total if old else total | 16)
                line = line[:-1]
            found.append(line.decode())
        return found


KINDS = st.builds(
    Kind,
    st.sampled_from(["gs-c200", "gs-c200s"]),
    st.none() | st.integers(1, 7),
    st.booleans(),
    st.sampled_from([(2, 2), (2, 2), (2, 1), (3, 0)]),
)


class Story:
    """A module and what it did."""

    def __init__(self, kind: Kind, made: GsC200, now: int = 0) -> None:
        self.kind, self.made, self.now = kind, made, now
        self.out: list = []

    def copy(self) -> "Story":
        return Story(self.kind, copy.deepcopy(self.made), self.now)

    def collect(self) -> None:
        while new := self.made.drain():
            self.out += new
            for item in new:
                if isinstance(item, StoreImage):
                    self.made.stored(len(item.image) % 3 != 1, self.now)

    def wait(self, time: int) -> None:
        until = self.now + time
        while (deadline := self.made.next_deadline()) is not None and deadline <= until:
            self.now = deadline
            self.made.advance(deadline)
            self.collect()
        self.now = until

    def send(self, data: bytes) -> list[str]:
        """Send bytes; the answers of this instant."""
        before = len(self.out)
        self.made.receive("RXD", [Char(value & 127, parity_ok=value < 128) for value in data], self.now)
        self.collect()
        sent = bytes(item.char.value for item in self.out[before:] if isinstance(item, Sent))
        return self.kind.texts(sent)

    def say(self, text: str) -> list[str]:
        return self.send(self.kind.frame(text))


def _histories(model: str) -> st.SearchStrategy[list]:
    """What a module has been through."""
    line = st.one_of(inputs.commands(model), inputs.NONSENSE).map(lambda text: [text])
    step = st.one_of(
        line, inputs.programs(model), st.sampled_from([1 * MS, 30 * MS, 1 * SECOND, 100 * SECOND]),
        st.tuples(st.sampled_from(inputs.INPUTS), st.integers(0, 1)),
    )  # fmt: skip
    return st.lists(step, max_size=8)


def _lived(kind: Kind, history: list) -> Story:
    story = Story(kind, kind.make())
    for step in history:
        if isinstance(step, int):
            story.wait(step)
        elif isinstance(step, list):
            for text in step:
                story.say(text)
        else:
            story.made.set_pin(*step, story.now)
            story.collect()
    story.send(b"\r")  # whatever was begun is over
    story.out.clear()
    return story


def _probe(story: Story) -> list:
    """Everything a module shows from here on, whatever one asks."""
    kind = story.kind
    status = story.made.status(story.now)
    replies = [story.say("F")]
    story.wait(50 * MS)
    replies += [story.say(text) for text in ("F", "V1", "V2", "Q", "K", "F", "F")]
    replies += [story.say("E" if status.state == "programming" and kind.model == "gs-c200" else "Px")]
    story.wait(1 * SECOND)
    for pin in ("UI1", "UI2", "UI3", "ENABLE"):
        story.made.set_pin(pin, 1, story.now)
    replies += [story.say(text) for text in ("K", "Q", "V1", "V2", "+300")]  # with the speeds in force
    story.wait(3 * SECOND)
    replies += [story.say(text) for text in ("Z", "E")]
    story.wait(1 * SECOND)
    replies += [story.say(text) for text in ("K", "X", "Q", "V1")]
    return [status, replies, [item for item in story.out if not isinstance(item, Refused)]]


def _texts(model: str) -> st.SearchStrategy[str]:
    wrong = st.sampled_from(["A9", "S0", "S1001", "R1000", "D256", "+0", "G10000000", "L256", "P5", "f9999999", "U0"])
    return st.one_of(inputs.commands(model), inputs.NONSENSE, wrong, st.text("AFGKZ+-0123,jcPoxL", max_size=11))


def check_refusals(data: st.DataObject) -> None:
    kind = data.draw(KINDS)
    story = _lived(kind, data.draw(_histories(kind.model)))
    text = data.draw(_texts(kind.model))
    frame = kind.frame(text)
    if len(frame) > 1 and data.draw(st.booleans()):  # something happens to it on its way
        at = data.draw(st.integers(0, len(frame) - 2))
        frame = frame[:at] + bytes([frame[at] ^ data.draw(st.sampled_from([1, 2, 16, 128]))]) + frame[at + 1 :]
    assume(frame.count(b"\r") == 1)
    untouched = story.copy()
    answers = story.send(frame)
    assume(text != "F")
    if answers not in (["E1"], ["E2"], ["E3"], ["E4"], ["E5"], ["E6"], ["B"]):
        return
    if answers == ["E6"]:  # the storing was asked for, and failed
        story.out = [item for item in story.out if not isinstance(item, StoreImage)]
    assert all(isinstance(item, (Sent, Refused)) for item in story.out)
    story.out.clear()
    assert _probe(story) == _probe(untouched)


@FAST
@given(st.data())
def test_a_refused_frame_changes_nothing(data: st.DataObject) -> None:
    """Specification, "Errors": "A frame in error changes nothing"; datasheet: B "has no effect"."""
    check_refusals(data)


@pytest.mark.slow
@THOROUGH
@given(st.data())
def test_a_refused_frame_changes_nothing_at_length(data: st.DataObject) -> None:
    check_refusals(data)


def check_others(data: st.DataObject) -> None:
    kind = data.draw(KINDS.filter(lambda kind: kind.address is not None))
    story = _lived(kind, data.draw(_histories(kind.model)))
    stream = b""
    for line in data.draw(st.lists(st.binary(max_size=15).map(lambda raw: raw.replace(b"\r", b"")), max_size=6)):
        if line[:1] != str(kind.address).encode():
            stream += line + b"\r"
    for text, address in data.draw(st.lists(st.tuples(_texts(kind.model), st.integers(0, 9)), max_size=6)):
        if address != kind.address:
            stream += kind._replace(address=address).frame(text) if address else b"0" + text.encode() + b"\r"
    lines = stream.split(b"\r")
    assume(all(line[:1] != str(kind.address).encode() for line in lines))
    untouched = story.copy()
    assert story.send(stream) == []
    assert story.out == []
    assert _probe(story) == _probe(untouched)


@FAST
@given(st.data())
def test_a_module_never_answers_to_another_address(data: st.DataObject) -> None:
    """Datasheet, "Module address programming"; specification: "ignores strings for other addresses without a word"."""
    check_others(data)


def check_answered_once(data: st.DataObject) -> None:
    kind = data.draw(KINDS)
    story = _lived(kind, data.draw(_histories(kind.model)))
    text = data.draw(_texts(kind.model))
    frame = kind.frame(text)
    assume(frame.count(b"\r") == 1 and frame != b"\r")
    instructions = None
    if text == "Q":
        held = story.copy()
        instructions = held.say("Q")
    answers = story.send(frame)
    if answers and answers[-1] == "END":
        assert text == "Q"
        assert answers == instructions
        assert answers.count("END") == 1
    else:
        assert len(answers) == 1
        assert answers[0] in {"Y", "B", "R", "E1", "E2", "E3", "E4", "E5", "E6"} or answers[0][0] == "V"
    before = len(story.out)
    story.wait(10 * SECOND)
    assert not any(isinstance(item, Sent) for item in story.out[before:])  # and nothing comes later


@FAST
@given(st.data())
def test_every_complete_frame_is_answered_once(data: st.DataObject) -> None:
    """Datasheet: "The GS-C feeds back information to the Host every time it receives a command"."""
    check_answered_once(data)


@pytest.mark.slow
@THOROUGH
@given(st.data())
def test_every_complete_frame_is_answered_once_at_length(data: st.DataObject) -> None:
    check_answered_once(data)
    check_others(data)


@FAST
@given(KINDS, st.lists(st.binary(max_size=40), max_size=6), st.data())
def test_any_stream_of_bytes_is_survived(kind: Kind, pieces: list[bytes], data: st.DataObject) -> None:
    """Afterwards a whole frame for the module is answered as ever."""
    story = _lived(kind, data.draw(_histories(kind.model)))
    for piece in pieces:
        story.send(piece)
        story.wait(1 * MS)
    story.send(b"\r")
    story.say("K")
    assert story.say("F")[0] in ("R", "E4", "E5")


@FAST
@given(st.data())
def test_Q_lists_what_runs(data: st.DataObject) -> None:
    """The listing, entered again, is the same program: Q after it lists the same."""
    kind = data.draw(KINDS)
    story = Story(kind, kind.make())
    enter = "P" if kind.model == "gs-c200" else "Po"
    story.say(enter)
    for text in data.draw(st.lists(inputs.stored(kind.model), max_size=20)):
        story.say(text)
    listing = story.say("Q")
    assert listing[-1] == "END"
    twin = Story(kind, kind.make())
    twin.say(enter)
    for text in listing[:-1]:
        assert twin.say(text) == ["Y"]
    assert twin.say("Q") == listing
    assert [item for item in story.out if isinstance(item, Executing)] == []
