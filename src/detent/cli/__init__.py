"""The command `detent`: one verb a module, each imported only when it is used."""

import sys
from collections.abc import Sequence

FAILED = 1
ASKED_WRONGLY = 2

VERBS = {
    "demo": "detent.cli.demo:demo",
    "models": "detent.cli.models:models",
    "serve": "detent.cli.serve:serve",
    "run": "detent.cli.run:run",
    "asm": "detent.cli.assemble:asm",
    "list": "detent.cli.assemble:list_",
    "disasm": "detent.cli.assemble:disasm",
}


def main(tokens: Sequence[str] | None = None) -> None:
    """Run the command line and exit: 0, 1 (it failed), 2 (it was asked wrongly)."""
    from cyclopts import App, CycloptsError

    import detent

    app = App(
        name="detent",
        help="Intelligent stepper motor controllers in software, exact to the pulse.",
        version=detent.__version__,
        exit_on_error=False,
        print_error=True,
    )
    for name, place in VERBS.items():
        app.command(place, name=name)
    app.register_install_completion_command()
    try:
        app(tokens)
    except CycloptsError:
        sys.exit(ASKED_WRONGLY)
    except KeyboardInterrupt:
        sys.exit(130)
