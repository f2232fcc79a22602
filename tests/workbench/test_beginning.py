"""What the page Begin is told: it keeps nobody waiting who looks at the same workbench."""

import asyncio
import os
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from detent.workbench import beginning
from detent.workbench.beginning import Beginning
from detent.workbench.drafts import Drafts
from detent.workbench.folder import Folder
from detent.workbench.live import Live
from detent.workbench.newcell import NewCell, NewMotor, NewUnit

CELL = 'title = "{}"\n[units.x]\nmodel = "gs-c200"\n'


def begun(folder: Path) -> Beginning:
    bench: Any = SimpleNamespace(picture=SimpleNamespace(target="gs-c200"))
    return Beginning(bench, Live(), Folder(folder), Drafts(folder / "state", "cell"))


def test_cell_files_are_read_beside_the_loop_and_each_once_for_as_long_as_it_stays_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[tuple[str, bool]] = []
    parse = beginning.parse

    def noted(text: str, name: str) -> Any:
        read.append((name, threading.current_thread() is threading.main_thread()))
        return parse(text, name)

    monkeypatch.setattr(beginning, "parse", noted)
    monkeypatch.setattr(beginning, "home", lambda: tmp_path / "nothing")
    for name in ("a", "b"):
        (tmp_path / f"{name}.toml").write_text(CELL.format(name.upper()))
    (tmp_path / "other.toml").write_text("[project]\n")
    (tmp_path / "wrong.toml").write_text("[units.x\n")
    begin = begun(tmp_path)

    def cells() -> Any:
        return asyncio.run(begin.places())["cells"]

    assert cells() == [("a.toml", "A"), ("b.toml", "B")]
    assert read == [("a.toml", False), ("b.toml", False), ("wrong.toml", False)]
    read.clear()
    assert cells() == [("a.toml", "A"), ("b.toml", "B")]
    assert read == []
    (tmp_path / "b.toml").write_text(CELL.format("C"))
    os.utime(tmp_path / "b.toml", ns=(1, 1))
    (tmp_path / "a.toml").unlink()
    assert cells() == [("b.toml", "C")]
    assert read == [("b.toml", False)]


def test_every_motor_fits_every_axis_of_a_new_cell_with_the_supply_that_is_proposed(tmp_path: Path) -> None:
    """A GenStepper board puts its supply through the winding: 24 V would burn each of them."""
    fittings: Any = asyncio.run(begun(tmp_path).fittings())
    assert fittings["uncontrolled"] == ["bs0610", "bs0710"]
    for model, axes in fittings["axes"].items():
        supplies = fittings["direct" if model in fittings["uncontrolled"] else "supplies"]
        for name in fittings["motors"]:
            motors = [NewMotor(unit="unit", axis=axis, motor=name, supply=supplies[name]) for axis in axes]
            text = NewCell(units=[NewUnit(name="unit", model=model)], motors=motors).text()
            assert text.count(name) == len(axes)
