"""`detent docs` leads to the pages, or says how to build them."""

import json
from pathlib import Path

import pytest

from detent.cli import docs as verb
from detent.cli import main


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A place that the verb takes for the project that it is in."""
    monkeypatch.setattr(verb, "__file__", str(tmp_path / "src" / "detent" / "cli" / "docs.py"))
    return tmp_path


def said(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as ended:
        main(["docs", *words])
    out, err = capsys.readouterr()
    return int(ended.value.code or 0), out, err


def test_the_site_that_was_built_is_opened(
    project: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    site = project / "docs" / "_build" / "html" / "index.html"
    site.parent.mkdir(parents=True)
    site.touch()
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    assert said(capsys) == (0, f"{site.as_uri()}\n", "")
    assert opened == [site.as_uri()]
    status, out, _ = said(capsys, "--json")
    assert (status, json.loads(out), len(opened)) == (0, {"docs": site.as_uri()}, 1)


def test_a_checkout_whose_pages_are_not_built_says_how(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (project / "docs").mkdir()
    (project / "docs" / "conf.py").touch()
    status, out, err = said(capsys)
    assert (status, out) == (1, "")
    assert f"make -C {project} docs" in err


def test_elsewhere_the_pages_lie_in_the_package(
    project: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    index = project / "src" / "detent" / "docs" / "index.md"
    status, out, err = said(capsys)
    assert (status, out, err.count("\n")) == (1, "", 1)
    assert str(index.parent) in err
    index.parent.mkdir(parents=True)
    index.touch()
    assert said(capsys) == (0, f"Read {index}\n", "")
    status, out, _ = said(capsys, "--json")
    assert (status, json.loads(out), opened) == (0, {"docs": index.as_uri()}, [])
