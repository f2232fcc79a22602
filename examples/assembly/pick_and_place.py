"""The program of the CCU: two arms put a bearing on a shaft, in virtual time or on drives that are served.

    python pick_and_place.py [FIGURE.png]          the cell beside this file, in virtual time
    python pick_and_place.py HOST:PORT             drives served with: detent serve cell.toml --tcp HOST:PORT

Steps are half steps. The left arm has the drives 1 to 3 and the wrist 4, the right arm 5 to 7.
"""

import sys
from collections.abc import Callable
from pathlib import Path

from detent.hosts.supersigma import BlockingCcu, Ccu

LEFT_X, LEFT_Y, LEFT_Z, WRIST, RIGHT_X, RIGHT_Y, RIGHT_Z = DRIVES = range(1, 8)
GRIP = 0.25  # seconds that a hand takes to close or to open; hands are the matter of another card


def pick_and_place(ccu: BlockingCcu, wait: Callable[[float], object]) -> None:
    """The whole assembly, from unknown places to the arms at rest."""
    # The Z axes first, so that no arm hits anything; then all that is left, together.
    ccu.originate_all([LEFT_Z, RIGHT_Z])
    ccu.originate_all([LEFT_X, LEFT_Y, WRIST, RIGHT_X, RIGHT_Y])

    # Both arms go over their parts at once, each axis as fast as it can; the wrist turns meanwhile.
    ccu.move_all({LEFT_X: 9600, LEFT_Y: 4000, WRIST: 800, RIGHT_X: 6400, RIGHT_Y: 2400})
    ccu.move_all({LEFT_Z: 2400, RIGHT_Z: 2000}, limit=4000)
    wait(GRIP)  # both hands close: the left one on the bearing, the right one on the shaft
    ccu.move_all({LEFT_Z: -2400, RIGHT_Z: -2000})

    # The shaft is brought to the middle and held there; the bearing comes over it.
    ccu.move_all({RIGHT_X: 5600, RIGHT_Y: 1600, LEFT_X: -3600, LEFT_Y: -250})
    ccu.move_all({RIGHT_Z: 1200, WRIST: -800})

    # The last 600 half steps of the left arm are a straight line, a short one upright.
    ccu.move_line({LEFT_X: -600, LEFT_Y: 250, LEFT_Z: 200})
    ccu.move_all({LEFT_Z: 1000}, limit=2000)
    wait(GRIP)  # the left hand opens
    ccu.move_all({LEFT_Z: -1200})

    # The right arm puts the whole on the table, and both arms go home.
    ccu.move_all({LEFT_X: -5400, LEFT_Y: -4000, RIGHT_Y: -1200})
    ccu.move_all({RIGHT_Z: 800}, limit=2000)
    wait(GRIP)  # the right hand opens
    ccu.move_all({RIGHT_Z: -2000})
    ccu.move_all({RIGHT_X: -12_000, RIGHT_Y: -2800})


def in_virtual_time(figure: Path | None) -> None:
    """Run the cell beside this file, say where the axes are, draw them."""
    from detent.cell.build import build
    from detent.cell.description import parse
    from detent.cell.host import HostPort
    from detent.outputs import figures, signals

    if figure is not None:
        figures.check(figure)
    file = Path(__file__).with_name("cell.toml")
    description = parse(file.read_text(), str(file))
    cell = build(description, lambda name: file.with_name(name).read_text())
    port = HostPort(cell)
    pick_and_place(BlockingCcu(Ccu(), port), port.wait)
    for name, drive in cell.controllers().items():
        status = drive.status(cell.now)
        print(f"{name:10} at {status.position:+6}, {status.pulses:6} half steps made")
    print(f"done after {cell.now / 1e9:.2f} s")
    if figure is not None:
        shafts = {name: unit.shaft for name, unit in description.units.items()}
        figures.write(figure, signals.of_cell(cell, shafts), title=description.title, lanes=[])
        print(f"Wrote {figure}")


def on_drives(address: str) -> None:
    """Run on drives that are served, or on real ones."""
    from detent.realtime.ports import open_port

    port = open_port(address)
    pick_and_place(BlockingCcu(Ccu(), port), port.wait)
    port.close()


def main() -> None:
    """Choose by the argument."""
    argument = sys.argv[1] if len(sys.argv) > 1 else ""
    try:
        if ":" in argument:
            on_drives(argument)
        else:
            in_virtual_time(Path(argument) if argument else None)
    except (OSError, ValueError) as error:  # of the port, of its drives, or of the figure
        sys.exit(str(error))


if __name__ == "__main__":
    main()
