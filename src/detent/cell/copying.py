"""Deep copies of cells: what `copy.deepcopy` makes, in a third of its time.

A copy is mostly names, numbers and levels, for each of which `deepcopy` is called; here they are seen where they
stand. Whatever is made in a way of its own is left to `deepcopy`, with the same memo.
"""

from collections import deque
from collections.abc import Callable, Sequence
from copy import deepcopy
from enum import Enum
from types import BuiltinFunctionType, FunctionType, MethodType, NoneType
from typing import Any, Final, TypeAlias, TypeVar

T = TypeVar("T")

Memo: TypeAlias = dict[int, Any]
"""The copy of each thing, by the `id` of that: as `deepcopy` keeps it."""

_SAME: Final[set[type]] = {int, str, bool, NoneType, float, bytes, complex, FunctionType, BuiltinFunctionType, range}
"""Kinds of things that never change and hold nothing that does."""

_HOW: Final[dict[type, Callable[[Any, Memo], Any]]] = {}
"""How a thing of a kind is copied; found once for each."""

_OWN_WAYS: Final = ("__deepcopy__", "__copy__", "__getnewargs__", "__getnewargs_ex__", "__setstate__")
_AS_ANY_OBJECT: Final = ("__reduce__", "__reduce_ex__", "__getstate__", "__setattr__", "__new__", "__getattribute__")


def duplicate(thing: T, memo: Memo | None = None) -> T:
    """A deep copy of `thing`, as `copy.deepcopy` makes it."""
    kind = type(thing)
    if kind in _SAME:
        return thing
    made: T = _copied(thing, {} if memo is None else memo)
    return made


def _copied(thing: Any, memo: Memo) -> Any:
    """The copy of something that is not of the kinds in `_SAME`, as far as they are known."""
    found = memo.get(id(thing))
    if found is not None:
        return found
    kind = type(thing)
    how = _HOW.get(kind)
    if how is None:
        how = _HOW[kind] = _way_of(kind)
    return how(thing, memo)


def _way_of(kind: type) -> Callable[[Any, Memo], Any]:
    """How things of a kind are copied."""
    if kind in _WAYS:
        return _WAYS[kind]
    if issubclass(kind, type | Enum):
        _SAME.add(kind)
        return lambda thing, memo: thing
    if hasattr(kind, "__deepcopy__"):
        return _by_itself
    if issubclass(kind, tuple) and hasattr(kind, "_fields"):
        return _named_tuple
    own = any(hasattr(kind, name) for name in _OWN_WAYS)
    own = own or any(getattr(kind, name, None) is not getattr(object, name, None) for name in _AS_ANY_OBJECT)
    slots = [base.__dict__.get("__slots__", ()) for base in kind.__mro__]
    if own or any(isinstance(some, str) or any(name.startswith("__") for name in some) for some in slots):
        return deepcopy
    return _object(kind, [name for some in slots for name in some])


def _by_itself(thing: Any, memo: Memo) -> Any:
    made = thing.__deepcopy__(memo)
    if made is not thing:
        memo[id(thing)] = made
    return made


def _object(kind: type, slots: Sequence[str]) -> Callable[[Any, Memo], Any]:
    """How an object is copied that is nothing but its attributes."""
    with_dict = kind.__dictoffset__ != 0
    same, new = _SAME, object.__new__

    def copied(thing: Any, memo: Memo) -> Any:
        twin: Any = new(kind)
        memo[id(thing)] = twin
        for name in slots:
            if hasattr(thing, name):
                value = getattr(thing, name)
                setattr(twin, name, value if type(value) in same else _copied(value, memo))
        if with_dict:
            for name, value in thing.__dict__.items():
                setattr(twin, name, value if type(value) in same else _copied(value, memo))
        return twin

    return copied


def _dict(thing: dict[Any, Any], memo: Memo) -> dict[Any, Any]:
    twin: dict[Any, Any] = {}
    memo[id(thing)] = twin
    same = _SAME
    for key, value in thing.items():
        if type(key) not in same:
            key = _copied(key, memo)
        twin[key] = value if type(value) in same else _copied(value, memo)
    return twin


def _list(thing: list[Any], memo: Memo) -> list[Any]:
    twin: list[Any] = []
    memo[id(thing)] = twin
    same = _SAME
    twin.extend([value if type(value) in same else _copied(value, memo) for value in thing])
    return twin


def _tuple(thing: tuple[Any, ...], memo: Memo) -> tuple[Any, ...]:
    same = _SAME
    for value in thing:
        if type(value) not in same and _copied(value, memo) is not value:
            break
    else:
        return thing
    found = memo.get(id(thing))  # it may lead to itself
    if found is None:
        found = memo[id(thing)] = tuple([value if type(value) in same else _copied(value, memo) for value in thing])
    return found


def _named_tuple(thing: Any, memo: Memo) -> Any:
    made = _tuple(thing, memo)
    if made is not thing and type(made) is tuple:
        made = memo[id(thing)] = type(thing)._make(made)
    return made


def _deque(thing: deque[Any], memo: Memo) -> deque[Any]:
    twin: deque[Any] = deque(maxlen=thing.maxlen)
    memo[id(thing)] = twin
    twin.extend([duplicate(value, memo) for value in thing])
    return twin


def _set(thing: set[Any], memo: Memo) -> set[Any]:
    twin: set[Any] = {duplicate(value, memo) for value in thing}
    memo[id(thing)] = twin
    return twin


def _bytearray(thing: bytearray, memo: Memo) -> bytearray:
    twin = memo[id(thing)] = bytearray(thing)
    return twin


def _method(thing: MethodType, memo: Memo) -> MethodType:
    return MethodType(thing.__func__, _copied(thing.__self__, memo))


_WAYS: Final[dict[type, Callable[[Any, Memo], Any]]] = {
    dict: _dict, list: _list, tuple: _tuple, deque: _deque, set: _set, bytearray: _bytearray, MethodType: _method,
}  # fmt: skip
