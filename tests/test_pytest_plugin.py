import contextlib
import os
from pathlib import Path

import pytest
import serial

from detent.cell.description import Problem
from detent.realtime.verbs import AskedWrongly
from detent.testing.bench import Bench

pytest_plugins = ["pytester"]


class Host:
    """Host software of the kind that is to be tested: it repeats what was not understood (datasheet, E1)."""

    def __init__(self, port: str) -> None:
        self.line = serial.Serial(port, 9600, bytesize=7, parity="O", stopbits=2, timeout=180)
        self.sent = 0

    def ask(self, command: str) -> str:
        for _ in range(3):
            self.line.write(f"{command}\r".encode())
            self.sent += 1
            answer = self.line.read_until(b"\r")[:-1].decode()
            if answer != "E1":
                return answer
        raise ConnectionError(f"{command}: not understood three times")

    def __enter__(self) -> "Host":
        return self

    def __exit__(self, *_: object) -> None:
        self.line.close()


def test_a_host_finds_the_unit_at_its_port(detent: Bench) -> None:
    unit = detent.serve("gs-c200", straps={"CHS": "low"})
    with Host(unit.port) as host:
        assert host.ask("F") == "R"
    assert unit.state()["state"] == "ready"


def test_a_damaged_character_is_answered_e1_and_the_host_repeats(detent: Bench) -> None:
    """Datasheet: E1 is sent for a parity error, "the host must repeat"."""
    unit = detent.serve("gs-c200", straps={"CHS": "low"})
    unit.fault("bit-errors", towards="units", nth=2)
    with Host(unit.port) as host:
        assert host.ask("V1") == "V0"
        assert host.sent == 2


def test_an_axis_is_stopped_exactly_at_a_place_and_goes_on_from_there(detent: Bench) -> None:
    unit = detent.serve("gs-c200", straps={"CHS": "low"}, pace=None)
    unit.pause()
    unit.type("+1000")
    unit.wait(position=417, resume=True, pause=True)
    assert unit.position() == 417
    unit.fault("cable-out")
    unit.wait(state="ready", resume=True)
    assert unit.position() == 1000


def test_a_write_that_fails_is_answered_e6_and_the_memory_is_as_it_was(detent: Bench, tmp_path: Path) -> None:
    unit = detent.serve("gs-c200", straps={"CHS": "low"})
    with Host(unit.port) as host:
        assert [host.ask(line) for line in ("P", "C1", "E")] == ["Y"] * 3
        assert host.ask("K") == "Y"
        unit.fault("eeprom", times=1)
        assert host.ask("M") == "E6"
        assert unit.state()["image_bytes"] == 0
        assert host.ask("M") == "Y"
    (image,) = (tmp_path / "eeprom").glob("*.eeprom")
    unit.close()
    again = detent.serve("gs-c200", straps={"CHS": "low"})
    with Host(again.port) as host:
        assert host.ask("X") == "Y"
        host.line.write(b"Q\r")
        assert host.line.read_until(b"END\r") == b"C1\rEND\r"
    assert image.exists()


def test_units_of_a_cell_are_looked_at_one_by_one(detent: Bench, tmp_path: Path) -> None:
    file = tmp_path / "two.toml"
    file.write_text(
        '[units.x]\nmodel = "gs-c200"\nstraps = { CHS = "low" }\n'
        '[units.y]\nmodel = "gs-c200s"\nstraps = { CHS = "low" }\n'
        '[[wires]]\nfrom = "x.UO1"\nto = "y.UI1"\n'
    )
    x = detent.serve(file, tcp=True)
    y = x["y"]
    assert (x.unit, y.unit) == ("x", "y")
    assert x.port != y.port
    assert x.tcp.startswith("127.0.0.1:")
    y.wait(pin="UI1", level=0)  # outputs are 0 at power-on
    x.type("A1")
    y.wait(pin="UI1", level=1)
    with pytest.raises(AskedWrongly, match="did you mean x"):
        x["xx"]


def test_two_units_of_one_model_do_not_share_a_memory(detent: Bench) -> None:
    first, second = detent.serve("gs-c200"), detent.serve("gs-c200")
    assert first.port != second.port


def test_what_does_not_come_is_told_with_the_state(detent: Bench) -> None:
    unit = detent.serve("gs-c200")
    with pytest.raises(TimeoutError, match=r"gs-c200 has not come to position 5, .*'state': 'ready'"):
        unit.wait(position=5, timeout=0.01)


def test_a_run_that_takes_too_long_is_told(detent: Bench) -> None:
    unit = detent.serve("gs-c200")
    with pytest.raises(TimeoutError, match="has not run for 1000 s"):
        unit.run_for("1000 s", timeout=0.01)


def test_an_axis_that_there_is_not_is_told_with_a_remedy(detent: Bench) -> None:
    with pytest.raises(AskedWrongly, match="gs-c200 has no axis 'x'; leave the axis out"):
        detent.serve("gs-c200").position("x")
    with pytest.raises(AskedWrongly, match="bs0610 has no axis 'Z'; there are: X, Y"):
        detent.serve("bs0610").position("Z")


@pytest.mark.parametrize(
    ("target", "says"), [("gs-c20", "did you mean gs-c200"), ("nowhere.toml", "nowhere.toml: cannot read it")]
)
def test_a_wrong_target_is_named_with_a_remedy(detent: Bench, target: str, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        detent.serve(target)


def test_a_cell_file_has_its_own_straps(detent: Bench) -> None:
    with pytest.raises(Problem, match="write them there"):
        detent.serve("cell.toml", straps={"CHS": "low"})


def test_everything_ends_with_the_test(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        import os, pathlib

        def test_one(detent):
            unit = detent.serve("gs-c200")
            pathlib.Path("port").write_text(f"{os.stat(unit.port).st_ctime_ns} {unit.port}")
            raise AssertionError("and it fails")
        """
    )
    outcome = pytester.runpytest_inprocess("-p", "no:cacheprovider")
    outcome.assert_outcomes(failed=1)
    made, _, port = (pytester.path / "port").read_text().partition(" ")
    with contextlib.suppress(FileNotFoundError):  # the name may be somebody else's by now
        assert os.stat(port).st_ctime_ns != int(made)
