"""The optional parts of Detent: what each needs, and the line that installs it where Detent runs.

The distribution is called `detent-motion`; import and command are `detent`. How a part is added depends on how Detent
itself was installed, so every message that asks for one is made here.
"""

import sys
from importlib.util import find_spec
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path
    from typing import Any

DISTRIBUTION = "detent-motion"

EXTRAS = {
    "distributed": "distributed", "epics": "caproto", "fast": "numba", "figures": "matplotlib", "workbench": "nicegui",
}  # fmt: skip
"""Each extra, and the module that is there when it is installed."""


class MissingExtra(ImportError):
    """An optional part is needed and is not installed; the message has the line that installs it."""

    def __init__(self, extra: str, what: str) -> None:
        """`what` needs it: the beginning of a sentence, "figures need"."""
        super().__init__(f"{what} {EXTRAS[extra]}, which is not installed: {how_to_install(extra)}")


def installed(extra: str) -> bool:
    """Whether the module of an extra can be imported; it is not imported."""
    module = EXTRAS[extra]
    if module in sys.modules:  # None stands there for one that must not be imported
        return sys.modules[module] is not None
    return find_spec(module) is not None


def need(extra: str, what: str) -> None:
    """Raise MissingExtra unless the module of `extra` can be imported. `what` needs it: "figures need"."""
    if not installed(extra):
        raise MissingExtra(extra, what)


def how_to_install(extra: str = "") -> str:
    """The command that adds `extra` to this installation, or repairs it: a checkout, uv tool, pipx, an environment.

    A tool is installed anew as a whole, so the extras that it has are named again, and the place that it came from: the
    package index may not have it, or have another version.
    """
    import shlex  # these take longer to load than most of what Detent needs at every start
    from pathlib import Path

    wanted = f"'{DISTRIBUTION}[{extra}]'" if extra else DISTRIBUTION
    prefix = Path(sys.prefix)
    origin = _origin()
    sources = _folder(origin) if origin.get("dir_info", {}).get("editable") else None
    if sources is not None and (sources / "Makefile").is_file():
        return f"make -B -C {shlex.quote(str(sources))} setup"
    if sources is not None:
        return f"{_pip()} -e '{sources}[{extra}]'" if extra else f"{_pip()} -e {sources}"
    whole = ",".join(sorted({name for name in EXTRAS if installed(name)} | ({extra} if extra else set())))
    tool = (f"{DISTRIBUTION}[{whole}]" if whole else DISTRIBUTION) + _from_there(origin)
    if (prefix / "uv-receipt.toml").is_file():
        return f"uv tool install --force {shlex.quote(tool)}"
    if (prefix / "pipx_metadata.json").is_file():
        return f"pipx install --force {shlex.quote(tool)}"
    return f"{_pip()} {wanted}"


def _pip() -> str:
    """What installs into the environment that runs: its own pip, or uv where it has none."""
    return f"{sys.executable} -m pip install" if find_spec("pip") else f"uv pip install --python {sys.executable}"


def _origin() -> "dict[str, Any]":
    """Where Detent was installed from, as installers write it down (`direct_url.json`); nothing: from an index."""
    import json
    from importlib.metadata import PackageNotFoundError, distribution

    try:
        told: dict[str, Any] = json.loads(distribution(DISTRIBUTION).read_text("direct_url.json") or "{}")
    except PackageNotFoundError:
        return {}
    return told


def _folder(origin: "dict[str, Any]") -> "Path":
    """The folder of the sources, where Detent was installed from one."""
    from pathlib import Path
    from urllib.parse import urlsplit
    from urllib.request import url2pathname

    return Path(url2pathname(urlsplit(origin["url"]).path))


def _from_there(origin: "dict[str, Any]") -> str:
    """What a requirement says of its place: a file, a folder, a repository at the commit that is installed."""
    if not origin:
        return ""
    version = origin.get("vcs_info")
    return f" @ {version['vcs']}+{origin['url']}@{version['commit_id']}" if version else f" @ {origin['url']}"
