"""The reference of cell files: every key with what it takes, its default and its meaning, read from what checks them.

The meaning of a key is the text behind it in the class of its table.
"""

import ast
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from inspect import cleandoc, getsource
from textwrap import dedent
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from detent.cell import fields as kinds
from detent.cell import form, hardware, tables
from detent.cell.description import Description, Unit
from detent.ticks import show_duration

TABLES: Mapping[str, type[Any]] = {
    "the file": Description, "units": Unit, "wires": tables.Wire, "switches": tables.Switch, "motors": tables.Motor,
    "current": tables.Current, "lines": tables.Line, "script": tables.ScriptEntry, "boards": hardware.Board,
    "hardware": hardware.Hardware, "driver": hardware.Driver,
}  # fmt: skip
"""The tables by the names that their parts of the page have."""

WORDS: Mapping[Any, str] = {
    kinds.LevelField: "a level", kinds.DurationField: "a time", kinds.Names: "text, or a list",
    hardware.InputPin: "a pin of a board", hardware.OutputPin: "a pin of a board",
    hardware.ErrorField: "`exact`, or a time",
    str: "text", bool: "true, false", int: "a whole number", float: "a number",
}  # fmt: skip
BOUNDS: Mapping[str, str] = {"gt": "above {}", "ge": "at least {}", "lt": "below {}", "le": "at most {}"}


def rows(table: type[Any]) -> list[tuple[str, str, str, str]]:
    """Key, what it takes, default, meaning: of every key, in their order. KeyError for one whose meaning is missing."""
    meaning, hints, defaults = _meanings(table), form.hints(table), _defaults(table)
    return [
        (f"`{key}`", takes(hints[name]), _shown(hints[name], defaults[name]), meaning[name])
        for key, name in form.keys(table).items()
    ]


def takes(hint: Any) -> str:
    """The values that a key takes, in words."""
    if hint in WORDS:
        return WORDS[hint]
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return takes(inner[0]) + _bounds(inner[1:])
    if origin is Literal:
        return ", ".join(f"`{word}`" for word in inner if word != "")
    if origin in (Union, UnionType):
        words = dict.fromkeys(takes(one) for one in inner if one is not NoneType)
        if "a number" in words:
            words.pop("a whole number", None)
        return ", or ".join(words)
    if origin is dict:
        return _mapping(*inner)
    if origin is list:
        return "tables" if _is_table(inner[0]) else f"a list of {takes(inner[0])}"
    if origin is tuple:
        return f"[{', '.join(takes(one) for one in inner)}]"
    assert _is_table(hint), hint
    return "a table"


def _mapping(key: Any, value: Any) -> str:
    if _is_table(value):
        return "tables"
    if get_origin(key) is Literal:
        return f"{takes(key)} = {takes(value)}"
    return f"NAME = {takes(value)}"


def _is_table(kind: Any) -> bool:
    return isinstance(kind, type) and (is_dataclass(kind) or issubclass(kind, BaseModel))


def _bounds(metadata: tuple[Any, ...]) -> str:
    """What is said of a number beyond the bounds that every number has."""
    found: dict[str, float] = {}
    for field in metadata:
        for one in field.metadata if isinstance(field, FieldInfo) else ():
            for name in BOUNDS:
                limit = getattr(one, name, None)
                if isinstance(limit, int | float) and abs(limit) != kinds.MOST_STEPS:
                    found[name] = limit
    if found.keys() == {"ge", "le"}:
        return f", {found['ge']:g} to {found['le']:g}"
    return "".join(f", {BOUNDS[name].format(f'{limit:g}')}" for name, limit in found.items())


def _defaults(table: type[Any]) -> dict[str, Any]:
    """The defaults by the names of the fields; `MISSING` where one has to be given."""
    if is_dataclass(table):
        return {
            field.name: field.default_factory() if field.default_factory is not MISSING else field.default
            for field in fields(table)
        }
    given = {name: field.get_default(call_default_factory=True) for name, field in table.model_fields.items()}
    return {name: MISSING if value is PydanticUndefined else value for name, value in given.items()}


def _shown(hint: Any, default: Any) -> str:
    if default is MISSING:
        return "required"
    if default in (None, "", [], {}) and not isinstance(default, bool | int):
        return ""
    if "a time" in takes(hint) and isinstance(default, int):
        return show_duration(default) if default else "0"
    return f"{default:g}" if isinstance(default, float) else str(default).lower()


def _meanings(table: type[Any]) -> dict[str, str]:
    """The text behind each field."""
    (made,) = ast.parse(dedent(getsource(table))).body
    assert isinstance(made, ast.ClassDef)
    found = {}
    for field, behind in zip(made.body, made.body[1:], strict=False):
        if not (isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)):
            continue
        if isinstance(behind, ast.Expr) and isinstance(behind.value, ast.Constant):
            found[field.target.id] = " ".join(cleandoc(str(behind.value.value)).split()).removesuffix(".")
    return found
