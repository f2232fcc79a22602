"""The calls that windows make, as types for the scripts: from the annotations by which the server checks them.

``python -m tests.workbench.page_types`` writes them anew; `test_page_types` fails where that was forgotten.
"""

import asyncio
import inspect
import types
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints, is_typeddict
from unittest.mock import MagicMock

from pydantic import BaseModel

from detent.workbench import filing
from detent.workbench.beginning import Beginning
from detent.workbench.board import Board
from detent.workbench.live import Live
from detent.workbench.stopping import Stopping
from detent.workbench.units.registry import Units

FILE = Path(__file__).parent / "scripts" / "calls.d.ts"
HEAD = (
    "// What windows may call, and what they are answered with. Made by tests/workbench/page_types.py: do not edit.\n"
)
PLAIN: dict[object, str] = {
    str: "string", int: "number", float: "number", bool: "boolean", type(None): "null", object: "unknown", Any: "any",
}  # fmt: skip


class Offered(Live):
    """A table that keeps what is offered, and calls nothing."""

    def __init__(self) -> None:
        super().__init__()
        self.calls: dict[str, Callable[..., Any]] = {}

    def offer(self, name: str, call: Callable[..., Any], *, moves: str = "", stops: bool = False) -> None:
        self.calls[name] = call


async def offered() -> dict[str, Callable[..., Any]]:
    """Every call of the workbench, by its name; in a loop, as some begin to listen."""
    from detent.workbench.server import PAGES  # takes a second

    live, bench, any_ = Offered(), MagicMock(), MagicMock()
    Units(live, Stopping(live), any_, Path())
    Board(bench, live)
    filing.offer(live, any_, any_)
    Beginning(bench, live, any_, any_)
    for page in PAGES:
        if page.offer is not None:
            page.offer(any_, bench, live)
    return live.calls


class Types:
    """Types of Python as TypeScript; those with keys become interfaces."""

    def __init__(self) -> None:
        self.interfaces: dict[str, str] = {}

    def of(self, kind: Any) -> str:
        """The type of `kind` as JSON has it. TypeError for what has none."""
        origin, arguments = get_origin(kind), get_args(kind)
        if kind in PLAIN:
            return PLAIN[kind]
        if origin is Annotated:
            return self.of(arguments[0])
        if origin is Literal:
            return " | ".join(f'"{one}"' if isinstance(one, str) else str(one) for one in arguments)
        if origin in (Union, types.UnionType):
            return " | ".join(dict.fromkeys(self.of(one) for one in arguments))
        if origin is tuple and arguments[-1] is not Ellipsis:
            return f"[{', '.join(self.of(one) for one in arguments)}]"
        if origin in (list, tuple) or (inspect.isclass(origin) and issubclass(origin, Sequence)):
            return f"{self._bracketed(arguments[0])}[]"
        if inspect.isclass(origin) and issubclass(origin, Mapping):
            return f"Record<string, {self.of(arguments[1])}>"
        if is_typeddict(kind):
            hints = get_type_hints(kind).items()
            return self._interface(kind, {name: (one, name in kind.__required_keys__) for name, one in hints})
        if inspect.isclass(kind) and issubclass(kind, BaseModel):
            return self._interface(
                kind, {name: (one.annotation, one.is_required()) for name, one in kind.model_fields.items()}
            )
        raise TypeError(f"{kind!r} does not go to a window: give the answer a type with keys")

    def _bracketed(self, kind: Any) -> str:
        inner = self.of(kind)
        return f"({inner})" if " | " in inner else inner

    def _interface(self, kind: type, keys: Mapping[str, tuple[Any, bool]]) -> str:
        if kind.__name__ not in self.interfaces:
            self.interfaces[kind.__name__] = ""  # its place, before those that it names
            lines = (f"  {name}{'' if needed else '?'}: {self.of(one)};\n" for name, (one, needed) in keys.items())
            summary = inspect.cleandoc(kind.__doc__ or "").split("\n\n")[0].replace("\n", " ")
            self.interfaces[kind.__name__] = f"/** {summary} */\ninterface {kind.__name__} {{\n{''.join(lines)}}}\n"
        return kind.__name__

    def call(self, function: Callable[..., Any]) -> str:
        """The type of a call: its arguments in their order, and its answer."""
        hints = get_type_hints(function, include_extras=True)
        arguments = [
            f"{name}{'?' if one.default is not one.empty else ''}: {self.of(hints[name])}"
            for name, one in inspect.signature(function).parameters.items()
        ]
        return f"({', '.join(arguments)}) => {self.of(hints['return'])}"


def text() -> str:
    """The whole file."""
    kinds = Types()
    calls = "".join(f"  {name}: {kinds.call(one)};\n" for name, one in sorted(asyncio.run(offered()).items()))
    return "\n".join([HEAD, *kinds.interfaces.values(), f"interface Calls {{\n{calls}}}\n"])


if __name__ == "__main__":
    FILE.write_text(text())
