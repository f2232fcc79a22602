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


def install(
    *, shell: Literal["bash", "zsh", "fish"] | None = None, output: Path | None = None, force: bool = False
) -> None:
    """Write the script that completes detent in your shell.

    Your shell reads it when it starts the next time.

    Parameters
    ----------
    shell
        Which shell; without it the one that runs.
    output
        Write the script to this file, and change nothing else.
    force
        Write over a file that is there.
    """
    from cyclopts.completion import detect_shell

    from detent.cli import application
    from detent.cli.endings import asked_wrongly, failed
    from detent.outputs.files import InTheWay, check_outputs, write_whole

    try:
        check_outputs([output], asked=force)
    except InTheWay as error:
        asked_wrongly(error)
    try:
        with with_choices():
            whole = application("*")
            kind = shell or detect_shell()
            written = whole.install_completion(shell=kind, output=output, add_to_startup=output is None)
        write_whole(written, narrowed(written.read_text(encoding="utf-8"), kind).encode())
    except OSError as error:
        failed(f"{error.filename or output}: not written: {error.strerror or error}")
    except (ValueError, RuntimeError) as error:
        asked_wrongly(f"{error}: say --shell bash, zsh or fish")
    print(f"Wrote {written}" + ("" if output is not None else "; open a new shell"))
