from io import StringIO

import pytest
from tests.outputs.expected import level_changes, pulses, settled
from tests.outputs.recorded import BAR, DRILL, drilling, interrupted, moved

from detent.cell.recording import Recording
from detent.controllers.device import Powered
from detent.outputs import signals, vcd
from detent.outputs.signals import Signals
from detent.pins import PinSet
from detent.ticks import MS


def parse(text: str) -> tuple[dict[tuple[str, str], list[tuple[int, str]]], int]:
    """A reader of its own: (scope, name) -> [(time, value)], and the last time. Values before time 0 are at -1."""
    names: dict[str, tuple[str, str]] = {}
    found: dict[tuple[str, str], list[tuple[int, str]]] = {}
    scope: list[str] = []
    now, dumping, times = 0, False, []
    words = StringIO(text)
    for line in words:
        fields = line.split()
        match fields:
            case ["$timescale", *scale, "$end"]:
                assert scale == ["1", "ns"]
            case ["$scope", "module", name, "$end"]:
                scope.append(name)
            case ["$upscope", "$end"]:
                scope.pop()
            case ["$var", _, _, identifier, name, "$end"]:
                assert identifier not in names
                names[identifier] = (".".join(scope), name)
                found[names[identifier]] = []
            case ["$dumpvars"]:
                dumping = True
            case ["$end"]:
                dumping = False
            case [word] if word.startswith("#"):
                now = int(word[1:])
                times.append(now)
            case [word] if word[0] in "01xz":
                found[names[word[1:]]].append((-1 if dumping else now, word[0]))
            case [value, identifier] if value[0] == "b":
                found[names[identifier]].append((-1 if dumping else now, value[1:]))
            case _:
                assert fields[0] in ("$comment", "$enddefinitions"), line
    assert times == sorted(set(times)), "every time is written once, in order"
    return found, now


def dump(recording, views, until) -> str:
    return b"".join(vcd.pieces(Signals(recording, views, until))).decode("ascii")


def signed(bits: str, width: int = 32) -> int:
    value = int(bits, 2)
    return value - (1 << width) if len(bits) == width and bits[0] == "1" else value


@pytest.mark.parametrize(("made", "views"), [(drilling, [BAR, DRILL]), (interrupted, [DRILL])])
def test_a_reader_of_its_own_finds_every_level_and_every_position(made, views):
    recording, until = made()
    found, end = parse(dump(recording, views, until))
    assert end == until
    for view in views:
        for pin, wanted in level_changes(recording, view, until).items():
            got = settled([(t, "01x".index(level)) for t, level in found[view.name, pin]])
            assert got == wanted, pin
        positions = [(t, signed(bits)) for t, bits in found[view.name, "position"]]
        assert positions == [(-1, 0), *((t, place) for t, _, place in pulses(recording, view.name, until))]


def test_small_windows_give_the_same_bytes(monkeypatch):
    recording, until = drilling()
    whole = dump(recording, [BAR, DRILL], until)
    windows = signals.Signals.windows
    monkeypatch.setattr(signals.Signals, "windows", lambda self: windows(self, 7))
    assert dump(recording, [BAR, DRILL], until) == whole


def test_a_run_in_which_nothing_happens_has_its_levels_and_its_end():
    found, end = parse(dump(Recording(["bar"]), [BAR], 5 * MS))
    assert end == 5 * MS
    assert found["bar", "UI1"] == [(-1, "1")]
    assert found["bar", "CLOCK"] == [(-1, "x")]


def test_changes_of_one_instant_keep_the_order_in_which_they_were_recorded():
    recording = Recording(["bar"])
    recording.extend(0, [Powered(0, True), PinSet(9, "UO1", 1), PinSet(9, "MOV", 1), PinSet(9, "UO1", 0)])
    text = dump(recording, [BAR], 20)
    found, _ = parse(text)
    assert found["bar", "UO1"][-2:] == [(9, "1"), (9, "0")]
    mov, uo1 = (line.split()[3] for line in text.splitlines() if line.endswith((" MOV $end", " UO1 $end")))
    assert f"#9\n1{uo1}\n1{mov}\n0{uo1}\n" in text


def test_positions_beyond_32_bits_are_written_with_64():
    recording = Recording(["bar"])
    recording.extend(0, [Powered(0, True), *moved(2, -1, 0, -(1 << 31) + 1)[0]])
    text = dump(recording, [BAR], 100 * MS)
    found, _ = parse(text)
    assert "$var integer 64" in text
    assert [signed(bits, 64) for _, bits in found["bar", "position"]][-1] == -(1 << 31) - 1


def test_blanks_in_names_do_not_end_them():
    recording = Recording(["my bar"])
    found, _ = parse(dump(recording, [BAR._replace(name="my bar")], 1))
    assert ("my_bar", "CLOCK") in found


def test_a_hundred_units_have_identifiers_of_their_own():
    names = [f"u{n}" for n in range(100)]
    recording = Recording(names)
    recording.extend(99, [PinSet(5, "UO1", 1)])
    found, _ = parse(dump(recording, [BAR._replace(name=name) for name in names], 10))
    assert found["u99", "UO1"] == [(-1, "x"), (5, "1")]
    assert len(found) == 100 * 9


def test_the_file_is_written(tmp_path):
    recording, until = drilling()
    path = tmp_path / "run.vcd"
    vcd.write(path, Signals(recording, [BAR, DRILL], until))
    assert path.read_text() == dump(recording, [BAR, DRILL], until)
