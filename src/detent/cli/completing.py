"""What a shell completes beyond the options: models, motors, straps, control verbs, the names of examples.

The script is made once, from the choices that a parameter's type has. Those that are tables of Detent's stand in the
types only while it is made: importing a verb must not bring the tables with it. Straps and options are those of the
model that has been typed: their place is taken by a word, and that by a function of the shell.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, Final, Literal, get_args

from detent.cli import VERBS
from detent.cli.overwrite import Overwrite


def models() -> list[str]:
    """The controllers by name."""
    from detent.controllers.catalogue import MODELS

    return list(MODELS)


def motors() -> list[str]:
    """The motors by name."""
    from detent.motors.named import MOTORS

    return list(MOTORS)


def wired_motors() -> list[str]:
    """The motors of the manual's examples."""
    from detent.controllers.genstepper.motors import EXAMPLES

    return [one.number for one in EXAMPLES]


def straps() -> list[str]:
    """The word in the place of the straps of a model."""
    return [_OF_THE_MODEL["strap"]]


def settings() -> list[str]:
    """The word in the place of the options of a model."""
    return [_OF_THE_MODEL["set"]]


_OF_THE_MODEL: Final = {"strap": "@strap@", "set": "@set@"}


def of_models() -> dict[str, dict[str, list[str]]]:
    """The straps and the options of each model, as they are begun: ``CHS=``."""
    from detent.controllers.catalogue import MODELS

    return {
        "strap": {name: [f"{strap}=" for strap in model.straps] for name, model in MODELS.items()},
        "set": {name: [f"{option.name}=" for option in model.options] for name, model in MODELS.items()},
    }


def control_verbs() -> list[str]:
    """What a served cell can be told."""
    from detent.realtime.verbs import VERBS as KNOWN

    return list(KNOWN)


def example_names() -> list[str]:
    """The examples."""
    from detent.cli.examples import names

    return names()


def pages() -> list[str]:
    """The pages of `detent size`."""
    from detent.cli.size import PAGES

    return list(PAGES)


KNOWN: Final[dict[tuple[str, str], Callable[[], list[str]]]] = {
    **{(verb, "model"): models for verb in VERBS},
    **{(verb, "target"): models for verb in VERBS},
    **{(verb, "strap"): straps for verb in VERBS},
    **{(verb, "set_"): settings for verb in VERBS},
    ("motor", "name"): motors,
    ("tune", "motor"): motors,
    ("compare-moves", "motor"): motors,
    ("wiring", "motor"): wired_motors,
    ("control", "words"): control_verbs,
    ("demo", "name"): example_names,
    ("examples", "name"): example_names,
    ("size", "page"): pages,
}
"""The words for a parameter of a verb."""


@contextmanager
def with_choices() -> Iterator[None]:
    """The verbs' parameters have their words as types while this lasts."""
    changed: list[tuple[Any, dict[str, Any]]] = []
    try:
        for verb, (place, _) in VERBS.items():
            module, name = place.split(":")
            function = getattr(import_module(module), name)
            changed.append((function, dict(function.__annotations__)))
            for parameter in function.__annotations__:
                words = KNOWN.get((verb, parameter))
                if words is not None:
                    one: Any = Literal.__getitem__(tuple(words()))
                    several = parameter in ("strap", "set_", "model") and verb in ("serve", "run", "workbench", "find")
                    kept = get_args(function.__annotations__[parameter])[1:]  # what Annotated says of it
                    kind: Any = Sequence[one] if several else one
                    function.__annotations__[parameter] = Annotated[(kind, *kept)] if kept else kind
        yield
    finally:
        for function, before in changed:
            function.__annotations__ = before


def narrowed(script: str, shell: str) -> str:
    """The script of a shell with functions in the place of the words for straps and options, which know the model."""
    made = []
    for what, words in of_models().items():
        place, function = _OF_THE_MODEL[what], f"_detent_{what}"
        everything = sorted({word for some in words.values() for word in some})  # a cell file may have any model
        if shell == "fish":
            made += [f"function {function}", "    for word in $argv", "        switch $word"]
            for name, some in words.items():
                made += [f"            case {name}", f"                string split ' ' '{' '.join(some)}'"]
                made += ["                return"]
            made += ["        end", "    end", f"    string split ' ' '{' '.join(everything)}'", "end"]
            script = script.replace(f"-a '{place}'", f"-a '({function} (commandline -opc))'")
        else:
            made += [f"{function}() {{", "  local word", '  for word in "$@"; do', '    case "$word" in']
            made += [f"      {name}) echo {' '.join(some)}; return ;;" for name, some in words.items()]
            made += ["    esac", "  done", f"  echo {' '.join(everything)}", "}"]
            typed = '"${COMP_WORDS[@]}"' if shell == "bash" else "$words"
            call = f"$({function} {typed})"
            script = script.replace(f'("{place}")', f"({call})").replace(f"compadd -- '{place}'", f"compadd -- {call}")
            script = script.replace(f"({place})", f"({call})")
    first, _, rest = script.partition("\n")  # zsh looks for #compdef there
    return "\n".join([first, *made, rest])


def not_for() -> dict[str, list[str]]:
    """The options of a unit's line that are not for a model, which `UnitOptions` would refuse."""
    from dataclasses import fields

    from detent.cli.unit import UnitOptions, flag
    from detent.realtime.connect import HOSTS
    from detent.uart import Format

    every = ["checksums" if field.name == "no_checksum" else field.name for field in fields(UnitOptions)]
    return {
        name: [flag(one) for one in every if one not in host.options and one not in Format._fields]
        for name, host in HOSTS.items()
    }


def without_others(script: str, shell: str) -> str:
    """The script of a shell in which the verbs that talk to a unit offer only the options of the model on the line."""
    one = "no-checksum"  # whatever verb has this has all of them
    made = []
    if shell == "fish":
        made += ["function _detent_takes", "    for word in $argv[2..]", "        switch $word"]
        for name, flags in not_for().items():
            dropped = " ".join(flag.removeprefix("--") for flag in flags)
            made += [
                f"            case {name}",
                f"                not contains -- $argv[1] {dropped}",
                "                return",
            ]
        made += ["        end", "    end", "    true", "end"]
        those = {flag.removeprefix("--") for flags in not_for().values() for flag in flags}
        lines = script.split("\n")
        using = {line.split("'")[1] for line in lines if f" -l {one} " in line}
        for place, line in enumerate(lines):
            condition, option = (
                (line.split("'")[1], line.partition(" -l ")[2].split(" ")[0]) if "'" in line else ("", "")
            )
            if condition in using and option in those:
                takes = f"{condition}; and _detent_takes {option} (commandline -opc)"
                lines[place] = line.replace(f"'{condition}'", f"'{takes}'", 1)
        script = "\n".join(lines)
    else:
        shown = '"${COMP_WORDS[@]}"' if shell == "bash" else "$words"
        made += ["_detent_unit() {", "  local word spec dropped=", f"  for word in {shown}; do", '    case "$word" in']
        made += [f"      {name}) dropped=' {' '.join(flags)} ' ;;" for name, flags in not_for().items()]
        made += ["    esac", "  done"]
        if shell == "bash":
            made += ['  for spec in "$@"; do', '    [[ "$dropped" == *" $spec "* ]] || echo "$spec"', "  done", "}"]
            begin = "local -a _c=("
            script = "\n".join(
                line.replace(begin, f"{begin}$(_detent_unit ", 1) + ")"
                if begin in line and f'"--{one}"' in line
                else line
                for line in script.split("\n")
            )
        else:
            made += ["  local -a kept=()", '  for spec in "$@"; do', '    word="${${spec#\\*}%%[\\[:]*}"']
            made += [
                '    [[ "$dropped" == *" $word "* ]] || kept+=("$spec")',
                "  done",
                '  _arguments "${kept[@]}"',
                "}",
            ]
            blocks = script.split("_arguments \\\n")
            for place, block in enumerate(blocks[1:], 1):
                if f"'--{one}[" in block:
                    blocks[place] = "_detent_unit \\\n" + block
                else:
                    blocks[place] = "_arguments \\\n" + block
            script = "".join(blocks)
    first, _, rest = script.partition("\n")  # zsh looks for #compdef there
    # and it calls the function of the file by itself only where there is no other: else the first Tab does nothing
    return "\n".join([first, *made, rest.rstrip("\n"), *(['_cyclopts_detent "$@"'] if shell == "zsh" else []), ""])


def install(
    *, shell: Literal["bash", "zsh", "fish"] | None = None, output: Path | None = None, overwrite: Overwrite = False
) -> None:
    """Write the script that completes detent in your shell.

    Your shell reads it when it starts the next time.

    Parameters
    ----------
    shell
        Which shell; without it the one that runs.
    output
        Write the script to this file, and change nothing else.
    overwrite
        Write over a file that is there.
    """
    from cyclopts.completion import detect_shell

    from detent.cli import application
    from detent.cli.endings import asked_wrongly, failed
    from detent.outputs.files import InTheWay, check_outputs, write_whole

    try:
        check_outputs([output], asked=overwrite)
    except InTheWay as error:
        asked_wrongly(error)
    try:
        with with_choices():
            whole = application("*")
            kind = shell or detect_shell()
            written = whole.install_completion(shell=kind, output=output, add_to_startup=output is None)
        script = without_others(narrowed(written.read_text(encoding="utf-8"), kind), kind)
        write_whole(written, script.encode())
    except OSError as error:
        failed(f"{error.filename or output}: not written: {error.strerror or error}")
    except (ValueError, RuntimeError) as error:
        asked_wrongly(f"{error}: say --shell bash, zsh or fish")
    print(f"Wrote {written}" + ("" if output is not None else "; open a new shell"))
