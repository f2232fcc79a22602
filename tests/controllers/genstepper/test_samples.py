"""The manual's sample programs against an emulated board, with the outcome of their text (pages 48 to 55)."""

import sys
from pathlib import Path

import pytest

from detent.controllers.device import DriveSet
from detent.ticks import MS, SECOND

EXAMPLES = Path(__file__).parents[3] / "examples" / "genstepper"


@pytest.fixture
def samples(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import gendemo
    import gendemoser
    import genseekser
    import stamp

    yield gendemo, gendemoser, genseekser, stamp
    for name in ("gendemo", "gendemoser", "genseekser", "stamp"):
        sys.modules.pop(name)


def motions(one, axis):
    """(begin, end, first place, last place) of every move of an axis."""
    found = []
    for span in one.cell.recording.motion("board", one.cell.now, axis):
        end = span.train.time_of(span.last)
        begin, first = span.begins, span.shaft
        if found and found[-1][1] >= begin:
            begin, _, first, _ = found.pop()
        found.append((begin, end, first, span.shaft + span.direction * span.last))
    return found


@pytest.mark.parametrize("number", [0, 1])
def test_gendemo_and_gendemoser_spin_both_motors_between_0_and_2000_in_every_mode(samples, number):
    one = samples[3].VirtualStamp()
    program = (samples[0].gendemo, samples[1].gendemoser)[number]
    program(one)
    board = one.cell.controller("board")
    for axis in board.axes:
        moves = motions(one, axis)
        assert [place for _, _, *places in moves for place in places] == [0, 2000, 2000, 0] * 4
        for (begin, end, *_), (later, *_) in zip(moves[1:-1:2], moves[2::2], strict=True):
            assert begin < end
            assert later - end >= 200 * MS, "a pause of a fifth of a second between the cycles"
        modes = []
        for told in (t for t in one.cell.recording.of("board") if isinstance(t, DriveSet) and t.connector == axis):
            if told.drive.sixteenths and (not modes or modes[-1] != told.drive.mode):
                modes.append(told.drive.mode)
        assert modes == [0, 1, 2, 3], "each of the legal stepping modes in sequence"
        assert max(span_rate(one, axis)) == 1000
    assert board.status(one.cell.now).state == "ready"


def span_rate(one, axis):
    for span in one.cell.recording.motion("board", one.cell.now, axis):
        for segment in span.train.segments:
            yield max(segment.speed, segment.speed + segment.change * segment.ticks) // 62_500


def test_gendemoser_waits_for_the_end_of_every_move(samples):
    one = samples[3].VirtualStamp()
    samples[1].gendemoser(one)
    sent = dict(one.sent)
    for axis in "XY":
        for begin, end, *_ in motions(one, axis):
            inside = [text for at, text in sent.items() if begin < at < end]
            assert inside == ["00I"], "nothing is said between a go and its prompt but the wait"


def test_genseekser_y_switches_to_full_step_and_x_does_not(samples):
    one = samples[3].VirtualStamp()
    samples[2].genseekser(one)
    fastest = {axis: max(span_rate(one, axis)) for axis in "XY"}
    assert fastest == {"X": 4000, "Y": 8000}
    for axis, switches in (("X", False), ("Y", True)):
        drives = [t for t in one.cell.recording.of("board") if isinstance(t, DriveSet) and t.connector == axis]
        micro = [told.drive for told in drives if told.drive.mode == 3 and told.drive.auto >= 0]
        assert {drive.step_mode(fastest[axis]) for drive in micro} == {2 if switches else 3}
        assert {drive.step_mode(6143) for drive in micro} == {3}
        moves = motions(one, axis)
        assert [place for _, _, *places in moves for place in places] == [0, 16_000, 16_000, 0] * 4
    gaps = [later[0] - now[1] for now, later in zip(motions(one, "X")[1:-1:2], motions(one, "X")[2::2], strict=True)]
    assert all(200 * MS < gap < SECOND for gap in gaps)


def test_no_sample_program_meets_a_prompt_that_is_not_its_own(samples):
    """Nothing is heard of what the zeros flushed: each wait ends with the I's own prompt, at rest."""
    one = samples[3].VirtualStamp()
    heard = one.serin_wait

    def watched(character):
        heard(character)
        board = one.cell.controller("board")
        assert {board.status(one.cell.now, axis).state for axis in "XY"} == {"ready"}

    one.serin_wait = watched
    samples[2].genseekser(one, cycles=2)
