"""Searches for the fastest settings from the Motion page: one at a time, in a process of its own.

What windows see of it is ``tuning`` (how far it is), ``tuning.found`` and ``tuning.map`` in the table.
"""

import asyncio
import contextlib
import json
import os
import sys
from asyncio.subprocess import DEVNULL, PIPE, Process
from collections.abc import Sequence
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from detent.motors.variants import SPREAD
from detent.moves.law import clipped
from detent.tuner.judge import judge_of
from detent.tuner.report import option_lines
from detent.tuner.spaces import Point
from detent.tuner.task import Task, TunerError, moves_of
from detent.workbench import rigs
from detent.workbench.answers import PickedSettings
from detent.workbench.beside import beside
from detent.workbench.live import Live
from detent.workbench.moves import Axis, Moves
from detent.workbench.pipe import packed
from detent.workbench.rigs import Form, Name
from detent.workbench.tuning_process import STOP, Order

LONGEST = 1 << 22  # bytes of a line that the search says
IDLE = {"state": "idle", "done": 0, "total": 0, "best": None, "doing": "", "left": None, "words": ""}


class Asked(BaseModel):
    """What is to be fast: 200,1000x3; how many fresh variants prove it; the map, too; all corners must make it."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    moves: Name
    variants: Annotated[int, Field(ge=16, le=100_000)] = 2048
    corners: bool = True
    map: bool = True
    seed: Annotated[int, Field(ge=0, le=1_000_000)] = 1
    vary: Name = ""


class Tuning:
    """The calls of the Motion page that search: ``tuning_begin``, ``tuning_stop``, ``tuning_pick``."""

    def __init__(self, moves: Moves, live: Live) -> None:
        self._moves, self._live = moves, live
        self._process: Process | None = None
        self._reading: asyncio.Task[None] | None = None
        self._began = 0.0
        self._told: dict[str, Any] = dict(IDLE)
        self._task: Task | None = None
        self._point: Point | None = None
        self._spare = ""  # a line that changes nothing in the unit
        self._picking = asyncio.Lock()
        live.put({"tuning": self._told, "tuning.found": None, "tuning.map": None})
        for call in (self.begin, self.stop, self.pick):
            live.offer(f"tuning_{call.__name__}", call)

    async def begin(self, wanted: Axis, form: Form, asked: Asked) -> None:
        """Search for the fastest settings of an axis, in place of those that were found before. ValueError."""
        if self._process is not None:
            raise ValueError("a search is under way: stop it first")
        law = self._moves.law(wanted)
        made = rigs.made(law, form, self._moves.motors(), self._moves.entry(wanted))
        options = dict(self._moves.options(wanted))
        spread = SPREAD.changed(ranges_of(asked.vary))
        try:
            task = Task(law.model, made.rig, moves_of(asked.moves), options, self._moves.axis(wanted), spread,
                        asked.seed, asked.corners, final=asked.variants)  # fmt: skip
        except TunerError as error:
            raise ValueError(str(error).replace("--moves", "moves", 1)) from None  # here it is a field
        self._task, self._point = task, None
        self._spare = f"{options['step_size']}!" if "step_size" in options else ""
        self._live.put({"tuning.found": None, "tuning.map": None})
        self._began = asyncio.get_running_loop().time()
        about = {"unit": wanted.unit, "axis": wanted.axis, "real": wanted.real, "model": law.model,
                 "motor": made.rig.motor.name, "moves": asked.moves, "values": clipped(law, wanted.values)}  # fmt: skip
        self._tell(**{**IDLE, **about, "state": "searching", "doing": "begins"})
        threads = {"NUMBA_NUM_THREADS": str(max((os.cpu_count() or 2) - 1, 1))}  # a processor is left for the cell
        # a session of its own: Ctrl-C at the terminal is for the workbench; without it a search ends by itself
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-P", "-m", "detent.workbench.tuning_process",
            stdin=PIPE, stdout=PIPE, stderr=DEVNULL, start_new_session=True, limit=LONGEST,
            env={**os.environ, **threads},
        )  # fmt: skip
        assert process.stdin is not None
        process.stdin.write(packed(Order(task, asked.map)))
        self._process = process
        self._reading = asyncio.create_task(self._read(process))

    async def stop(self) -> None:
        """End the search under way; what is known by then is told."""
        process = self._process
        if process is None or process.stdin is None:
            return
        self._tell(doing="stops")
        with contextlib.suppress(ConnectionError):
            process.stdin.write(STOP)
            await process.stdin.drain()

    async def pick(self, x: int, y: int) -> PickedSettings:
        """The settings at a place of the map, given by its two values: what would be sent, and how long moves take."""
        task, point = self._task, self._point
        if task is None or point is None:
            raise ValueError("there is no map: search first")
        async with self._picking:
            found = await beside(_picked, task, point, x, y)
        return {**found, "commands": self._needed(found["commands"]), "resets": self._needed(found["resets"])}

    def _needed(self, lines: Sequence[str]) -> list[str]:
        """Without a reset to the step size that the board has."""
        return [line for line in lines if line != self._spare]

    async def _read(self, process: Process) -> None:
        assert process.stdout is not None
        problem = ""
        with contextlib.suppress(ValueError, ConnectionError):  # a line that is none: it was killed
            while line := await process.stdout.readline():
                said = json.loads(line)
                problem = said.get("problem", problem)
                self._heard(said)
        if process.stdin is not None:
            process.stdin.close()
        status = await process.wait()
        self._process = None
        found = self._live.get("tuning.found")
        whole = isinstance(found, dict) and found.get("complete")
        if not problem and status:
            problem = f"the process of the search was ended ({status}): begin it again"
        state = "failed" if problem and not whole else "done" if whole else "stopped"
        self._tell(state=state, words=problem, left=None, doing="")

    def _heard(self, said: dict[str, Any]) -> None:
        if "progress" in said:
            done, total, best, doing = said["progress"]
            spent = asyncio.get_running_loop().time() - self._began
            left = round(spent * (total - done) / done) if 0 < done < total and spent > 1 else None
            self._tell(done=done, total=total, best=best, doing=doing, left=left)
        elif "found" in said:
            self._point = tuple(said["point"])
            found = said["found"]
            needed = {part: self._needed(found[part]) for part in ("commands", "resets")}
            self._live.put({"tuning.found": {**found, **needed}})
            if said["found"]["complete"]:
                self._began = asyncio.get_running_loop().time()
                self._tell(state="mapping", done=0, total=0, doing="map", left=None)
        elif "map" in said:
            self._live.put({"tuning.map": said["map"]})

    def _tell(self, **more: Any) -> None:
        self._told = {**self._told, **more}
        self._live.put({"tuning": self._told})


def ranges_of(text: str) -> dict[str, float | tuple[float, float]]:
    """Ranges as people write them: inertia=0.2, friction=0.3-2. ValueError."""
    found: dict[str, float | tuple[float, float]] = {}
    for word in filter(None, (word.strip() for word in text.split(","))):
        name, _, value = word.partition("=")
        low, dash, high = value.partition("-")
        try:
            found[name.strip().replace(" ", "_")] = (float(low), float(high)) if dash else float(low)
        except ValueError:
            raise ValueError(f"{word}: write inertia=0.2, or friction=0.3-2") from None
    return found


def _picked(task: Task, point: Point, x: int, y: int) -> PickedSettings:
    judge = judge_of(task)
    here = judge.space.on_plane(point, x, y)
    found = judge.trains(here) if judge.space.admits(here) else None
    if found is None:
        raise ValueError("there are no such settings: a start speed above the slew speed, or a table that cannot be")
    profile, _ = found
    return {
        "settings": dict(profile.values), "options": dict(profile.options), "part": profile.part,
        "commands": list(profile.settings), "go": [profile.go(move.steps) for move in task.moves],
        "times": list(judge.times(here) or ()), "time": judge.time(here), "settings_words": str(profile),
        "option_lines": option_lines(profile), "resets": list(profile.before),
    }  # fmt: skip
