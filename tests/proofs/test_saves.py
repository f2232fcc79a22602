"""What is kept on disk is the old or the new, never a part of one: what of it takes no chance and little time."""

from pathlib import Path
from random import Random

import pytest
from tests.proofs import saves


def test_a_save_of_which_any_call_fails_says_whether_it_is_kept(tmp_path: Path) -> None:
    assert saves.every_call_fails(tmp_path / "state") > 30


def test_a_power_failure_behind_any_step_leaves_the_old_or_the_new(tmp_path: Path) -> None:
    assert saves.power_fails(tmp_path / "state") > 50


def test_a_disk_that_would_lose_what_is_not_synced_finds_a_save_that_does_not_sync(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The model of the disk is one that a careless save does not pass."""
    careful = saves.Disk.states

    def careless(disk: saves.Disk, names: dict[str, bytes]) -> object:
        disk.steps = [step for step in disk.steps if step[0] != "sync"]
        return careful(disk, names)

    monkeypatch.setattr(saves.Disk, "states", careless)
    with pytest.raises((AssertionError, ValueError)):
        saves.power_fails(tmp_path / "state")


def test_a_full_disk_costs_nothing_that_was_kept(tmp_path: Path) -> None:
    assert saves.disk_is_full(tmp_path / "state") > 10


def test_a_state_folder_that_vanishes_and_comes_back(tmp_path: Path) -> None:
    saves.folder_vanishes(tmp_path / "state")


@pytest.mark.parametrize("name", saves.STORES)
def test_a_kill_in_the_middle_of_a_save_loses_nothing_that_was_acknowledged(name: str, tmp_path: Path) -> None:
    assert sum(saves.killed(saves.STORES[name], tmp_path, Random(number)) for number in range(5)) >= 5
