"""Drafts: what is being written on a page, kept in a file each until it is saved or thrown away.

A draft outlives the page, the server and the cell. Its file is written whole or not at all, whenever the text
has changed; nothing but `forget` removes it.
"""

import hashlib
import json
import re
from pathlib import Path
from typing import NamedTuple

from detent.outputs.files import write_whole
from detent.realtime.kept import read_kept

LONGEST = 1 << 20  # characters of one draft: no program comes near it
_MOST_BYTES = 12 * LONGEST + 4096  # of its file: a character may be two escapes
_SUFFIX = ".draft.json"


class Draft(NamedTuple):
    """The text as it was left, and the file in the chosen folder that it belongs to ("" if none yet)."""

    text: str
    file: str = ""


class Drafts:
    """The drafts of one cell in `folder`, by unit (or any other name that a page gives them)."""

    def __init__(self, folder: Path, cell: str) -> None:
        """Nothing is made before the first draft is kept. `cell` is `realtime.images.cell_name` of the cell."""
        self._folder, self._cell = folder / "drafts", cell

    def belong_to(self, cell: str) -> None:
        """From now on they are those of another cell, named likewise; those of the one before stay kept."""
        self._cell = cell

    def get(self, name: str) -> Draft | None:
        """The draft of that name; None if there is none, or its file cannot be understood."""
        try:
            kept = json.loads(read_kept(self._path(name), _MOST_BYTES))
            return Draft(str(kept["text"]), str(kept["file"]))
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def keep(self, name: str, draft: Draft) -> None:
        """Keep `draft`, in place of the one before. Raises OSError, ValueError if it is too long."""
        if len(draft.text) > LONGEST:
            raise ValueError(f"a draft of {len(draft.text)} characters is too long; at most {LONGEST} are kept")
        self._folder.mkdir(parents=True, exist_ok=True)
        write_whole(
            self._path(name), json.dumps({"name": name, **draft._asdict()}, ensure_ascii=False).encode(), follow=False
        )

    def forget(self, name: str) -> None:
        """Remove the draft of that name, if there is one. Raises OSError."""
        self._path(name).unlink(missing_ok=True)

    def _path(self, name: str) -> Path:
        safe = re.sub(r"[^A-Za-z0-9_-]", "_", name)[:64]
        if safe != name:  # told apart by digits made of it
            safe += "-" + hashlib.sha256(name.encode()).hexdigest()[:8]
        return self._folder / f"{self._cell}.{safe}{_SUFFIX}"
