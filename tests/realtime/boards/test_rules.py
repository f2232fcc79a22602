"""The rules of the firmware, one by one: the fake board keeps them, and where there is a firmware it is asked too.

Each case is a few raw commands; what is compared is every answer, without its clocks.
"""

import select
import time
from collections.abc import Callable
from typing import Any

import pytest
from tests.realtime.boards.firmware_process import TERMINAL, with_firmware

from detent.realtime.boards.clock import nearest
from detent.realtime.boards.dictionary import BARE, Dictionary, Message
from detent.realtime.boards.fake.board import FakeBoard
from detent.realtime.boards.fake.port import FakePort
from detent.realtime.boards.link import Link
from detent.realtime.boards.ports import open_port
from detent.ticks import MS


class Raw:
    """Commands to a board and what it answers; a fake one in virtual time, another one in real time."""

    def __init__(self, terminal: str) -> None:
        if terminal:
            self.port: Any = open_port(terminal)
        else:
            fake = FakeBoard(moves=40)
            for pin in range(2, 64):
                fake.machine.set(f"gpio{pin}", True, fake.now)
            self.port = FakePort(fake)
        self.real, self._wall = bool(terminal), 0
        self.connect()
        if self.real:
            self.say("emergency_stop")
            self.wait(30)
            self.say("config_reset")
            time.sleep(0.2)
            while not self.port.reopen():
                time.sleep(0.05)
            self.connect()

    def connect(self) -> None:
        self.link, self.words, self.heard = Link(), BARE, list[Message]()
        self.link.sync(self.wall())
        self.pump(100, lambda: self.link.synced)
        data = b""
        while True:
            self.say("identify", offset=len(data), count=40)
            self.pump(500, lambda: bool(self.heard))
            piece = self.heard.pop().data("data")
            data += piece
            if not piece:
                break
        self.words = Dictionary.of_bytes(data)
        self.link.window = self.words.receive_window

    def wall(self) -> int:
        return time.monotonic_ns() if self.real else self._wall

    def say(self, name: str, **values: Any) -> None:
        numbers = {k: self.words.number("pin", v) if isinstance(v, str) else v for k, v in values.items()}
        self.link.send(self.words.encode(name, **numbers))
        self.link.flush(self.wall())
        self.port.send(self.link.take(), self.wall())

    def pump(self, ms: float, done: Callable[[], bool] = lambda: False) -> None:
        end = self.wall() + int(ms * MS)
        while self.wall() < end and not done():
            if self.real:
                select.select(self.port.reading(), (), (), 0.001)
            else:
                self._wall += MS // 10
            for payload, _ in self.link.receive(self.port.receive(self.wall()), self.wall()):
                self.heard += self.words.parse(payload)
            self.link.due(self.wall())
            self.port.send(self.link.take(), self.wall())

    def wait(self, ms: float) -> None:
        self.pump(ms)

    def now(self) -> int:
        """Its clock."""
        before = len(self.heard)
        self.say("get_clock")
        self.pump(500, lambda: len(self.heard) > before)
        return nearest(self.heard.pop().number("clock"), 1 << 32) & 0xFFFFFFFF

    def ms(self, ms: float) -> int:
        return int(self.words.frequency * ms / 1000)

    def configure(self, *commands: tuple[str, dict[str, Any]]) -> None:
        self.say("allocate_oids", count=len(commands))
        for oid, (name, values) in enumerate(commands):
            self.say(name, oid=oid, **values)
        self.say("finalize_config", crc=1)
        self.wait(5)

    def answers(self) -> list[tuple[str, dict[str, Any]]]:
        """What was heard, reasons as texts, without clocks and statistics."""
        found = []
        for message in self.heard:
            if message.name in ("stats", "clock", "starting"):
                continue
            values: dict[str, Any] = {k: v for k, v in message.values.items() if "clock" not in k}
            if "static_string_id" in values:
                values["static_string_id"] = self.words.reason(values["static_string_id"])
            found.append((message.name, values))
        return found


def stepper(raw: Raw, pulse: float = 0.002) -> tuple[str, dict[str, Any]]:
    return "config_stepper", {
        "step_pin": "gpio2",
        "dir_pin": "gpio3",
        "invert_step": 0,
        "step_pulse_ticks": raw.ms(pulse),
    }


def endstop() -> tuple[str, dict[str, Any]]:
    return "config_endstop", {"pin": "gpio10", "pull_up": 0}


def out(raw: Raw, longest: float = 0) -> tuple[str, dict[str, Any]]:
    return "config_digital_out", {
        "pin": "gpio6", "value": 0, "default_value": 0, "max_duration": raw.ms(longest)}  # fmt: skip


def steps(raw: Raw, ms: float, count: int, add: int = 0, oid: int = 0) -> None:
    raw.say("queue_step", oid=oid, interval=raw.ms(ms), count=count, add=add)


def both_ways(raw: Raw) -> None:
    raw.configure(stepper(raw))
    raw.say("reset_step_clock", oid=0, clock=raw.now() + raw.ms(40))
    raw.say("set_next_step_dir", oid=0, dir=1)
    steps(raw, 1, 5)
    raw.say("set_next_step_dir", oid=0, dir=0)
    steps(raw, 2, 8)
    raw.wait(120)
    raw.say("stepper_get_position", oid=0)


def reset_while_active(raw: Raw) -> None:
    raw.configure(stepper(raw))
    raw.say("reset_step_clock", oid=0, clock=raw.now() + raw.ms(40))
    steps(raw, 5, 9)
    raw.say("reset_step_clock", oid=0, clock=raw.now() + raw.ms(90))


def no_steps(raw: Raw) -> None:
    raw.configure(stepper(raw))
    raw.say("reset_step_clock", oid=0, clock=raw.now() + raw.ms(40))
    steps(raw, 5, 0)


def too_close(raw: Raw) -> None:
    raw.configure(stepper(raw))
    raw.say("reset_step_clock", oid=0, clock=raw.now() - raw.ms(40))
    steps(raw, 5, 3)


def too_far_in_the_past(raw: Raw) -> None:
    raw.configure(stepper(raw, pulse=2))
    raw.say("reset_step_clock", oid=0, clock=raw.now() + raw.ms(40))
    steps(raw, 5, 1)
    steps(raw, 0.01, 1)
    raw.wait(80)


def too_many(raw: Raw) -> None:
    raw.configure(stepper(raw))
    raw.say("get_config")
    raw.wait(20)
    size = raw.heard.pop().number("move_count")
    raw.say("reset_step_clock", oid=0, clock=raw.now() + raw.ms(400))
    for _ in range(size + 2):
        steps(raw, 50, 1)
    raw.wait(50)
    raw.heard = [message for message in raw.heard if message.name != "is_shutdown"]


def dropped_behind_a_trigger(raw: Raw) -> None:
    raw.configure(stepper(raw), ("config_trsync", {}))
    raw.say("reset_step_clock", oid=0, clock=raw.now() + raw.ms(30))
    raw.say("set_next_step_dir", oid=0, dir=1)
    steps(raw, 1, 4)
    raw.say("trsync_start", oid=1, report_clock=0, report_ticks=0, expire_reason=3)
    raw.say("stepper_stop_on_trigger", oid=0, trsync_oid=1)
    raw.wait(60)
    raw.say("trsync_trigger", oid=1, reason=9)
    raw.wait(5)
    steps(raw, 1, 5)
    raw.wait(40)
    raw.say("stepper_get_position", oid=0)
    raw.say("reset_step_clock", oid=0, clock=raw.now() + raw.ms(30))
    steps(raw, 1, 5)  # its direction is 0 again
    raw.wait(60)
    raw.say("stepper_get_position", oid=0)


def two_triggers(raw: Raw) -> None:
    raw.configure(stepper(raw), ("config_trsync", {}))
    raw.say("trsync_start", oid=1, report_clock=0, report_ticks=0, expire_reason=3)
    raw.say("stepper_stop_on_trigger", oid=0, trsync_oid=1)
    raw.say("stepper_stop_on_trigger", oid=0, trsync_oid=1)


def expired(raw: Raw) -> None:
    raw.configure(("config_trsync", {}))
    raw.say("trsync_start", oid=0, report_clock=0, report_ticks=0, expire_reason=7)
    raw.say("trsync_set_timeout", oid=0, clock=raw.now() + raw.ms(20))
    raw.wait(60)


def level_already(raw: Raw) -> None:
    raw.configure(endstop(), ("config_trsync", {}))
    raw.say("trsync_start", oid=1, report_clock=0, report_ticks=0, expire_reason=7)
    sample = raw.ms(0.05)
    raw.say("endstop_home", oid=0, clock=raw.now() + raw.ms(30), sample_ticks=sample, sample_count=2, rest_ticks=sample,
            pin_value=1, trsync_oid=1, trigger_reason=5)  # fmt: skip
    raw.wait(60)
    raw.say("endstop_query_state", oid=0)
    raw.say("endstop_home", oid=0, clock=0, sample_ticks=0, sample_count=0, rest_ticks=0, pin_value=0, trsync_oid=1,
            trigger_reason=0)  # fmt: skip
    raw.say("endstop_query_state", oid=0)


def stopped_by_an_endstop(raw: Raw) -> None:
    raw.configure(stepper(raw), endstop(), ("config_trsync", {}))
    raw.say("trsync_start", oid=2, report_clock=0, report_ticks=0, expire_reason=7)
    raw.say("stepper_stop_on_trigger", oid=0, trsync_oid=2)
    begin, sample = raw.now() + raw.ms(40), raw.ms(0.05)
    raw.say("reset_step_clock", oid=0, clock=begin)
    raw.say("set_next_step_dir", oid=0, dir=1)
    steps(raw, 1, 100)
    raw.say("endstop_home", oid=1, clock=begin + raw.ms(20.5), sample_ticks=sample, sample_count=2, rest_ticks=sample,
            pin_value=1, trsync_oid=2, trigger_reason=5)  # fmt: skip
    raw.wait(100)
    raw.say("stepper_get_position", oid=0)


def fed_too_late(raw: Raw) -> None:
    raw.configure(out(raw, 100))
    raw.say("queue_digital_out", oid=0, clock=raw.now() + raw.ms(20), on_ticks=1)
    raw.wait(200)


def fed_in_time(raw: Raw) -> None:
    raw.configure(out(raw, 600))
    for _ in range(4):
        raw.say("queue_digital_out", oid=0, clock=raw.now() + raw.ms(20), on_ticks=1)
        raw.wait(250)
    raw.say("queue_digital_out", oid=0, clock=raw.now() + raw.ms(20), on_ticks=0)
    raw.wait(200)


def fed_for_too_long(raw: Raw) -> None:
    raw.configure(out(raw, 100))
    raw.say("queue_digital_out", oid=0, clock=raw.now() + raw.ms(20), on_ticks=1)
    raw.wait(50)
    raw.say("queue_digital_out", oid=0, clock=raw.now() + raw.ms(150), on_ticks=1)
    raw.wait(20)


def late_output(raw: Raw) -> None:
    raw.configure(out(raw))
    raw.say("queue_digital_out", oid=0, clock=raw.now() - raw.ms(20), on_ticks=1)


def update_with_a_queue(raw: Raw) -> None:
    raw.configure(out(raw))
    raw.say("queue_digital_out", oid=0, clock=raw.now() + raw.ms(50), on_ticks=1)
    raw.say("update_digital_out", oid=0, value=1)


def wrong_oid(raw: Raw) -> None:
    raw.configure(out(raw))
    steps(raw, 1, 1)


def oids_twice(raw: Raw) -> None:
    raw.say("allocate_oids", count=2)
    raw.say("allocate_oids", count=2)


def finalized_twice(raw: Raw) -> None:
    raw.configure(out(raw))
    raw.say("finalize_config", crc=2)


def nine_buttons(raw: Raw) -> None:
    raw.configure(("config_buttons", {"button_count": 9}))


def cleared_without_need(raw: Raw) -> None:
    raw.say("clear_shutdown")


def shut_down_and_cleared(raw: Raw) -> None:
    raw.configure(stepper(raw))
    raw.say("emergency_stop")
    raw.wait(10)
    raw.say("stepper_get_position", oid=0)
    raw.wait(10)
    raw.say("clear_shutdown")
    raw.say("stepper_get_position", oid=0)
    raw.wait(10)
    steps(raw, 1, 1)  # dropped: it wants a clock
    raw.say("stepper_get_position", oid=0)


def what_follows_a_shutdown_in_its_block(raw: Raw) -> None:
    raw.configure(stepper(raw))
    raw.link.send(raw.words.encode("emergency_stop"))
    raw.link.send(raw.words.encode("clear_shutdown"))
    raw.link.send(raw.words.encode("stepper_get_position", oid=0))
    raw.link.flush(raw.wall())
    raw.wait(20)
    raw.say("stepper_get_position", oid=0)


RULES: dict[Callable[[Raw], None], Any] = {
    both_ways: [("stepper_position", {"oid": 0, "pos": -3})],
    reset_while_active: "Can't reset time when stepper active",
    no_steps: "Invalid count parameter",
    too_close: "Timer too close",
    too_far_in_the_past: "Stepper too far in past",
    too_many: "Move queue overflow",
    dropped_behind_a_trigger: [
        ("trsync_state", {"oid": 1, "can_trigger": 0, "trigger_reason": 9}),
        ("stepper_position", {"oid": 0, "pos": 4}),
        ("stepper_position", {"oid": 0, "pos": -1}),
    ],
    two_triggers: "Can't add signal that is already active",
    expired: [("trsync_state", {"oid": 0, "can_trigger": 0, "trigger_reason": 7})],
    level_already: [
        ("trsync_state", {"oid": 1, "can_trigger": 0, "trigger_reason": 5}),
        ("endstop_state", {"oid": 0, "homing": 1, "pin_value": 1}),
        ("endstop_state", {"oid": 0, "homing": 0, "pin_value": 1}),
    ],
    stopped_by_an_endstop: [
        ("trsync_state", {"oid": 2, "can_trigger": 0, "trigger_reason": 5}),
        ("stepper_position", {"oid": 0, "pos": 20}),
    ],
    fed_too_late: "Missed scheduling of next digital out event",
    fed_in_time: [],
    fed_for_too_long: "Scheduled digital out event will exceed max_duration",
    late_output: "Timer too close",
    update_with_a_queue: "update_digital_out not valid with active queue",
    wrong_oid: "Invalid oid type",
    oids_twice: "oids already allocated",
    finalized_twice: "Already finalized",
    nine_buttons: "Max of 8 buttons",
    cleared_without_need: "Shutdown cleared when not shutdown",
    shut_down_and_cleared: [
        ("shutdown", {"static_string_id": "Command request"}),
        ("is_shutdown", {"static_string_id": "Command request"}),
        ("stepper_position", {"oid": 0, "pos": 0}),
        ("stepper_position", {"oid": 0, "pos": 0}),
    ],
    what_follows_a_shutdown_in_its_block: [
        ("shutdown", {"static_string_id": "Command request"}),
        ("is_shutdown", {"static_string_id": "Command request"}),
    ],
}


def prove(rule: Callable[[Raw], None], terminal: str) -> None:
    raw = Raw(terminal)
    try:
        rule(raw)
        raw.wait(30)
    finally:
        raw.port.close()
    wanted = RULES[rule]
    found = raw.answers()
    if isinstance(wanted, str):
        assert found[0] == ("shutdown", {"static_string_id": wanted})
    else:
        assert found == wanted


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_the_fake_board_keeps_the_rule(rule: Callable[[Raw], None]) -> None:
    prove(rule, "")


@with_firmware
@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_the_firmware_keeps_the_rule(rule: Callable[[Raw], None]) -> None:
    prove(rule, TERMINAL)
