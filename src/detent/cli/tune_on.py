"""`detent tune MODEL --on PORT`: the trials on a machine, told as they happen. `tune` calls `tune_on`."""

import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Group, Parameter

from detent.cli.unit import UnitOptions

if TYPE_CHECKING:
    from detent.hosts.exchange import Blocking
    from detent.moves.law import Law, Values
    from detent.tuner.machine.bench import Bench
    from detent.tuner.machine.carriage import Room
    from detent.tuner.machine.session import Plan, Record, Result


@Parameter(name="*", group=Group("Trials on the machine itself, in place of a computed motor", sort_key=3))
@dataclass(frozen=True)
class MachineOptions:
    """Trials on the machine itself, with its home switch as witness; they need no model of the motor.

    Parameters
    ----------
    on
        Where the unit is: a serial device or a link to one, HOST:PORT, or rfc2217://HOST:PORT.
    witness
        The input that the switch is wired to, closed at one end of the travel and behind it: UI1 to UI3, HOME, LX-,
        RAIL. UI1=1 where it is closed when it reads 1.
    travel
        Steps that the carriage may go from where the switch closes.
    behind
        Steps that it may go behind that place, the switch staying closed. By default 8 electrical turns.
    begin
        Settings that are known to be safe, with which it begins: S=60 T=400 R=300.
    safe_rate
        Steps/s at which the motor surely starts and stops without a ramp: the way back. By default 100 full steps/s.
    approach
        The carriage stands clear of the switch, at most so many steps from it: go there first. By default it must
        stand on it.
    away
        Direction from the switch into the travel: 1, or -1.
    trials
        Trials of each move with each setting.
    confirm
        Trials of each move with the setting that is shipped.
    reserve
        By what the last good ramp is made longer: 2 unless given, and 1.25 for the speed of a SUPERSIGMA.
    unit
        Which unit is meant, and its line, as `detent send` has it: --unit address=2 checksums=no, name=A, motor=Y,
        drive=3, baud=1200.
    log
        File of the trials; a run that was interrupted goes on from it. By default MODEL-trials.jsonl.
    yes
        Do not ask before anything moves.
    """

    on: str | None = None
    witness: str | None = None
    travel: int | None = None
    behind: int | None = None
    begin: Annotated[list[str] | None, Parameter(consume_multiple=True)] = None
    safe_rate: int | None = None
    approach: int = 0
    away: int | None = None
    trials: int = 3
    confirm: int = 59
    reserve: float | None = None
    unit: Annotated[list[str] | None, Parameter(consume_multiple=True)] = None
    log: Path | None = None
    yes: Annotated[bool, Parameter(negative=())] = False


NO_MACHINE = MachineOptions()


def tune_on(
    model: str,
    moves: Sequence[int],
    step: str | None,
    machine: MachineOptions,
    *,
    axis: str = "",
    json: bool = False,
) -> None:
    """Carry out the trials, and say what they have shown.

    `step` is the stepping of the drive, where it is open, `axis` the motor of a board that has several.
    """
    from detent.cli.endings import asked_wrongly, failed
    from detent.cli.unit import unit as connected
    from detent.controllers.catalogue import CatalogueError
    from detent.hosts.errors import DriverError
    from detent.realtime.trial_log import LogUnusable, TrialLog
    from detent.tuner.machine.bench import bench as bench_of
    from detent.tuner.machine.carriage import MachineError
    from detent.tuner.machine.session import NothingToShip, OtherRun

    try:
        law, begin = _settings(model, machine)
        room = _room(law, step, machine)
        plan = _plan(law, begin, tuple(moves), room, machine)
        if not machine.witness:
            raise ValueError("--witness: say which input the home switch is wired to, like --witness UI1")
        unit = _unit(machine.unit or [], axis)
    except (ValueError, CatalogueError, MachineError) as error:
        asked_wrongly(error)
    assert machine.on is not None
    path = machine.log or Path(f"{law.model}-trials.jsonl")
    with connected(law.model, machine.on, unit) as found:
        bench = bench_of(law, found.driver, machine.witness, machine.away)  # type: ignore[arg-type]
        if room.rate < bench.slowest:
            asked_wrongly(f"--safe-rate {room.rate}: a {law.model} goes at {bench.slowest} steps/s or more")
        try:
            with TrialLog(path) as log:
                result = _carried_out(found, plan, bench, log, machine, quiet=json)
        except OtherRun as error:
            asked_wrongly(f"{path}: {error}")
        except NothingToShip as error:
            failed(f"{error}\n  every trial is in {path}; behind that, begin with another --log")
        except (MachineError, DriverError) as error:
            failed(f"{error}\n  the log is {path}; with the carriage on the witness the same command goes on from it")
        except LogUnusable as error:
            asked_wrongly(error)
    (_as_json if json else _told)(plan, bench, result, path)


def _unit(words: Sequence[str], axis: str) -> UnitOptions:
    """The unit that these NAME=VALUE mean. ValueError."""
    from dataclasses import fields

    kinds = {field.name: field.type for field in fields(UnitOptions)}
    found: dict[str, Any] = {"motor": axis.upper()} if axis else {}
    for word in words:
        name, equals, value = word.partition("=")
        name = name.strip().lower().replace("-", "_")
        if name == "checksums" and value.lower() in ("no", "0", "off"):
            found["no_checksum"] = True
        elif name not in kinds or name == "no_checksum" or not equals:
            raise ValueError(
                f"--unit {word}: write checksums=no, or NAME=VALUE with {', '.join(list(kinds)[2:])}, address"
            )
        else:
            try:
                kind = str(kinds[name])
                found[name] = int(value) if "int" in kind else float(value) if "float" in kind else value
            except ValueError:
                raise ValueError(f"--unit {word}: {value!r} is no number") from None
    return UnitOptions(**found)


def _settings(model: str, machine: MachineOptions) -> "tuple[Law, Values]":
    from detent.moves.spelling import read
    from detent.tuner.machine.bench import knob_of

    law, begin = read(model, machine.begin or [])
    given = {word.partition("=")[0].strip().lower() for word in machine.begin or []}
    needed = {setting.name.split()[0] for setting in law.settings} - {"D"}
    if missing := [name for name in dict.fromkeys(s.name.split()[0] for s in law.settings)
                   if name in needed and name.lower() not in given]:  # fmt: skip
        raise ValueError(
            f"--begin: say with which {', '.join(missing)} to begin; {knob_of(law).name} is what is made harder, so "
            "begin where the machine surely loses no step"
        )
    return law, begin


def _room(law: "Law", step: str | None, machine: MachineOptions) -> "Room":
    from detent.controllers.catalogue import unknown
    from detent.tuner.machine.carriage import Room

    names = [winding.name for winding in law.windings]
    if step is None and len(names) > 1:
        raise ValueError(
            f"--step: say what one step of the {law.model} is for the motor ({', '.join(names)}): steps are lost four "
            "full steps at once, and a loss that is looked for in the wrong size is overlooked"
        )
    if step is not None and step not in names:
        raise unknown(f"stepping of a {law.model}", step, tuple(names))
    winding = next((one for one in law.windings if step in (None, one.name)), None)
    if winding is None:
        raise ValueError(f"the steps of this {law.model} are no whole part of a full step: choose another step_size")
    if machine.travel is None:
        raise ValueError("--travel: say how many steps the carriage may go from where the switch closes")
    turn = 4 * winding.steps
    behind = 8 * turn if machine.behind is None else machine.behind
    rate = 100 * winding.steps if machine.safe_rate is None else machine.safe_rate
    return Room(machine.travel, behind, turn, rate, machine.approach)


def _plan(law: "Law", begin: "Values", moves: tuple[int, ...], room: "Room", machine: MachineOptions) -> "Plan":
    from detent.tuner.machine.session import Plan

    plan = Plan(law, begin, moves, room, machine.trials, machine.confirm, machine.reserve)
    _check_begin(plan)
    return plan


def _check_begin(plan: "Plan") -> None:
    """Settings of which the knob changes nothing prove nothing. ValueError."""
    from detent.moves.spelling import spelled
    from detent.tuner.machine.bench import knob_of

    law, begin, knob = plan.law, plan.begin, knob_of(plan.law)
    if not all(knob.low <= begin[name] <= knob.high for name in knob.settings):
        raise ValueError(f"--begin: {knob.name}=0 is no ramp at all: begin with a {knob.name} that makes a long one")
    hardest = knob.set(begin, knob.low if knob.longer else knob.high)
    if all(law.train(begin, steps).duration == law.train(hardest, steps).duration for steps in plan.moves):
        why = law.remark(begin) or "these moves have no ramp, or it is as short as can be"
        raise ValueError(f"--begin: with {spelled(law, begin)} a harder {knob.name} changes nothing: {why}")


def _carried_out(
    shell: "Blocking", plan: "Plan", bench: "Bench", log: Any, machine: MachineOptions, *, quiet: bool
) -> "Result":
    """The run, logged and told. Ctrl-C stops the axis through its ramp, a second one at once."""
    from detent.hosts.errors import DriverError
    from detent.tuner.machine.carriage import MachineError
    from detent.tuner.machine.recipe import Trial
    from detent.tuner.machine.session import replayed, run

    _, ahead, count, _ = replayed(plan, bench, log.past)  # before anything moves, or is written
    if isinstance(ahead, Trial):
        _ask(plan, bench, machine, quiet=quiet)
        if not log.past:
            log.write(plan.recorded(bench))
        elif not quiet:
            print(f"goes on behind {count} trials of {log.path}")
    tell = _teller(plan, quiet=quiet)

    def record(line: "Record") -> None:
        log.write(line)
        tell(line)

    try:
        return shell.perform(run(plan, bench, record, log.past))
    except (MachineError, DriverError):
        _leave_safe(shell, plan, bench)
        raise
    except (KeyboardInterrupt, SystemExit):  # SIGTERM is the latter
        _stop(shell, plan, bench)
        print(f"  the log is {log.path}; with the carriage on the witness the same command goes on from it",
              file=sys.stderr)  # fmt: skip
        raise


def _stop(shell: "Blocking", plan: "Plan", bench: "Bench") -> None:
    """Stop the axis, whatever else is pressed, and say whether it stands, and with which settings."""
    from detent.hosts.errors import DriverError

    print("detent: stopping the axis", file=sys.stderr)
    try:
        try:
            shell.perform(bench.end())
        except KeyboardInterrupt:
            shell.perform(bench.driver.halt())
            shell.perform(bench.rest(10.0))
    except DriverError as error:
        print(f"detent: {error}\n  it could NOT be seen to stand. No motion is longer than the longest move; switch "
              "off the drive if in doubt", file=sys.stderr)  # fmt: skip
    else:
        print("detent: the axis stands", file=sys.stderr)
        _leave_safe(shell, plan, bench)


def _leave_safe(shell: "Blocking", plan: "Plan", bench: "Bench") -> None:
    """Give the unit the settings again with which it began; say whether it has them."""
    from detent.hosts.errors import DriverError
    from detent.moves.spelling import spelled
    from detent.tuner.machine.session import left_safe

    begin = spelled(plan.law, plan.begin)
    try:
        shell.perform(left_safe(plan, bench))
    except (DriverError, KeyboardInterrupt) as error:
        why = f": {error}" if str(error) else ""
        print(f"detent: it may have the settings of a trial{why}; give it {begin}", file=sys.stderr)
    else:
        print(f"detent: it has {begin} again", file=sys.stderr)


def _ask(plan: "Plan", bench: "Bench", machine: MachineOptions, *, quiet: bool) -> None:
    """Say what will move how far; on a terminal wait for a yes."""
    from detent.moves.spelling import spelled

    room = plan.room
    if quiet:
        return
    print(f"{bench.title} at {machine.on}, witness {machine.witness}")
    way = "plus" if bench.away > 0 else "minus"
    print(
        f"  goes up to {room.travel} steps {way} from there, and {room.behind} behind it; back at {room.rate} steps/s"
    )
    first = bench.knob.set(plan.begin, bench.knob.gentlest(plan.begin))
    print(f"  begins with {spelled(plan.law, first)}, and makes {bench.knob.name} harder until a step is lost")
    if machine.yes or not sys.stdin.isatty():
        return
    print("  The carriage stands on the switch, and nobody is near it? Keep a hand on the switch of the supply.")
    if input("  yes, begin [y/N] ").strip().lower() not in ("y", "yes"):
        raise SystemExit(0)


def _teller(plan: "Plan", *, quiet: bool) -> "Callable[[Record], None]":
    """Prints a line for each trial, and how long the last part will take."""
    began: list[float] = []
    last = [time.monotonic()]

    def tell(line: "Record") -> None:
        now = time.monotonic()
        match line["kind"]:
            case "trial":
                what = f"{line['early']:+d} steps: LOST" if line["lost"] else "none lost"
                more = ""
                if line["confirms"]:
                    began.append(now - last[0])
                    total = plan.confirm * len(plan.moves)
                    left = (total - len(began)) * sum(began) / len(began)
                    more = f"  ({len(began)} of {total}, {_minutes(left)} left)"
                    if line["lost"]:
                        began.clear()
                print(f"trial {line['number']}: {line['settings']}, {line['steps']} steps: {what}{more}", flush=True)
            case "mishap" | "doubt":
                print(f"  {line['what']}", flush=True)
            case _:
                return
        last[0] = now

    return (lambda _: None) if quiet else tell


def _minutes(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"


def _told(plan: "Plan", bench: "Bench", result: "Result", path: Path) -> None:
    """What the trials have shown, what they prove, and what not."""
    from detent.moves.spelling import spelled

    found, knob = result.found, bench.knob
    bad = f"lost with {knob.name}={found.bad}" if found.bad is not None else "the hardest that the command takes"
    print(f"\nlast good: {spelled(plan.law, result.best)} ({bad}; {result.trials} trials, {result.lost} lost)")
    commands = plan.law.commands(result.shipped, plan.moves[0])
    print(f"ship:      {'  '.join((*commands.settings, commands.go))}")
    for steps in sorted(plan.moves):
        ship, best = (plan.law.train(values, steps).duration or 0 for values in (result.shipped, result.best))
        print(f"  {steps} steps in {ship * 1e-9:.4f} s ({best * 1e-9:.4f} s without the reserve)")
    tried = f"{found.clean} trials of each move" if len(plan.moves) > 1 else f"{found.clean} trials"
    looks = f", with {found.looks} settings tried" if found.looks > 1 else ""
    print(f"{tried} with it, none lost: less than {100 * result.rate:.2g} % are, at 95 %{looks}.")
    print(
        "  That holds for this load, supply and temperature, today. Of other days it says nothing: the reserve is for"
    )
    print(
        "  those, and no trial here has proved that it is enough. Only these moves were made, one way, from standstill."
    )
    print(f"every trial: {path}")


def _as_json(plan: "Plan", bench: "Bench", result: "Result", path: Path) -> None:
    import json

    commands = plan.law.commands(result.shipped, plan.moves[0])
    print(json.dumps({
        "model": plan.law.model, "knob": bench.knob.name, "good": result.found.good, "bad": result.found.bad,
        "settings": dict(result.shipped), "commands": [*commands.settings], "trials": result.trials,
        "lost": result.lost, "confirmed": result.found.clean, "below": result.rate, "looks": result.found.looks,
        "log": str(path),
    }))  # fmt: skip
