"""A motor on the pins of a bench: its rotor moves the contacts of its axis, behind the pulses, with its own swing."""

from collections.abc import Sequence
from functools import cache

from tests.controllers.laws.bench import Contact

from detent.cell import contacts as cell_contacts
from detent.cell.build import build
from detent.cell.description import parse
from detent.cell.mechanics import Mechanics
from detent.motors.rotor import Rig

MOTORS = {
    "bs0610": ("qsh4218-35-10-027", 5),  # one that a board can drive at that supply
    "bs0710": ("qsh4218-35-10-027", 5),
}
ANOTHER = "qsh4218-41-10-035", 24


@cache
def rig(model: str, axis: str) -> Rig:
    """The motor, its drive and load, as a cell file has them."""
    name, supply = MOTORS.get(model, ANOTHER)
    text = (f'[units.u]\nmodel = "{model}"\n[motors.m]\nmotor = "{name}"\nunit = "u"\nsupply = {supply}\n'
            f'load = {{ friction = 0.004, inertia = 4e-6 }}\n{f"axis = {axis!r}" if axis else ""}\n')  # fmt: skip
    cell = build(parse(text, "cell"), str)
    part = cell.parts[-1]
    assert isinstance(part, Mechanics)
    return part.rig


def motor(model: str, axis: str, contacts: Sequence[Contact]) -> Mechanics:
    """A motor on an axis, with these contacts, which are told by their places in the sequence."""
    places = [cell_contacts.Contact(str(n), contact.low - 0.5, contact.high + 0.5, contact.level)
              for n, contact in enumerate(contacts)]  # fmt: skip
    found = Mechanics(rig(model, axis), axis=axis, contacts=places)
    for place in places:
        found.watch(place.name)
    return found
