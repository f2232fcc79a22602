"""What is kept on disk, under everything that can come between: kills, calls that fail, a power failure, a full disk.

A file is the old one or the new one, never a part of one, and what was acknowledged is there.
"""

import contextlib
import errno
import itertools
import os
import resource
import shutil
import signal
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any, Final, NamedTuple

from detent.outputs import files
from detent.outputs.files import write_whole
from detent.realtime import images
from detent.realtime.images import Images, ImageUnreadable, unpack
from detent.realtime.trial_log import LogUnusable, TrialLog

MODEL: Final = "dcb-274"
SIZE: Final = 2048  # bytes of an image: the NV memory of a DCB-274


def image(number: int) -> bytes:
    """The image of that number, all of it made from the number."""
    return number.to_bytes(4, "big") * (SIZE // 4)


def number_in(data: bytes) -> int:
    """The number of an image. Raises AssertionError for a torn one."""
    number = int.from_bytes(data[:4], "big")
    assert data == image(number), "a torn image"
    return number


def kept(path: Path) -> int:
    """The number of the image in a file; -1 if there is no file. Raises AssertionError for one that cannot be read."""
    try:
        return number_in(unpack(path.read_bytes(), MODEL))
    except FileNotFoundError:
        return -1
    except ImageUnreadable as error:
        raise AssertionError(f"an image that cannot be read: {error}") from error


class Store(NamedTuple):
    """A way to keep numbers: how one is written, and which one is there (-1: none)."""

    write: Callable[[Path, int], object]
    read: Callable[[Path], int]


def _save(folder: Path, number: int) -> bool:
    owner = Images(folder, "cell", {"bar": MODEL}, warn=lambda text: None)
    try:
        return owner.save("bar", image(number))
    finally:
        owner.close()


def _export(folder: Path, number: int) -> None:
    write_whole(folder / "out.vcd", image(number))


def _exported(folder: Path) -> int:
    try:
        return number_in((folder / "out.vcd").read_bytes())
    except FileNotFoundError:
        return -1


def _log(folder: Path, number: int) -> None:
    with TrialLog(folder / "run.jsonl") as log:
        log.write({"kind": "plan" if not log.past else "trial", "number": number, "filling": "x" * 3000})


def _logged(folder: Path) -> int:
    path = folder / "run.jsonl"
    if not path.exists() or not path.stat().st_size:
        return -1
    try:
        with TrialLog(path) as log:
            numbers = [record["number"] for record in log.past]
    except LogUnusable as error:
        raise AssertionError(str(error)) from error
    assert numbers == list(range(len(numbers))), "a record is missing"
    return len(numbers) - 1


STORES: Final = {
    "EEPROM images": Store(_save, lambda folder: kept(folder / "cell.bar.eeprom")),
    "exports, saves of the workbench, restores": Store(_export, _exported),
    "logs of tuning": Store(_log, _logged),
}


def _fork() -> int:
    """As `os.fork`. The child does nothing but save and end, whatever threads there are here."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        return os.fork()


# -- kills -------------------------------------------------------------------------------------------------


def killed(store: Store, folder: Path, draw: Random) -> int:
    """A process that keeps one number after the other is killed in the middle; how many it had acknowledged.

    Raises AssertionError if what is there is torn, or is neither the last that was acknowledged nor the next.
    """
    told, telling = os.pipe()
    first = store.read(folder) + 1
    child = _fork()
    if not child:
        try:
            os.close(told)
            for number in itertools.count(first):
                store.write(folder, number)
                os.write(telling, b".")
        finally:
            os._exit(1)
    os.close(telling)
    wanted = draw.randint(1, 8)
    acknowledged = 0
    while acknowledged < wanted:
        acknowledged += len(os.read(told, wanted - acknowledged))
    for _ in range(draw.randrange(3000)):  # somewhere within a save
        pass
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    while more := os.read(told, 4096):
        acknowledged += len(more)
    os.close(told)
    there = store.read(folder)
    last = first + acknowledged - 1
    assert there in (last, last + 1), f"{last} was acknowledged, {there} is there"
    return acknowledged


# -- calls that fail ---------------------------------------------------------------------------------------

CALLS: Final = ("open", "fsync", "link", "replace", "rename", "unlink", "close", "write")


class _Counting:
    """The module `os` with calls that are counted, and one of them that fails."""

    def __init__(self, fails: int, error: int) -> None:
        self.count, self._fails, self._error = 0, fails, error

    def __getattr__(self, name: str) -> Any:
        real = getattr(os, name)
        if name not in CALLS:
            return real

        def call(*given: Any, **named: Any) -> Any:
            self.count += 1
            if self.count == self._fails:
                if name == "close":  # a descriptor that fails to close is closed all the same
                    real(*given, **named)
                raise OSError(self._error, os.strerror(self._error))
            return real(*given, **named)

        return call


@contextlib.contextmanager
def failing(number: int, error: int) -> Iterator[_Counting]:
    """The call of that number (from 1) that a save makes to the system fails."""
    counting = _Counting(number, error)
    before = images.os, files.os
    images.os = files.os = counting  # type: ignore[assignment]
    methods = {name: getattr(Path, name) for name in ("unlink", "rename", "replace")}
    try:
        for name, method in methods.items():
            setattr(Path, name, _failing_method(counting, name, method))
        yield counting
    finally:
        images.os, files.os = before
        for name, method in methods.items():
            setattr(Path, name, method)


def _failing_method(counting: _Counting, name: str, method: Any) -> Any:
    def call(self: Path, *given: Any, **named: Any) -> Any:
        counting.count += 1
        if counting.count == counting._fails:
            raise OSError(counting._error, os.strerror(counting._error), str(self))
        return method(self, *given, **named)

    return call


def every_call_fails(folder: Path) -> int:
    """Each call of a save of an image, and of an export, fails in turn; how many there were."""
    tried = 0
    for error in (errno.EIO, errno.ENOSPC, errno.EACCES):
        for number in itertools.count(1):
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            owner = Images(folder, "cell", {"bar": MODEL}, warn=lambda text: None)
            assert owner.save("bar", image(1))
            with failing(number, error) as counting:
                done = owner.save("bar", image(2))
            there = kept(folder / "cell.bar.eeprom")
            assert there == (2 if done else 1), f"call {number} fails: told {done}, and {there} is there"
            assert owner.save("bar", image(3)), "the next save fails too"
            assert kept(folder / "cell.bar.eeprom") == 3
            owner.close()
            if counting.count < number:
                break
            tried += 1
        for number in itertools.count(1):
            _export(folder, 1)
            done = True
            with failing(number, error) as counting:
                try:
                    _export(folder, 2)
                except OSError as failed:
                    done = False
                    about = str(failed.filename)
                    if not about.endswith("out.vcd"):
                        raise AssertionError(f"an error about {about}") from failed
            assert _exported(folder) in ((2,) if done else (1, 2))
            if counting.count < number:
                break
            tried += 1
    return tried


# -- a power failure ---------------------------------------------------------------------------------------


class Disk:
    """What a save does to a folder, call by call; and what is left of it when the power fails behind any of them.

    What was written to a file and not yet synced may be lost, all of it or a part; names that were changed since the
    folder was synced last may be the old ones from any of them on.
    """

    def __init__(self) -> None:
        self.steps: list[tuple[str, str, Any]] = []  # what (new, data, sync ...), a name, what else

    def states(self, names: dict[str, bytes]) -> Iterator[dict[str, bytes]]:
        """Every state that the folder may be in after a power failure; `names` is what it was before."""
        for stop in range(len(self.steps) + 1):
            done = self.steps[:stop]
            last = max((n for n, step in enumerate(done) if step[0] == "folder"), default=-1)
            changes = [n for n, step in enumerate(done) if n > last and step[0] in ("link", "name", "drop", "new")]
            for kept_changes in range(len(changes) + 1):
                behind = changes[kept_changes] if kept_changes < len(changes) else len(self.steps)
                for part in (0.0, 0.5, 1.0):
                    yield self._after(done, names, behind, part)

    def _after(
        self, done: list[tuple[str, str, Any]], names: dict[str, bytes], behind: int, part: float
    ) -> dict[str, bytes]:
        files_of = dict(enumerate(names.values()))
        folder = dict(zip(names, files_of, strict=True))
        synced = set(files_of)
        where: dict[str, int] = dict(folder)  # as the running process sees the names
        for n, (what, name, more) in enumerate(done):
            lost = n >= behind
            match what:
                case "new":
                    where[name] = len(files_of)
                    files_of[where[name]] = b""
                    if not lost:
                        folder[name] = where[name]
                case "data":
                    files_of[where[name]] += more
                case "sync":
                    synced.add(where[name])
                case "link":
                    where[name] = where[more]
                    if not lost:
                        folder[name] = where[name]
                case "name":
                    where[name] = where.pop(more)
                    if not lost:
                        folder[name] = where[name]
                        folder.pop(more, None)
                case "drop":
                    where.pop(name, None)
                    if not lost:
                        folder.pop(name, None)
        return {
            name: data if number in synced else data[: int(len(data) * part)]
            for name, number in folder.items()
            for data in (files_of[number],)
        }


@contextlib.contextmanager
def recorded(disk: Disk) -> Iterator[None]:
    """What is done to files meanwhile is noted on `disk` too."""
    real, real_fdopen, real_unlink, real_replace = os, os.fdopen, Path.unlink, Path.replace
    names: dict[int, str] = {}

    class Recording:
        def __getattr__(self, name: str) -> Any:
            return getattr(real, name)

        @staticmethod
        def open(path: Any, flags: int, *given: Any, **named: Any) -> int:
            descriptor = real.open(path, flags, *given, **named)
            names[descriptor] = "" if real.path.isdir(path) else Path(path).name
            if flags & real.O_CREAT:
                disk.steps.append(("new", names[descriptor], None))
            return descriptor

        @staticmethod
        def fdopen(descriptor: int, mode: str) -> Any:
            file = real_fdopen(descriptor, mode)
            write = file.write

            class Noted:
                def __enter__(self) -> Any:
                    file.__enter__()
                    return self

                def __exit__(self, *given: Any) -> Any:
                    return file.__exit__(*given)

                def __getattr__(self, name: str) -> Any:
                    return getattr(file, name)

                def write(self, data: bytes) -> int:
                    disk.steps.append(("data", names[descriptor], bytes(data)))
                    return int(write(data))

            return Noted()

        @staticmethod
        def fsync(descriptor: int) -> None:
            real.fsync(descriptor)
            disk.steps.append(("sync", names[descriptor], None) if names[descriptor] else ("folder", "", None))

        @staticmethod
        def link(old: Any, new: Any, **named: Any) -> None:
            real.link(old, new, **named)
            disk.steps.append(("link", Path(new).name, Path(old).name))

        @staticmethod
        def replace(old: Any, new: Any) -> None:
            real.replace(old, new)
            disk.steps.append(("name", Path(new).name, Path(old).name))

    def unlink(self: Path, missing_ok: bool = False) -> None:
        there = self.exists()
        real_unlink(self, missing_ok=missing_ok)
        if there:
            disk.steps.append(("drop", self.name, None))

    def replace(self: Path, target: Any) -> Any:
        found = real_replace(self, target)
        disk.steps.append(("name", Path(target).name, self.name))
        return found

    before = images.os, files.os
    images.os = files.os = Recording()  # type: ignore[assignment]
    Path.unlink, Path.replace = unlink, replace  # type: ignore[method-assign, assignment]
    try:
        yield
    finally:
        images.os, files.os = before
        Path.unlink, Path.replace = real_unlink, real_replace  # type: ignore[method-assign]


def power_fails(folder: Path) -> int:
    """After each step of a save, and an export, in every way that a disk may take it; how many states there are."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    owner = Images(folder, "cell", {"bar": MODEL}, warn=lambda text: None)
    assert owner.save("bar", image(1))
    before = {path.name: path.read_bytes() for path in folder.iterdir() if path.suffix != ".lock"}
    disk, tried = Disk(), 0
    with recorded(disk):
        assert owner.save("bar", image(2))
    owner.close()
    kinds = {step[0] for step in disk.steps}
    assert {"new", "data", "sync", "name", "folder"} <= kinds, f"the save is not seen: {kinds}"
    for state in disk.states(before):
        tried += 1
        assert number_in(unpack(state["cell.bar.eeprom"], MODEL)) in (1, 2)
    assert number_in(unpack(list(disk.states(before))[-1]["cell.bar.eeprom"], MODEL)) == 2, "acknowledged, and lost"
    _export(folder, 1)
    before = {"out.vcd": (folder / "out.vcd").read_bytes()}
    disk = Disk()
    with recorded(disk):
        _export(folder, 2)
    for state in disk.states(before):
        tried += 1
        assert number_in(state["out.vcd"]) in (1, 2)
    return tried


# -- no room, no folder --------------------------------------------------------------------------------------


def disk_is_full(folder: Path) -> int:
    """A process may write no further than any byte of an image: what was there stays, and the next save goes well."""
    tried = 0
    for room in range(0, SIZE + 60, 97):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        assert _save(folder, 1)
        child = _fork()
        if not child:
            code = 2
            try:
                signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
                resource.setrlimit(resource.RLIMIT_FSIZE, (room, resource.RLIM_INFINITY))
                code = int(_save(folder, 2))
                with contextlib.suppress(OSError):
                    _export(folder, 2)
            finally:
                os._exit(code)
        done = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        assert done in (0, 1), "the save broke"
        assert kept(folder / "cell.bar.eeprom") == (2 if done else 1)
        assert _exported(folder) in (-1, 2)
        assert _save(folder, 3)
        tried += 1
    return tried


def folder_vanishes(folder: Path) -> int:
    """The state folder goes away while a cell is served, and comes back: a save fails with a word, the next is kept."""
    shutil.rmtree(folder, ignore_errors=True)
    warned: list[str] = []
    owner = Images(folder, "cell", {"bar": MODEL}, warn=warned.append)
    assert owner.save("bar", image(1))
    shutil.rmtree(folder)
    assert not owner.save("bar", image(2))
    assert len(warned) == 1
    assert "\n" not in warned[0]
    folder.mkdir()
    assert owner.save("bar", image(3))
    assert kept(folder / "cell.bar.eeprom") == 3
    owner.close()
    return 3
