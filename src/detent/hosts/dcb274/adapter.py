"""DCB-274s behind an intelligent serial adapter, the SIN-10 (page 19)."""

from typing import Final

from detent.hosts.dcb274.handshake import CR, ESC, NAMED_LONGEST, TRIES, Handshake, NotListening
from detent.hosts.dcb274.names import ADAPTERS_OWN, is_name
from detent.hosts.errors import BadAnswer, DriverError, NoAnswer, Refused, Spoken
from detent.hosts.exchange import Clear, Steps, attempt, until

ADAPTER_LONGEST: Final = 256  # characters of a line of commands (page 19)
SCAN: Final = 10.0  # seconds for `&`: 86 names, each with a time-out of the adapter's own


class Adapter(Handshake):
    """A SIN-10 in between: it takes lines of commands, does the handshake, answers each command with one line.

    Before anything else it must look for axes (``&``, "required initialization", page 19), which sends ^P: every axis
    is reset in party line mode. So that is done only while the adapter knows no axis at all.
    """

    longest = NAMED_LONGEST

    def connect(self) -> Steps[str]:
        """Ask the axis how it moves. If the adapter knows no axis yet, look for axes."""
        yield Clear()
        try:
            yield from self.line("^", 0.0)
        except Refused as error:
            known = yield from self.known()
            if known:
                what = f"is not known to the adapter, which knows {', '.join(known)}; & looks anew, and resets all"
                raise NoAnswer(self.title, what, error.spoken, "scan() sends &") from None
            yield from self.scan()
        except NotListening:
            pass  # it is known, and runs a program
        return ""

    def known(self) -> Steps[str]:
        """The names that the adapter knows: to commands for others it answers ``#`` itself."""
        names = [chr(value) for value in range(0x21, 0x7F) if is_name(chr(value)) and chr(value) not in ADAPTERS_OWN]
        known = ""
        for half in (names[::2], names[1::2]):
            replies = yield from self.spool([f"{name}^" for name in half], SCAN)
            known += "".join(name for name, reply in zip(half, replies, strict=True) if reply != "#")
        return "".join(sorted(known))

    def scan(self) -> Steps[str]:
        """``&``: the names of the axes that are there. Every axis is reset."""
        data = yield from self.ask(b"&\r", until(b"\r\n"), self.patience + SCAN)
        names = data[:-2].decode("latin-1")
        if self.name not in names:
            found = f"it has found {', '.join(names)}" if names else "it has found none"
            raise NoAnswer(self.title, f"is not on the adapter's party line; {found}", Spoken(b"&\r", data))
        return names

    def line(self, text: str, seconds: float, tries: int = TRIES) -> Steps[str]:
        """The command behind its name; the reply has it again, and the result behind."""
        yield Clear()
        (reply,) = yield from self.spool([self.name + text], seconds)
        spoken = Spoken((self.name + text + "\r").encode("latin-1"), (reply + "\r\n").encode("latin-1"))
        if reply == "#":
            what = "is not known to the adapter; & looks for axes, and resets all"
            raise Refused(self.title, what, spoken, "#", "scan() sends &")
        if reply == "?":
            raise NotListening(self.title, "takes no line: a program runs, it jogs, or it is gone", spoken)
        if reply.endswith("?"):
            raise NoAnswer(self.title, f"did not echo all of {text!r}", spoken)
        if not reply.startswith(self.name + text):
            raise BadAnswer(self.title, f"answers something else than {self.name + text!r}", spoken)
        result = reply.removeprefix(self.name + text)
        if result == "#":
            raise self.refused(text, spoken)
        return result

    def spool(self, commands: list[str], seconds: float) -> Steps[list[str]]:
        """Commands with their names in one line, ``;`` between; one reply each, as it comes."""
        data = ";".join(commands).encode("latin-1") + CR
        if len(data) > ADAPTER_LONGEST:
            raise ValueError(
                f"{len(data)} characters: the adapter's buffer holds {ADAPTER_LONGEST}; send fewer at once"
            )
        count = len(commands)

        def complete(came: bytes) -> int | None:
            lines = came.split(b"\r\n", count)
            return len(came) - len(lines[-1]) if len(lines) > count else None

        replies = yield from self.ask(data, complete, self.patience * (1 + count) + seconds)
        return replies.decode("latin-1").split("\r\n")[:-1]

    def interrupt(self, character: bytes, *, known: bool) -> Steps[None]:
        """A command like any other for the adapter: the unit echoes name and character while it runs.

        An adapter that knows no such axis looks for axes first, which resets them (page 19).
        """
        refused = yield from attempt(self.line(character.decode("latin-1"), 0.0))
        if isinstance(refused, Refused) and not known:
            yield from self.connect()
            yield from self.line(character.decode("latin-1"), 0.0)
        elif isinstance(refused, DriverError):
            raise refused

    def over(self) -> Steps[bool]:
        """Whether it says how it moves."""
        try:
            yield from self.line("^", 0.0)
        except NotListening:
            return False
        return True

    def escape(self) -> Steps[None]:
        """ESC goes through at once; the adapter answers ``#``."""
        yield from self.ask(ESC, until(b"#\r\n"), self.patience)
