"""What a message says that asks for an optional part: the line that installs it, for this kind of installation."""

import json
import sys
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import pytest

from detent import extras


class Installed:
    """A distribution as `importlib.metadata` shows it, with what its installer wrote of where it came from."""

    def __init__(self, origin: object = None) -> None:
        self.origin = origin

    def read_text(self, name: str) -> str | None:
        assert name == "direct_url.json"
        return None if self.origin is None else json.dumps(self.origin)


@pytest.fixture
def prefix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An environment of a wheel, with a pip of its own; tests make it what they need."""
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    monkeypatch.setattr(sys, "executable", str(tmp_path / "bin" / "python"))
    monkeypatch.setattr("importlib.metadata.distribution", lambda name: Installed())
    monkeypatch.setattr(extras, "find_spec", lambda name: object())
    return tmp_path


def test_in_an_environment_its_own_pip_installs(prefix: Path) -> None:
    assert extras.how_to_install("fast") == f"{prefix}/bin/python -m pip install 'detent-motion[fast]'"


def test_where_there_is_no_pip_uv_does(prefix: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    assert extras.how_to_install("fast") == f"uv pip install --python {prefix}/bin/python 'detent-motion[fast]'"


def test_a_tool_of_uv_or_pipx_is_installed_anew_with_the_extras_that_it_has(
    prefix: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    there: set[str] = set()
    monkeypatch.setattr(extras, "installed", there.__contains__)
    (prefix / "pipx_metadata.json").touch()
    assert extras.how_to_install("epics") == "pipx install --force 'detent-motion[epics]'"
    there |= {"workbench", "figures"}
    assert extras.how_to_install("epics") == "pipx install --force 'detent-motion[epics,figures,workbench]'"
    (prefix / "uv-receipt.toml").touch()
    assert extras.how_to_install("epics") == "uv tool install --force 'detent-motion[epics,figures,workbench]'"
    there.clear()
    assert extras.how_to_install() == "uv tool install --force detent-motion"


@pytest.mark.parametrize(
    ("origin", "place"),
    [
        ({"url": "file:///a%20b/x.whl", "archive_info": {"hash": "sha256=0"}}, "file:///a%20b/x.whl"),
        ({"url": "file:///sources", "dir_info": {}}, "file:///sources"),
        (
            {"url": "https://example.org/detent", "vcs_info": {"vcs": "git", "commit_id": "0a1b"}},
            "git+https://example.org/detent@0a1b",
        ),
    ],
)
def test_a_tool_that_came_from_elsewhere_is_installed_from_there(
    origin: object, place: str, prefix: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An index may have no such distribution, or somebody else's."""
    monkeypatch.setattr(extras, "installed", lambda name: False)
    monkeypatch.setattr("importlib.metadata.distribution", lambda name: Installed(origin))
    assert extras.how_to_install("fast").endswith("-m pip install 'detent-motion[fast]'")  # what is there stays
    (prefix / "pipx_metadata.json").touch()
    assert extras.how_to_install("fast") == f"pipx install --force 'detent-motion[fast] @ {place}'"
    (prefix / "uv-receipt.toml").touch()
    assert extras.how_to_install("fast") == f"uv tool install --force 'detent-motion[fast] @ {place}'"
    assert extras.how_to_install() == f"uv tool install --force 'detent-motion @ {place}'"


def test_a_checkout_is_set_up_again(prefix: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sources = prefix / "with a blank"
    sources.mkdir()
    told = {"url": sources.as_uri(), "dir_info": {"editable": True}}
    monkeypatch.setattr("importlib.metadata.distribution", lambda name: Installed(told))
    assert extras.how_to_install("workbench") == f"{prefix}/bin/python -m pip install -e '{sources}[workbench]'"
    (sources / "Makefile").touch()
    assert extras.how_to_install("workbench") == f"make -B -C '{sources}' setup"


def test_sources_on_the_path_alone_take_the_distribution(prefix: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> Installed:
        raise PackageNotFoundError(name)

    monkeypatch.setattr("importlib.metadata.distribution", absent)
    assert extras.how_to_install().endswith("pip install detent-motion")


@pytest.mark.parametrize("extra", sorted(extras.EXTRAS))
def test_a_missing_part_is_named_with_its_remedy(extra: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, extras.EXTRAS[extra], None)
    assert not extras.installed(extra)
    with pytest.raises(extras.MissingExtra, match=f"figures need {extras.EXTRAS[extra]}, which is not installed: "):
        extras.need(extra, "figures need")


def test_every_extra_for_users_is_known_and_no_other() -> None:
    import tomllib

    declared = tomllib.loads(Path("pyproject.toml").read_text())["project"]["optional-dependencies"]
    assert set(extras.EXTRAS) == set(declared) - {"dev"}


def test_nothing_tells_to_install_the_distribution_of_somebody_else() -> None:
    """`detent` on the package index is another program."""
    wrong = ("pip install " + "detent", "pip install 'detent[", "tool install " + "detent", "pipx install " + "detent")
    found = []
    for folder in ("src", "docs", "examples", "tests", "bench", ".ci"):
        paths = [path for path in Path(folder).rglob("*") if path.suffix in (".py", ".md", ".toml", ".js", ".txt")]
        for path in [*paths, *Path().glob("*.md"), Path("Makefile"), Path("pyproject.toml")]:
            text = path.read_text(encoding="utf-8").replace("detent-motion", "")
            found += [f"{path}: {line}" for line in text.splitlines() if any(words in line for words in wrong)]
    assert [line for line in found if not line.startswith("tests/test_extras.py")] == []
