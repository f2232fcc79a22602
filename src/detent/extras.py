"""The optional parts of Detent: what each needs, and the line that installs it where Detent runs.

The distribution is called `detent-motion`; import and command are `detent`. How a part is added depends on how Detent
itself was installed, so every message that asks for one is made here.
"""

import sys
from importlib.util import find_spec
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

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

    A tool is installed anew as a whole, so the extras that it has are named again.
    """
    import shlex  # these take longer to load than most of what Detent needs at every start
    from pathlib import Path

    wanted = f"'{DISTRIBUTION}[{extra}]'" if extra else DISTRIBUTION
    prefix = Path(sys.prefix)
    sources = _sources()
    if sources is not None and (sources / "Makefile").is_file():
        return f"make -B -C {shlex.quote(str(sources))} setup"
    if sources is not None:
        return f"{_pip()} -e '{sources}[{extra}]'" if extra else f"{_pip()} -e {sources}"
    whole = ",".join(sorted({name for name in EXTRAS if installed(name)} | ({extra} if extra else set())))
    tool = f"'{DISTRIBUTION}[{whole}]'" if whole else DISTRIBUTION
    if (prefix / "uv-receipt.toml").is_file():
        return f"uv tool install --force {tool}"
    if (prefix / "pipx_metadata.json").is_file():
        return f"pipx install --force {tool}"
    return f"{_pip()} {wanted}"


def _pip() -> str:
    """What installs into the environment that runs: its own pip, or uv where it has none."""
    return f"{sys.executable} -m pip install" if find_spec("pip") else f"uv pip install --python {sys.executable}"


def _sources() -> "Path | None":
    """The folder of the sources, where Detent is installed from one that can be edited."""
    import json
    from importlib.metadata import PackageNotFoundError, distribution
    from pathlib import Path
    from urllib.parse import urlsplit
    from urllib.request import url2pathname

    try:
        told = json.loads(distribution(DISTRIBUTION).read_text("direct_url.json") or "{}")
    except PackageNotFoundError:
        return None
    if not told.get("dir_info", {}).get("editable"):
        return None
    return Path(url2pathname(urlsplit(told["url"]).path))
