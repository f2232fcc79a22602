"""The calls by which windows open and save files and drafts: within the chosen folder, and nowhere else."""

from collections.abc import Sequence
from typing import Annotated

from pydantic import Field

from detent.workbench.answers import DraftText, Written
from detent.workbench.drafts import LONGEST, Draft, Drafts
from detent.workbench.folder import Folder
from detent.workbench.live import Live

Name = Annotated[str, Field(max_length=1000)]
Text = Annotated[str, Field(max_length=LONGEST)]


def offer(live: Live, folder: Folder, drafts: Drafts) -> None:
    """Offer ``files read_file write_file draft keep_draft forget_draft`` in `live`."""

    async def files(suffixes: Sequence[str] = ()) -> list[str]:
        return folder.names(suffixes)

    async def read_file(name: Name) -> str:
        return folder.read_text(name)

    async def write_file(name: Name, text: Text, known: Text | None = None, over: bool = False) -> Written:
        """Write it, unless a file of that name says something else than `known`: then ask. `over`: write it."""
        if (
            not over
            and (there := folder.content(name)) is not None
            and there not in (text.encode(), (known or "").encode())
        ):
            own = known is not None
            why = (
                "has been changed by somebody else since it was opened"
                if own
                else "is there already, with another text"
            )
            return {"asks": f"{name} {why}: replace it?"}
        folder.write(name, text.encode())
        return {"saved": name}

    async def draft(name: Name) -> DraftText | None:
        found = drafts.get(name)
        return None if found is None else {"text": found.text, "file": found.file}

    async def keep_draft(name: Name, text: Text, file: Name = "") -> None:
        drafts.keep(name, Draft(text, file))

    async def forget_draft(name: Name) -> None:
        drafts.forget(name)

    for call in (files, read_file, write_file, draft, keep_draft, forget_draft):
        live.offer(call.__name__, call)
