"""DCB-274s behind an intelligent serial adapter, the SIN-10 (page 19)."""

from typing import Final

from detent.hosts.dcb274.handshake import CR, ESC, NAMED_LONGEST, TRIES, Handshake, NotKnown, NotListening
from detent.hosts.dcb274.names import ADAPTERS_OWN, is_name
from detent.hosts.errors import ECHOES, BadAnswer, DriverError, NoAnswer, Spoken
from detent.hosts.exchange import Ask, Clear, Steps, attempt, until

ADAPTER_LONGEST: Final = 256  # characters of a line of commands (page 19)
SCAN: Final = 10.0  # seconds for `&`: 86 names, each with a time-out of the adapter's own


class Adapter(Handshake):
    """A SIN-10 in between: it takes lines of commands, does the handshake, answers each command with one line.

    Before anything else it must look for axes (``&``, "required initialization", page 19), which sends ^P: every axis
    is reset in party line mode. So that is done only while the adapter knows no axis at all.
    """

    longest = NAMED_LONGEST

    def connect(self) -> Steps[str]:
        """Ask the axis what it is (X, page 52). If the adapter knows no axis yet, look for axes."""
        yield Clear()
        try:
            yield from self.takes_lines()
        except NotKnown as error:
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
            replies = yield from self.spool([f"{name}X" for name in half], SCAN)
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
        return (yield from self._exchange(text, seconds, (b"#", b"?")))

    def _exchange(self, text: str, seconds: float, short: tuple[bytes, ...]) -> Steps[str]:
        """The same; `short` are replies that need not have it. Those to what was broken off before are passed over."""
        yield Clear()
        said = (self.name + text).encode("latin-1")

        def complete(came: bytes) -> int | None:
            end = 0
            for line in came.split(b"\r\n")[:-1]:
                end += len(line) + 2
                line = line.lstrip(b"\n")  # of a reply of which the CR has been cleared
                if line.startswith(said) or line in short:
                    return end
            return None

        answer = yield Ask(said + CR, complete, 2 * self.patience + seconds)
        lines = answer.data.decode("latin-1").split("\r\n")[:-1]
        if not lines:
            spoken = Spoken(said + CR, answer.data)
            if spoken.echoed:
                raise BadAnswer(self.title, ECHOES, spoken)
            what = "does not finish its answer" if answer.data else "does not answer"
            raise NoAnswer(self.title, f"{what} within {2 * self.patience + seconds:.3g} s", spoken)
        return self._result(text, lines[-1].lstrip("\n"))

    def _result(self, text: str, reply: str) -> str:
        spoken = Spoken((self.name + text + "\r").encode("latin-1"), (reply + "\r\n").encode("latin-1"))
        if reply == "#":
            what = "is not known to the adapter; & looks for axes, and resets all"
            raise NotKnown(self.title, what, spoken, "#", "scan() sends &")
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
        stop = character.decode("latin-1")
        told = yield from attempt(self._exchange(stop, 0.0, (b"#", b"?") if known else ()))
        if isinstance(told, NotKnown) and not known:
            yield from self.connect()
            yield from self.line(stop, 0.0)
        elif isinstance(told, DriverError):
            raise told
        if not known and (yield from self.end_program_mode()):
            yield from self.line(stop, 0.0)

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
