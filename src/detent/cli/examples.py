"""The verb `examples`: what examples there are, and a copy of one to work on."""

import json as json_text
import tomllib
from pathlib import Path
from typing import Literal

from detent.realtime.examples import home


def examples(
    do: Literal["list", "copy"] = "list", name: str | None = None, folder: Path | None = None, *, json: bool = False
) -> None:
    """List the examples, or copy one into a folder of yours.

    `detent demo NAME` runs one and draws it; the files of a copy can be run, served and changed.

    For example: `detent examples copy drilling mine`

    Parameters
    ----------
    do
        list, or copy with a NAME.
    name
        Which example.
    folder
        Where the copy goes, a new folder; NAME in this one without it.
    json
        Print the result as JSON.
    """
    from detent.cli.endings import asked_wrongly

    if do == "list":
        if name is not None:
            asked_wrongly(f"the list takes no name; did you mean detent examples copy {name}?")
        _list(json)
        return
    if name is None:
        asked_wrongly(f"say which: detent examples copy NAME; there are: {', '.join(names())}")
    _copy(place(name), folder if folder is not None else Path(name), json)


def names() -> list[str]:
    """The examples that are cells, by name."""
    return sorted(file.parent.name for file in home().glob("*/cell.toml"))


def place(name: str) -> Path:
    """The folder of an example. Ends the program if there is none."""
    from detent.cli.endings import asked_wrongly
    from detent.controllers.catalogue import unknown

    if name not in names():
        asked_wrongly(unknown("example", name, tuple(names())))
    return home() / name


def title(name: str) -> str:
    """What an example shows."""
    return str(tomllib.loads((home() / name / "cell.toml").read_text(encoding="utf-8")).get("title", ""))


def _list(json: bool) -> None:
    if json:
        print(json_text.dumps({"examples": {name: title(name) for name in names()}}))
        return
    width = max(map(len, names()))
    for name in names():
        print(f"{name:{width}}  {title(name)}")
    print("\nRun and draw one: detent demo NAME    Work on a copy: detent examples copy NAME")


def _copy(source: Path, folder: Path, json: bool) -> None:
    """Copy an example, whole or not at all, never over anything."""
    import shutil

    from detent.cli.endings import asked_wrongly, failed

    if folder.exists() or folder.is_symlink():
        asked_wrongly(f"{folder} is there: name a folder that is not")
    new = folder.with_name(f".{folder.name}.new")
    try:
        shutil.copytree(source, new, ignore=shutil.ignore_patterns("__pycache__", "*.eeprom"))
        new.rename(folder)
    except OSError as error:
        shutil.rmtree(new, ignore_errors=True)
        failed(f"{folder}: not written: {error.strerror or error}")
    files = sorted(file.relative_to(folder).as_posix() for file in folder.rglob("*") if file.is_file())
    if json:
        print(json_text.dumps({"example": source.name, "folder": str(folder), "files": files}))
        return
    print(f"Copied {', '.join(files)} to {folder}")
    print(f"    detent run {folder / 'cell.toml'}")
