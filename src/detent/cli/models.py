"""The verb `models`: what controllers there are, and everything their tables say."""

import json as json_text
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from detent.controllers.catalogue import Model


def models(model: str | None = None, *, json: bool = False, markdown: bool = False) -> None:
    """List the controllers, or show one with all its tables.

    The tables are its pins, straps, options and commands.

    For example: `detent models gs-c200`

    Parameters
    ----------
    model
        A controller by name; all of them without it.
    json
        Print everything as JSON.
    markdown
        Print the tables in Markdown, as the reference pages have them.
    """
    from detent.cli.endings import asked_wrongly
    from detent.controllers import catalogue

    if model is None:
        found = list(catalogue.MODELS.values())
        if json:
            print(json_text.dumps([{"model": m.name, "title": m.title} for m in found], indent=2))
        else:
            width = max(len(m.name) for m in found)
            for m in found:
                print(f"{m.name:{width}}  {m.title}")
            print(f"\nMore about one: detent models {found[0].name}    Connect to it: detent serve {found[0].name}")
        return
    try:
        one = catalogue.model(model)
    except catalogue.CatalogueError as error:
        asked_wrongly(error)
    if json:
        print(json_text.dumps({"model": one.name, "title": one.title, **_tables(one)}, indent=2))
    elif markdown:
        print(reference(one), end="")
    else:
        _print_tables(one)


Rows = list[dict[str, Any]]


def _tables(model: "Model") -> dict[str, Rows]:
    """The model's tables: rows of named columns, everything as it is printed."""
    levels = {0: "low", 1: "open"}
    return {
        "pins": [
            {"pin": pin.name, "number": pin.number, "kind": pin.kind.value, "what": pin.help} for pin in model.pins
        ],
        "straps": [{"strap": name, "default": levels[level]} for name, level in model.straps.items()],
        "options": [{"option": o.name, "takes": o.takes, "default": o.default, "what": o.help} for o in model.options],
        "commands": [row._asdict() for row in model.commands()],
    }


def reference(model: "Model") -> str:
    """The tables in Markdown."""
    text = []
    for title, rows in _tables(model).items():
        if not rows:
            continue
        columns = list(rows[0])
        text.append(f"### {title.capitalize()} of the {model.name.upper()}\n")
        text.append("| " + " | ".join(columns) + " |")
        text.append("|" + " --- |" * len(columns))
        for row in rows:
            cells = ["" if row[c] is None else str(row[c]).replace("|", "\\|") for c in columns]
            text.append("| " + " | ".join(f"`{cells[0]}`" if n == 0 else cell for n, cell in enumerate(cells)) + " |")
        text.append("")
    return "\n".join(text) + "\n"


def _print_tables(model: "Model") -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console()
    console.print(f"[bold]{model.name}[/bold]  {model.title}", highlight=False)
    for title, rows in _tables(model).items():
        if not rows:
            continue
        table = Table(title=title.capitalize(), title_justify="left", box=None, pad_edge=False, header_style="dim")
        columns = [c for c in rows[0] if c != "section" and any(row[c] not in (None, 0) for row in rows)]
        for column in columns:
            table.add_column(column, overflow="fold")
        for row in rows:
            table.add_row(*("" if row[c] is None else str(row[c]) for c in columns))
        console.print()
        console.print(table)
