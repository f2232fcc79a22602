"""GO and the jog inputs set something going. A stop leads to rest: each counts again only when it has been open."""

from typing import Final

from detent.controllers.dcb274.ports import Ports

JOGS: Final = ("JOG1", "JOG2")
CONTACTS: Final = ("GO", *JOGS)


class Contacts:
    """What the contacts ask for. Those that were active at a stop, and have not been open since, are spent."""

    def __init__(self, ports: Ports) -> None:
        self._ports = ports
        self._spent: set[str] = set()

    def reset(self) -> None:
        """None is spent."""
        self._spent.clear()

    def spend(self) -> None:
        """There is a stop."""
        self._spent = {pin for pin in CONTACTS if self._ports.active(pin)}

    def spend_jogs(self) -> None:
        """A limit stops the motion."""
        self._spent |= {pin for pin in JOGS if self._ports.active(pin)}

    def look(self) -> None:
        """Those that are open count again."""
        if self._spent:
            self._spent = {pin for pin in self._spent if self._ports.active(pin)}

    def ask(self, pin: str) -> bool:
        """Whether a contact is active, and no stop has come since that."""
        return self._ports.active(pin) and pin not in self._spent

    @property
    def jog(self) -> int:
        """The direction that the jog inputs ask for; 0 is none."""
        return 0 if self._ports.stopped else self.ask("JOG1") - self.ask("JOG2")
