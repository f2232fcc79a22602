"""Random cells behind pins: units of any kind, each axis on one board or another, wired in any way that may be."""

from collections import Counter
from collections.abc import Mapping
from itertools import pairwise
from random import Random

from tests.realtime.boards.driven_bench import Bench

from detent.ticks import MS

FAR = 10**6
NOWHERE: Mapping[str, tuple[int, int]] = {}
LINES = {
    "gs-c200s": "S{s} T{t} R{k} +{n} -{n} g+ g- H+ H- A1 C1 A2 C2 g+1 Z K G{n}",
    "bs0610": "X{n}G X-{n}G Y{n}G Y-{n}G X+S X-S B+S B{n}G BZ XZ X{n}GYZ R{t} K{k} !",
    "supersigma": "originate move+{n} move-{n} stop emergency",
    "dcb-274": "+{n} -{n} M{r} M-{r} M0 F{r},0 F{r},1 @ \x1b Z0 R{n} R-{n} | H{h} H{h} Y{s},{k}",
}
"""What a host may say to each kind."""
SELECTS = [(1, 1, 1), (0, 1, 1), (1, 0, 1), (0, 0, 1), (1, 1, 0), (0, 1, 0), (1, 0, 0)]
"""SEL2, SEL1, SEL0 of modules on one line, the first of them alone."""


class RandomCell:
    """A cell file, the switches of its machine, and what hosts and hands may do with it.

    `text` is the file; `units` are names and models; `steppers` the axes; `switches` are closed by the machine, as
    `driven_bench.Bench` takes them; `hands` are the other inputs. Every input rests where it is 1.
    """

    def __init__(
        self, random: Random, *, most_boards: int = 2, chips: bool = True, rich: bool = False, large: bool = False
    ) -> None:
        """`chips`: drivers may be some. `rich`: clocks of their own for each direction, chips by SPI, programs.

        `large`: three to six units on up to four boards, those of one kind on one line or each on its own.
        """
        self._random, self._chips, self._rich, self._large = random, chips, rich, large
        self.files: dict[str, str] = {}  # programs, by their names in the cell file
        self.boards = "abcd"[: random.choice([1, 2, 3, 4])] if large else "ab"[: random.choice([1, 1, 2])][:most_boards]
        self._common = large and random.random() < 0.5  # lines
        self.lead = random.choice([5, 10, 30, 60])
        self.replies = random.choice(["held", "held", "held", "at once"])
        self.units: list[tuple[str, str]] = []
        self.steppers: list[str] = []
        self.switches: dict[str, tuple[str, int, int]] = {}
        self.hands: list[str] = []
        self.limits: list[str] = []  # switches that no step may pass
        self._pins: Counter[str] = Counter()
        self.text = ""
        make = {
            "gs-c200s": self._gsc200, "bs0610": self._genstepper, "supersigma": self._supersigma,
            "dcb-274": self._dcb274,
        }  # fmt: skip
        for name in "uvwxyz"[: random.choice([3, 4, 5, 6])] if large else "xyz"[: random.choice([1, 1, 2, 2, 3])]:
            model = random.choice(["gs-c200s", "gs-c200s", "bs0610", "supersigma", "dcb-274"])
            self.units.append((name, model))
            make[model](name)
        self._lines()
        for board in self.boards:
            self.text += f'[boards.{board}]\nserial = "fake{board}"\nlead = "{self.lead} ms"\n'
            self.text += f'replies = "{self.replies}"\n' + random.choice(["", 'watchdog = "2 s"\n'])

    def bring_to_rest(self, bench: Bench) -> None:
        """Hands let go, and hosts end whatever moves."""
        for pin in self.hands:
            bench.press(pin, 1)
        bench.run(400 * MS)
        for unit, model in self.units:
            match model:
                case "gs-c200s":
                    bench.type(unit, "@")
                    bench.run(50 * MS)
                    bench.type(unit, "K")
                case "dcb-274":
                    bench.send(unit, b"\x1b")
                case "bs0610" if f"{unit}.RST" in self.hands:
                    bench.press(f"{unit}.RST", 0)
                    bench.run(100 * MS)
                    bench.press(f"{unit}.RST", 1)
                    bench.run(450 * MS)
                case "bs0610":
                    bench.send(unit, b"!BZ!BZ")
                    bench.run(450 * MS)
                case "supersigma":
                    bench.type(unit, "emergency")
            bench.run(50 * MS)

    def say(self, bench: Bench) -> None:
        """A host says something."""
        random = self._random
        unit, model = random.choice(self.units)
        line = random.choice(LINES[model].split(" ")).format(
            n=random.randrange(1, 800), r=random.randrange(200, 4000), s=random.choice([5, 20, 50]),
            t=random.randrange(50, 300), k=random.randrange(1, 60), h=random.randrange(4),
        )  # fmt: skip
        if model == "bs0610" or len(line) == 1:
            bench.send(unit, line.encode())
        elif model == "supersigma":
            bench.type(unit, line.replace("+", " +").replace("-", " -"))
        elif model == "dcb-274" and len(self._party()) > 1:
            bench.type(unit, unit.upper() + line)
        else:
            bench.type(unit, line)

    def _party(self) -> list[str]:
        return [unit for unit, model in self.units if model == "dcb-274"]

    def _lines(self) -> None:
        kinds = ("dcb-274", "gs-c200s", "supersigma") if self._common else ("dcb-274",)
        groups = [[unit for unit, model in self.units if model == kind] for kind in kinds]
        shared = {kind: units for kind, units in zip(kinds, groups, strict=True) if len(units) > 1}
        for number, units in enumerate(shared.values()):
            self.text += f"[lines.bus{number or ''}]\nunits = {units}\n"
        for unit, model in self.units if shared else ():
            if model not in shared:
                self.text += f'[lines.to_{unit}]\nunits = ["{unit}"]\n'
        modules = [unit for unit, model in self.units if model == "gs-c200s"]
        for one, other in pairwise(modules if self._large else modules[:2]):
            if self._random.random() < 0.3:
                self.text += f'[[wires]]\nfrom = "{one}.UO1"\nto = "{other}.UI2"\n'

    def _pin(self, board: str) -> str:
        self._pins[board] += 1
        return f"gpio{self._pins[board] + 1}"

    def _any(self, board: str) -> str:
        """A pin that is active at either level."""
        return self._random.choice(["", "!"]) + self._pin(board)

    def _unit(self, unit: str, model: str, board: str, more: str = "") -> None:
        self.text += f'[units.{unit}]\nmodel = "{model}"\n{more}[hardware.{unit}]\nboard = "{board}"\n'

    def _motor(self, name: str, board: str, model: str, *, separate: bool = False) -> None:
        self.steppers.append(name)
        self.text += f'step = "{self._any(board)}"\ndir = "{self._any(board)}"\n'
        if separate:
            self.text += f'minus = "{self._any(board)}"\n'
        if self._random.random() < 0.6:
            self.text += f'enable = "{self._any(board)}"\n'
        chance = self._random.random()
        if chance < 0.3:
            self.text += f'driver = {{ kind = "plain", half = "{self._any(board)}" }}\n'
        elif chance < 0.5 and model != "bs0610" and self._chips:
            more = "sense = 0.05, amperes = 1.5" if model == "dcb-274" else "amperes = 0.8"
            more += ", microsteps = 2" if model in ("gs-c200s", "supersigma") else ""
            if self._rich and self._random.random() < 0.5:
                pins = [f'{name} = "{self._pin(board)}"' for name in ("select", "clock", "mosi", "miso")]
                kind = "tmc5160" if model == "dcb-274" else "tmc2130"
                self.text += f'driver = {{ kind = "{kind}", {", ".join(pins)}, {more} }}\n'
            else:
                self.text += f'driver = {{ kind = "tmc2209", uart = "{self._pin(board)}", {more} }}\n'

    def _outputs(self, board: str, *names: str) -> None:
        chosen = [f'{name} = "{self._any(board)}"' for name in names if self._random.random() < 0.6]
        self.text += f"outputs = {{ {', '.join(chosen)} }}\n" if chosen else ""

    def _inputs(
        self, unit: str, board: str, *names: str, axis: str = "", places: Mapping[str, tuple[int, int]] = NOWHERE
    ) -> None:
        """`places`: where the machine of `axis` closes which input, if it does."""
        random, wired = self._random, []
        for name in names:
            full = f"{unit}.{name}"
            if name in places and random.random() < 0.5:
                self.switches[full] = (axis, *places[name])
                if name not in ("EOT", "HOME", "RAIL"):
                    self.limits.append(full)
            elif name not in places and random.random() < 0.3:
                if random.random() < 0.5:
                    wired.append(f'"{name}" = "^{self._pin(board)}"')  # nobody touches it
                continue
            else:
                self.hands.append(full)
            wired.append(f'"{name}" = "{random.choice(["", "!"])}^{self._pin(board)}"')
        self.text += f"inputs = {{ {', '.join(wired)} }}\n" if wired else ""

    def _gsc200(self, unit: str) -> None:
        random, board = self._random, self._random.choice(self.boards)
        selects = SELECTS[len(self.units) if self._common else 0]
        more = 'straps = {{ CHS = "low", SEL2 = {}, SEL1 = {}, SEL0 = {} }}\n'.format(*selects)
        separate = self._rich and random.random() < 0.4
        if separate:
            more += 'options = { clock = "separate" }\n'
        if self._rich and random.random() < 0.5:
            more += f'program = "{unit}.gsc"\n'
            self.files[f"{unit}.gsc"] = self._program()
        self._unit(unit, "gs-c200s", board, more)
        self._motor(unit, board, "gs-c200s", separate=separate)
        self._outputs(board, "MOV", "RDY", "RAMP", "UO1")
        end = random.randrange(30, 400)
        places = {"EOT": (end, FAR), "HOME": (-FAR, random.randrange(-20, end))}
        self._inputs(unit, board, "EOT", "HOME", "ENABLE", "UI1", axis=unit, places=places)

    def _program(self) -> str:
        """A program of a GS-C200S that may go on for ever."""
        random = self._random
        lines = ["S20", f"T{random.randrange(50, 200)}", f"R{random.randrange(1, 60)}"]
        for _ in range(random.randrange(2, 9)):
            line = random.choice(["+{n}", "-{n}", "+{n}", "-{n}", "G0", "D1", "A1", "C1", "W1", "g+"])
            lines.append(line.format(n=random.randrange(1, 300)))
        return "\n".join([*lines, *random.choice([["G0"], []])])

    def _dcb274(self, unit: str) -> None:
        board, end = self._random.choice(self.boards), self._random.randrange(30, 300)
        self._unit(unit, "dcb-274", board, f'options = {{ name = "{unit.upper()}" }}\n')
        self._motor(unit, board, "dcb-274")
        self._outputs(board, "P5")
        names = ("LIMIT-A", "LIMIT-B", "HOME", "JOG1", "JOG2")
        places = {"LIMIT-A": (end, FAR), "LIMIT-B": (-FAR, -end), "HOME": (-20, -10)}
        self._inputs(unit, board, *names, axis=unit, places=places)

    def _supersigma(self, unit: str) -> None:
        board, end = self._random.choice(self.boards), self._random.randrange(30, 400)
        self._unit(unit, "supersigma", board, f"options = {{ number = {len(self.units) if self._common else 1} }}\n")
        self._motor(unit, board, "supersigma")
        self._outputs(board, "P23")
        self._inputs(unit, board, "FORCE", "RAIL", axis=unit, places={"RAIL": (-FAR, -end // 8 - 2)})

    def _genstepper(self, unit: str) -> None:
        shared, end = self._random.choice(self.boards), self._random.randrange(30, 400)
        self._unit(unit, "bs0610", shared, 'options = { hard_stop = "yes" }\n')
        self._outputs(shared, "RDY")
        self._inputs(unit, shared, "RST", "Y+", "X+", "X-")
        for axis in "XY":
            board = self._random.choice(self.boards)
            self.text += f'[hardware.{unit}.{axis}]\nboard = "{board}"\n'
            self._motor(f"{unit}.{axis}", board, "bs0610")
            low, high = f"L{axis}-", f"L{axis}+"
            places = {low: (-FAR, -end // 2), high: (end, FAR)}
            self._inputs(unit, board, low, high, axis=f"{unit}.{axis}", places=places)
