"""Numbers that nobody means, for every numeric option of the rig: an answer, or one line that names what to give."""

from dataclasses import fields
from typing import get_args, get_type_hints

import pytest

from detent.cli import main
from detent.cli.rig import RigOptions
from detent.motors import chance

HINTS = get_type_hints(RigOptions)
NUMBERS = [one.name for one in fields(RigOptions) if float in (HINTS[one.name], *get_args(HINTS[one.name]))]
BESIDE = {  # what makes it a rig
    "mass": ["--screw", "0.005"], "force": ["--screw", "0.005"], "drag": ["--screw", "0.005"],
    "slope": ["--screw", "0.005", "--mass", "1"], "efficiency": ["--screw", "0.005", "--force", "1"],
    "screw": ["--mass", "1"], "belt_radius": ["--mass", "1"], "rack_radius": ["--mass", "1"],
}  # fmt: skip
VALUES = ["0", "-1", "1e-300", "1e300", "nan", "inf", ""]
MOVE = ["motor", "qsh4218-41-10-035", "--move", "10", "--start", "20", "--slew", "100", "--variants", "0"]


def told(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str]:
    with pytest.raises(SystemExit) as ended:
        main([*words])
    printed = capsys.readouterr()
    code = ended.value.code or 0
    assert code in (0, 2), printed.err
    assert len(printed.err.splitlines()) == (1 if code else 0), printed.err
    assert "nan " not in printed.out
    return int(code), printed.err


def test_they_are_all_here() -> None:
    assert {"supply", "current", "gear", "mass", "damping", "efficiency"} < set(NUMBERS)
    assert len(NUMBERS) >= 17


@pytest.mark.parametrize("name", [*NUMBERS, "ring_down"])
def test_any_number_is_answered_or_refused_in_one_line(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    option = f"--{name.replace('_', '-')}"
    for value in VALUES:
        code, error = told(capsys, *MOVE, f"{option}={value}", *BESIDE.get(name, []))
        if value in ("nan", "inf", ""):
            assert code == 2, value
            assert value or option in error  # which option is empty is said


def test_a_motor_without_torque_does_not_speak_of_its_brakes(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main([*MOVE, "--current", "1e-300"])
    assert "has no torque at this speed" in capsys.readouterr().out


def test_a_bound_of_very_many_losses_costs_little() -> None:
    """Half of a million: by the normal law 0.5 and 1.645 times 0.0005."""
    assert chance.bound(500_000, 1_000_000) == pytest.approx(0.5 + 1.6449 * 0.0005, abs=2e-6)
    assert chance.bound(999_999, 1_000_000) == pytest.approx(1 - 0.0513 / 1e6, abs=1e-9)
