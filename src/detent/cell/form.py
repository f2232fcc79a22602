"""Whether a cell file has the right form: known keys, kinds of values, bounds. Each fault is a key and what to do."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from reprlib import Repr
from typing import Annotated, Any, TypeVar, cast, get_args, get_origin, get_type_hints

from pydantic import AliasChoices, BaseModel, BeforeValidator, Field, TypeAdapter, ValidationError

from detent.cell import fields as kinds
from detent.cell import hardware, tables
from detent.nearest import did_you_mean

_TRIED = ("[key]", "constrained-int", "constrained-float", "int", "float", "str")  # no keys, but what was tried
_WANTED = {  # pydantic's kinds of faults, in words of a cell file
    "model_type": "a table", "model_attributes_type": "a table", "dict_type": "a table", "dataclass_type": "a table",
    "int_type": "a whole number", "int_parsing": "a whole number", "int_from_float": "a whole number",
    "float_type": "a number", "float_parsing": "a number", "string_type": "text in quotes", "list_type": "a list",
    "bool_type": "true or false", "bool_parsing": "true or false",
}  # fmt: skip
_BARE = re.compile(r"[A-Za-z0-9_.$ -]{1,64}")
_NAMES = {**vars(kinds), **vars(tables), **vars(hardware), "Annotated": Annotated, "BeforeValidator": BeforeValidator}

_adapters: dict[type[Any], TypeAdapter[Any]] = {}
_shown = Repr()
_shown.maxstring = _shown.maxother = _shown.maxlong = 60

Kind = TypeVar("Kind")


class FormError(ValueError):
    """The faults of a file, one or more: (key, what is wrong and what to do)."""

    def __init__(self, faults: Sequence[tuple[str, str]]) -> None:
        super().__init__("; ".join(f"{key}: {message}" for key, message in faults))
        self.faults = faults


def check(kind: type[Kind], data: Mapping[str, Any]) -> Kind:
    """A value of `kind` (a description, or a table of one) from what TOML gives. Raises FormError."""
    try:
        return adapter(kind).validate_python(data)
    except ValidationError as error:
        # of a key, the last is enough
        raise FormError(list(dict([_fault(kind, item) for item in error.errors()]).items())) from None


def keys(table: type[Any]) -> dict[str, str]:
    """The keys of a table of a file as they are written, each with the name of its field."""
    if is_dataclass(table):
        return {each.name: each.name for each in fields(table) if each.name != "file"}
    found = {}
    for name, field in cast("type[BaseModel]", table).model_fields.items():
        alias = field.validation_alias
        found[str(alias.choices[0]) if isinstance(alias, AliasChoices) else name] = name
    return found


def adapter(kind: type[Kind]) -> TypeAdapter[Kind]:
    """What checks values of `kind`, made once. Its fields may name kinds of values without importing them."""
    made = _adapters.get(kind)
    if made is None:
        made = TypeAdapter(kind)
        made.rebuild(_types_namespace=_NAMES)
        _adapters[kind] = made  # not before it is ready: another thread may read a file meanwhile
    return made


def hints(table: type[Any]) -> dict[str, Any]:
    """What the fields of a table take, as `typing` has it, with what is asked of them beyond."""
    found = get_type_hints(table, localns=_NAMES, include_extras=True)
    if is_dataclass(table):
        return found
    for name, field in cast("type[BaseModel]", table).model_fields.items():
        if field.metadata and get_origin(found[name]) is not Annotated:  # bounds that stand with the default
            found[name] = Annotated[found[name], Field(**_limits(field.metadata))]
    return found


def _limits(metadata: Sequence[object]) -> dict[str, Any]:
    return {
        name: value
        for one in metadata
        for name in ("gt", "ge", "lt", "le")
        if (value := getattr(one, name, None)) is not None
    }


def _tables(kind: type[Any]) -> dict[str, type[Any]]:
    """The tables of a file by key, each with what its entries are."""
    found = {}
    for key, hint in get_type_hints(kind, localns=_NAMES).items():
        if (inner := get_args(hint)) and isinstance(inner[-1], type):
            found[key] = inner[-1]
    return found


def _fault(kind: type[Any], item: Any) -> tuple[str, str]:
    """The key and the message of one of pydantic's errors."""
    path: list[str] = []
    for part in item["loc"]:
        if part in _TRIED or (isinstance(part, str) and part.startswith("function-") and part.endswith("]")):
            continue
        if isinstance(part, int):
            path[-1] += f"[{part + 1}]"
        else:
            path.append(part if _BARE.fullmatch(part) else _shown.repr(part))
    key = ".".join(path)
    if item["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        table = _tables(kind).get(str(item["loc"][0]), kind) if len(item["loc"]) > 1 else kind
        known = list(keys(table))
        hint = did_you_mean(str(item["loc"][-1]), known)
        return key, f"there is no such key; {hint}there are: {', '.join(known)}"
    if item["type"] == "missing":
        return key, "this key is missing"
    cause = item.get("ctx", {}).get("error")
    if isinstance(cause, kinds.KeyFault):
        return f"{key}.{cause.key}", str(cause)
    wanted = _WANTED.get(item["type"])
    message = item["msg"].removeprefix("Value error, ").replace("Input should", "it should")
    message = message if wanted is None else f"it should be {wanted}"
    return key, f"{message} (it is {_shown.repr(item['input'])})" if not isinstance(item["input"], dict) else message
