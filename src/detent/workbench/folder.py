"""The chosen folder: the only place whose files the workbench opens and saves on behalf of a browser.

Names are relative to it. A name that leads out of it, by ``..``, by being absolute or through a symbolic link,
is refused before anything is opened.
"""

from collections.abc import Collection, Iterator
from pathlib import Path

from detent.outputs.files import write_whole

LARGEST = 16 << 20  # bytes of a file that is opened
MOST_FILES = 500  # listed
DEEPEST = 4  # folders below the chosen one


class OutsideFolder(ValueError):
    """A name that is no file within the chosen folder. The text says why."""


class Folder:
    """The files within `root`, by names relative to it."""

    def __init__(self, root: Path) -> None:
        """Raises OutsideFolder if `root` is no folder."""
        self.root = root.resolve()
        if not self.root.is_dir():
            raise OutsideFolder(f"{root} is no folder; choose one that exists")

    def path(self, name: str) -> Path:
        """Where the file `name` really is, links followed. Raises OutsideFolder."""
        if not name or "\0" in name or "\\" in name or Path(name).is_absolute() or ".." in Path(name).parts:
            raise OutsideFolder(f"{name!r} is no name of a file in {self.root}; write it relative to that folder")
        found = (self.root / name).resolve()
        if found == self.root or not found.is_relative_to(self.root):
            raise OutsideFolder(f"{name!r} leads out of {self.root}; choose a file within it")
        if any(part.startswith(".") for part in found.relative_to(self.root).parts):
            raise OutsideFolder(f"{name!r} is hidden; choose a name that does not begin with a dot")
        return found

    def names(self, suffixes: Collection[str] = ()) -> list[str]:
        """The files there and in the folders below, sorted; only those with one of `suffixes` (".gsc"), if given."""
        return sorted(self._below(self.root, suffixes, DEEPEST))[:MOST_FILES]

    def read(self, name: str) -> bytes:
        """The content of a file. Raises OutsideFolder, OSError; ValueError if it is too large."""
        path = self.path(name)
        if not path.is_file():
            raise FileNotFoundError(f"{name}: there is no such file in {self.root}")
        if path.stat().st_size > LARGEST:
            raise ValueError(f"{name} has more than {LARGEST >> 20} MiB: that is no file for the workbench")
        return path.read_bytes()

    def content(self, name: str) -> bytes | None:
        """What is in a file, of a very long one how it begins; None if there is none. Raises OutsideFolder, OSError."""
        path = self.path(name)
        if not path.is_file():
            return None
        with path.open("rb") as file:
            return file.read(LARGEST + 1)

    def read_text(self, name: str) -> str:
        """The text of a file. Raises as `read`; ValueError if it is no text."""
        try:
            return self.read(name).decode("utf-8")
        except UnicodeDecodeError:
            raise ValueError(f"{name} is no text file") from None

    def write(self, name: str, data: bytes) -> Path:
        """Make `data` the content of a file, whole or not at all. Raises OutsideFolder, OSError."""
        path = self.path(name)
        if path.is_dir():
            raise OutsideFolder(f"{name!r} is a folder; give the file another name")
        if path.exists() and not path.is_file():
            raise OutsideFolder(f"{name!r} is a pipe or a device; give the file another name")
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, data)
        return path

    def _below(self, folder: Path, suffixes: Collection[str], deeper: int) -> Iterator[str]:
        try:
            entries = list(folder.iterdir())
        except OSError:
            return
        for entry in entries:
            if entry.name.startswith(".") or entry.is_symlink():
                continue
            if entry.is_dir() and deeper > 0:
                yield from self._below(entry, suffixes, deeper - 1)
            elif entry.is_file() and (not suffixes or entry.suffix in suffixes):
                yield str(entry.relative_to(self.root))
