"""Backups of a DCB-274, and what a restore leaves that fails on the way."""

import pytest
from tests.hosts.dcb274_units import alone, driven, three

from detent.cell.host import HostPort
from detent.hosts.axis import Speeds
from detent.hosts.dcb274.memory import HalfWritten, hex_lines
from detent.hosts.exchange import Progress


class Unplugged(HostPort):
    """Is gone at the write number `left` of a backslash, and there again then."""

    left = 0

    def write(self, data: bytes) -> int:
        self.left -= data == b"\\"
        if self.left == 0 and data == b"\\":
            raise OSError(5, "Input/output error")
        return super().write(data)


@pytest.fixture(scope="module")
def backup() -> dict[str, object]:
    """Of a unit with a program, settings and a name of its own."""
    _, unit = alone()
    unit.sign_on("Q")
    unit.write_program(["O 0", "R 400", "P 1600", "A 8"])
    unit.set_speeds(Speeds(300, 9000, 0.2))
    unit.currents(20, 60)
    unit.save()
    return unit.saved()


def test_a_backup_has_what_the_unit_keeps_as_text_too(backup: dict[str, object]) -> None:
    memory, parameters = backup["memory"], backup["parameters"]
    assert isinstance(memory, list)
    assert len(memory) == 128
    assert memory[0].startswith("0f 00 00 00")  # O: the letter's code less 40h
    assert backup["program"] == ["P 0", "O 0", "R 400", "P 1600", "A 8"]  # not what is left of the factory's
    assert isinstance(parameters, dict)
    assert {key: parameters[key] for key in ("name", "divide", "initial_velocity", "slew_velocity", "decay")} == {
        "name": "Q", "divide": 1, "initial_velocity": 300, "slew_velocity": 9572, "decay": 30,
    }  # fmt: skip


def test_a_backup_is_restored_to_a_new_unit_with_what_differs_only(backup: dict[str, object]) -> None:
    cell, unit = alone()
    steps: list[Progress] = []
    unit.watch = steps.append
    told = unit.restore(backup)
    assert told[0].startswith("programs: wrote ")
    assert "settings: loaded from NV memory (C 0)" in told
    assert steps[-1].done == steps[-1].total
    assert unit.saved() == backup
    assert unit.examine().name == "Q"
    writes = cell.controllers()["unit"].memory.writes
    assert set(writes.values()) == {1}
    assert len(writes) < 60
    assert unit.restore(backup)[0] == "NV memory was as in the backup: nothing was written"
    assert set(writes.values()) == {1}


def test_on_a_party_line_the_name_stays_and_the_bytes_are_all_there(backup: dict[str, object]) -> None:
    _, port = three()
    (x,) = driven(port, "X", "party")
    told = x.restore(backup)
    assert told[-1] == "name: stays X, and is not Q: names are given in single mode"
    saved = x.saved()
    assert "program" not in saved
    assert x.position() == 0
    differ = [i for i, (a, b) in enumerate(zip(saved["memory"], backup["memory"], strict=True)) if a != b]  # type: ignore[call-overload]
    assert differ == [247 // 16]


def test_a_restore_that_fails_half_way_says_what_is_where_and_keeps_what_was(backup: dict[str, object]) -> None:
    _, unit = alone(port=Unplugged)
    before = unit.saved()["memory"]
    unit.port.left = 6
    with pytest.raises(
        HalfWritten, match=r"of \d+ bytes that differ 5 are new, at .*: restore again to go on"
    ) as caught:
        unit.restore(backup)
    assert hex_lines(caught.value.before) == before
    assert unit.restore(backup)
    assert unit.saved() == backup


def test_a_restore_that_fails_at_once_has_written_nothing(backup: dict[str, object]) -> None:
    _, unit = alone(port=Unplugged)
    unit.connect()
    unit.port.left = 1
    with pytest.raises(HalfWritten, match="nothing was written for sure; address 0 may be, the rest is as it was"):
        unit.restore(backup)
