"""Settings as people write them: I=800 V=6000 K=7,5."""

from collections.abc import Sequence

from detent.controllers import catalogue
from detent.moves.law import Law, Setting, Values
from detent.moves.laws import law
from detent.nearest import did_you_mean


class SettingError(ValueError):
    """A setting that the controller does not take; the text says what it does."""


def read(model: str, texts: Sequence[str], axis: str = "") -> tuple[Law, Values]:
    """The law of `model` and the settings of the words NAME=VALUE; what is not named is as at first.

    A setting of several numbers (K of a DCB-274, up and down) takes them with commas between, or one for all. Options
    of the model (like step_size) are taken, too. SettingError and CatalogueError say what is wrong.
    """
    found = catalogue.model(model)
    pairs = []
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or not name.strip() or not value.strip():
            raise SettingError(f"{text!r}: write NAME=VALUE, like {_example(law(model, None, axis))}")
        pairs.append((name.strip(), value.strip()))
    options = {option.keyword: option for option in found.options}
    names = [name.lower().replace("-", "_") for name, _ in pairs]
    chosen = {options[name].name: value for name, (_, value) in zip(names, pairs, strict=True) if name in options}
    made = law(model, chosen, axis)
    values = dict(made.values)
    for name, (written, text) in zip(names, pairs, strict=True):
        if name not in options:
            values |= _numbers(made, written, text)
    return made, values


def spelled(law: Law, values: Values) -> str:
    """The settings in short: S=20 T=300 R=80."""
    parts: dict[str, list[int]] = {}
    for setting in law.settings:
        parts.setdefault(_letter(setting), []).append(values[setting.name])
    words = []
    for name, numbers in parts.items():
        shown = numbers[:1] if len(set(numbers)) == 1 else numbers
        words.append(f"{name}={','.join(map(str, shown))}")
    return " ".join(words)


def _numbers(law: Law, name: str, text: str) -> dict[str, int]:
    settings = [setting for setting in law.settings if _letter(setting).lower() == name.lower()]
    if not settings:
        names = list(dict.fromkeys(_letter(setting) for setting in law.settings))
        raise SettingError(
            f"{law.model} has no setting {name!r}; {did_you_mean(name, names, 0.6)}there are: {', '.join(names)}"
        )
    parts = [part.strip() for part in text.split(",")]
    if len(parts) not in (1, len(settings)):
        raise SettingError(f"{name}={text}: give one number, or {len(settings)} with commas between")
    found = {}
    for setting, part in zip(settings, parts * len(settings) if len(parts) == 1 else parts, strict=True):
        if not (part.lstrip("+-").isdecimal() and part.isascii()):
            raise SettingError(f"{name}={text}: {part!r} is no whole number")
        value = int(part)
        if not setting.low <= value <= setting.high:
            parts = [setting.title, *([setting.unit] if setting.unit else [])]
            unit = f" ({', '.join(parts)}" + (f" / {setting.scale})" if setting.scale > 1 else ")")
            raise SettingError(f"{name}={text}: {setting.name} takes {setting.low} to {setting.high}{unit}")
        found[setting.name] = value
    return found


def _letter(setting: Setting) -> str:
    return setting.name.split()[0]


def _example(law: Law) -> str:
    return spelled(law, law.values)
