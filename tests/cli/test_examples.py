"""The verbs `examples` and `demo`: every example by name, and copies to work on."""

import json
from pathlib import Path

import pytest

from detent.cli import main
from detent.cli.examples import home, names, title


def detent(*tokens: object, status: int = 0) -> None:
    with pytest.raises(SystemExit) as caught:
        main([str(token) for token in tokens])
    assert (caught.value.code or 0) == status


def test_every_example_with_a_cell_is_listed_with_what_it_shows(capsys: pytest.CaptureFixture[str]) -> None:
    detent("examples")
    out = capsys.readouterr().out
    assert {file.parent.name for file in home().glob("*/cell.toml")} == set(names())
    assert all(f"{name} " in out and title(name) in out for name in names())
    detent("examples", "--json")
    assert set(json.loads(capsys.readouterr().out)["examples"]) == set(names())


@pytest.mark.parametrize("name", names())
def test_every_example_is_a_demo(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    detent("demo", name, "--output", tmp_path / "out", "--json")
    told = json.loads(capsys.readouterr().out)
    assert told["demo"] == name
    assert (tmp_path / "out" / f"{name}.png").stat().st_size > 5_000
    assert (tmp_path / "out" / f"{name}.vcd").stat().st_size > 100


def test_a_copy_is_one_s_own_and_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "mine"
    detent("examples", "copy", "menu", folder, "--json")
    told = json.loads(capsys.readouterr().out)
    assert told["files"] == ["cell.toml", "menu.gsc"]
    assert (folder / "menu.gsc").read_text() == (home() / "menu" / "menu.gsc").read_text()
    detent("run", folder / "cell.toml", "--for", "1 s")
    detent("examples", "copy", "menu", folder, status=2)
    assert "is there" in capsys.readouterr().err
    detent("examples", "copy", "menu", folder / "menu.gsc" / "in a file", status=1)
    assert "not written" in capsys.readouterr().err
