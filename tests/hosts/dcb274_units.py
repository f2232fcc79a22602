"""Units of a DCB-274 for the tests of its driver: one alone, or three on a line."""

from detent.cell.build import build
from detent.cell.cell import Cell
from detent.cell.description import parse
from detent.cell.host import HostPort
from detent.hosts.dcb274 import BlockingDcb274, Dcb274


def cell_of(text: str) -> Cell:
    return build(parse(text, "cell"), lambda file: "")


def alone(more: str = "", **port: type[HostPort]) -> tuple[Cell, BlockingDcb274]:
    cell = cell_of('[units.unit]\nmodel = "dcb-274"\n' + more)
    return cell, BlockingDcb274(Dcb274(), port.get("port", HostPort)(cell))


def three(adapter: str = "", *, party: bool = True, kind: str = "") -> tuple[Cell, HostPort]:
    """Axes X, Y and Z on one line."""
    straps = 'straps = { PARTY = "high" }\n' if party else ""
    text = [f'[units.{name.lower()}]\nmodel = "dcb-274"\noptions = {{ name = "{name}" }}\n{straps}' for name in "XYZ"]
    if adapter:
        text += [f'[units.adapter]\nmodel = "{adapter}"\n', '[lines.host]\nunits = ["adapter"]\n']
    text += ['[lines.bus]\nunits = ["x", "y", "z"]\n', 'host = "adapter"\n' if adapter else "", kind]
    cell = cell_of("".join(text))
    return cell, HostPort(cell)


def driven(port: HostPort, names: str, mode: str, first: str = "") -> list[BlockingDcb274]:
    return [BlockingDcb274(Dcb274(name, mode=mode, first=first), port) for name in names]
