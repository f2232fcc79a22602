"""Records as plain data, as JSON has them."""

from collections.abc import Mapping

from detent.realtime.verbs import Json


def as_json(record: object) -> dict[str, Json]:
    """A named tuple as a table; bytes and characters become text, one character a byte. Tuples within it are tables."""
    assert isinstance(record, tuple)
    fields: Mapping[str, object] = record._asdict()  # type: ignore[attr-defined]
    return {name: _value(value) for name, value in fields.items()}


def _value(value: object) -> Json:
    if isinstance(value, bytes):
        return value.decode("latin-1")
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return {"kind": type(value).__name__, **as_json(value)}
    if isinstance(value, (list, tuple)):
        return [_value(item) for item in value]
    assert value is None or isinstance(value, (str, int, float, bool))
    return value
