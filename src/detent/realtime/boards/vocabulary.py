"""What Detent says to a board and hears from it: the commands and responses of the firmware, by what they are for.

Fields are found by their names in the dictionary of the firmware itself, whose numbers differ from build to build.
"""

from collections.abc import Mapping, Set
from typing import TypeAlias

from detent.realtime.boards.dictionary import Dictionary
from detent.realtime.boards.setup import BoardSetup
from detent.ticks import SECOND

Words: TypeAlias = Mapping[str, tuple[str, ...]]
"""Commands and responses with the fields that are used of each."""

MOST_WATCHDOG = 1 << 30  # ticks: the firmware's clock has 32 bits
LEAST_WINDOW = 128  # bytes that a board takes at once; with less, steps wait for each other

ALWAYS: Words = {
    "allocate_oids": ("count",),
    "get_config": (),
    "config": ("is_config", "crc", "is_shutdown", "move_count"),
    "finalize_config": ("crc",),
    "get_clock": (),
    "clock": ("clock",),
    "get_uptime": (),
    "uptime": ("high", "clock"),
    "emergency_stop": (),
    "clear_shutdown": (),
    "shutdown": ("clock", "static_string_id"),
    "is_shutdown": ("static_string_id",),
}
OF_STEPPERS: Words = {
    "config_stepper": ("oid", "step_pin", "dir_pin", "invert_step", "step_pulse_ticks"),
    "queue_step": ("oid", "interval", "count", "add"),
    "set_next_step_dir": ("oid", "dir"),
    "reset_step_clock": ("oid", "clock"),
    "stepper_get_position": ("oid",),
    "stepper_position": ("oid", "pos"),
    "stepper_stop_on_trigger": ("oid", "trsync_oid"),
    "config_trsync": ("oid",),
    "trsync_start": ("oid", "report_clock", "report_ticks", "expire_reason"),
    "trsync_set_timeout": ("oid", "clock"),
    "trsync_trigger": ("oid", "reason"),
    "trsync_state": ("oid", "can_trigger", "trigger_reason", "clock"),
    "endstop_home": (
        "oid", "clock", "sample_ticks", "sample_count", "rest_ticks", "pin_value", "trsync_oid", "trigger_reason",
    ),
}  # fmt: skip
OF_INPUTS: Words = {
    "config_endstop": ("oid", "pin", "pull_up"),
    "endstop_query_state": ("oid",),
    "endstop_state": ("oid", "homing", "next_clock", "pin_value"),
    "config_buttons": ("oid", "button_count"),
    "buttons_add": ("oid", "pos", "pin", "pull_up"),
    "buttons_query": ("oid", "clock", "rest_ticks", "retransmit_count", "invert"),
    "buttons_ack": ("oid", "count"),
    "buttons_state": ("oid", "ack_count", "state"),
}
OF_OUTPUTS: Words = {
    "config_digital_out": ("oid", "pin", "value", "default_value", "max_duration"),
    "queue_digital_out": ("oid", "clock", "on_ticks"),
    "update_digital_out": ("oid", "value"),
}
OF_UARTS: Words = {
    "config_tmcuart": ("oid", "rx_pin", "pull_up", "tx_pin", "bit_time"),
    "tmcuart_send": ("oid", "write", "read"),
    "tmcuart_response": ("oid", "read"),
}
OF_SPI: Words = {
    "config_spi": ("oid", "pin", "cs_active_high"),
    "spi_transfer": ("oid", "data"),
    "spi_transfer_response": ("oid", "response"),
}
EVERYTHING: Words = {**ALWAYS, **OF_STEPPERS, **OF_INPUTS, **OF_OUTPUTS, **OF_UARTS, **OF_SPI}


def required(setup: BoardSetup) -> Words:
    """What the firmware of a board has to know."""
    found = dict(ALWAYS)
    for present, words in (
        (setup.steppers, OF_STEPPERS), (setup.steppers or setup.inputs, OF_INPUTS), (setup.outputs, OF_OUTPUTS),
        ([chip for chip in setup.drivers if chip.uart is not None], OF_UARTS),
        ([chip for chip in setup.drivers if chip.uart is None], OF_SPI),
    ):  # fmt: skip
        if present:
            found |= words
    return found


def unsuited(setup: BoardSetup, found: Dictionary) -> tuple[str, str, str] | None:
    """Why a board that said `found` of itself cannot be what `setup` wants: item, key, and what to do."""
    missing = found.missing(required(setup))
    if missing or not found.frequency:
        return "", "", (f"its firmware ({found.version or 'without a version'}) has no {', '.join(missing)}; flash it "
                        "with a current one")  # fmt: skip
    window = found.receive_window
    if window is not None and window < LEAST_WINDOW:
        what = f"its firmware takes {window} bytes at once (RECEIVE_WINDOW), and steps come late with less than"
        return "", "", f"{what} {LEAST_WINDOW}; flash it with one that has a larger receive buffer"
    reserved = {found.number("pin", pin): use for pin, use in found.reserved.items() if found.has_pin(pin)}
    names: dict[int, tuple[str, str]] = {}
    for item, key, name in _all_pins(setup):
        try:
            number = found.number("spi_bus" if key == "bus" else "pin", name)
        except KeyError as error:
            return item, key, error.args[0]
        if key == "bus":
            continue
        if number in reserved:
            return item, key, f"the board needs {name} itself, for {reserved[number]}; use another pin"
        other, owner = names.setdefault(number, (name, f"{item}.{key}"))
        if other != name:  # under one name it was looked for before
            return item, key, f"{name} is the pin {other}, which is taken by {owner}; use another for one of them"
    most = MOST_WATCHDOG // found.frequency
    for out in setup.outputs:
        if out.watchdog is not None and out.watchdog * found.frequency // SECOND > MOST_WATCHDOG:
            what = f"{out.watchdog / SECOND:g} s is more than its clock can count; take {most} s or less"
            return out.name, "watchdog", what
    return None


def owner(setup: BoardSetup, pins: Set[str]) -> tuple[str, str]:
    """The item to which those pins belong, and the key; "" where there is more than one of them, or none."""
    found = [(item, key) for item, key, name in _all_pins(setup) if name in pins]
    items, keys = {item for item, _ in found}, {key for _, key in found}
    if len(items) != 1:
        return "", ""
    return items.pop(), keys.pop() if len(keys) == 1 else ""


def _all_pins(setup: BoardSetup) -> list[tuple[str, str, str]]:
    """(item, key, name) of every pin and bus in the setup."""
    keys = ("step", "dir", "minus", "pin", "uart", "transmit", "select", "clock", "mosi", "miso")
    found = []
    for item in setup.items():
        for key in keys:
            pin = getattr(item, key, None)
            if pin is not None:
                found.append((item.name, key, pin.name))
    found += [(chip.name, "bus", chip.bus) for chip in setup.drivers if chip.bus is not None]
    return found
