"""The short form of ``make fuzz``, and every case that once failed."""

from pathlib import Path

import pytest
from tests.proofs import fuzz

FAILED = sorted(fuzz.CASES.glob("*.json"))


@pytest.mark.parametrize("path", FAILED, ids=lambda path: path.stem)
def test_what_once_failed_holds(path: Path) -> None:
    fuzz.replay(path)


@pytest.mark.parametrize("target", fuzz.targets())
def test_a_few_cases_of_every_target_hold(target: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fuzz, "CASES", tmp_path)
    tally = fuzz.batch(target, 0, {"unit": 12, "cell": 4, "read": 60}[target.partition(" ")[0]])
    assert tally.cases
    assert not [path.read_text() for path in tmp_path.iterdir()]


@pytest.mark.slow
@pytest.mark.parametrize("target", fuzz.targets())
def test_many_cases_of_every_target_hold(target: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fuzz, "CASES", tmp_path)
    tally = fuzz.batch(target, 1000, {"unit": 300, "cell": 60, "read": 4000}[target.partition(" ")[0]])
    assert tally.cases
    assert not [path.read_text() for path in tmp_path.iterdir()]


def test_a_short_run_reaches_everything_in_its_share_of_the_time() -> None:
    """A batch of a reader takes 0.3 s here, of a unit 1 s, of cells 2 s: after so many batches all have been met."""
    takes = {"unit": 1.0, "cell": 2.0, "read": 0.3}
    spent = dict.fromkeys(fuzz.targets(), 0.0)
    for _ in range(200):
        target = fuzz.due(spent)
        spent[target] += takes[target.partition(" ")[0]]
    assert all(spent.values())
    total = sum(spent.values())
    for kind, share in fuzz.SHARE.items():
        of_kind = sum(took for target, took in spent.items() if target.startswith(kind))
        assert abs(of_kind / total - share) < 0.03, kind


def test_a_case_that_fails_is_made_small_and_fails_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A unit that breaks at a frame: what is kept is that frame."""
    monkeypatch.setattr(fuzz, "CASES", tmp_path)
    check = fuzz.units.check

    def breaks(case: fuzz.units.Case, tally: fuzz.Tally) -> None:
        check(case, tally)
        if any(getattr(action, "text", "").startswith("S") for action in case.actions):
            raise ZeroDivisionError("S breaks it")

    monkeypatch.setattr(fuzz.units, "check", breaks)
    tally = fuzz.batch("unit gs-c200", 0, 1)
    (name,) = tally.failures
    assert (tmp_path / name).read_text().count('"Say"') == 1
    with pytest.raises(ZeroDivisionError):
        fuzz.replay(tmp_path / name)
