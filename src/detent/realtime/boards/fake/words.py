"""The words of the fake board: what it understands and answers, numbered as a seed shuffles them."""

import json
import zlib
from collections.abc import Mapping, Sequence

COMMANDS = (
    "clear_shutdown",
    "emergency_stop",
    "get_uptime",
    "get_clock",
    "finalize_config crc=%u",
    "get_config",
    "allocate_oids count=%c",
    "config_stepper oid=%c step_pin=%c dir_pin=%c invert_step=%c step_pulse_ticks=%u",
    "queue_step oid=%c interval=%u count=%hu add=%hi",
    "set_next_step_dir oid=%c dir=%c",
    "reset_step_clock oid=%c clock=%u",
    "stepper_get_position oid=%c",
    "stepper_stop_on_trigger oid=%c trsync_oid=%c",
    "config_endstop oid=%c pin=%c pull_up=%c",
    "endstop_home oid=%c clock=%u sample_ticks=%u sample_count=%c rest_ticks=%u pin_value=%c trsync_oid=%c"
    " trigger_reason=%c",
    "endstop_query_state oid=%c",
    "config_trsync oid=%c",
    "trsync_start oid=%c report_clock=%u report_ticks=%u expire_reason=%c",
    "trsync_set_timeout oid=%c clock=%u",
    "trsync_trigger oid=%c reason=%c",
    "config_digital_out oid=%c pin=%u value=%c default_value=%c max_duration=%u",
    "queue_digital_out oid=%c clock=%u on_ticks=%u",
    "update_digital_out oid=%c value=%c",
    "config_buttons oid=%c button_count=%c",
    "buttons_add oid=%c pos=%c pin=%u pull_up=%c",
    "buttons_query oid=%c clock=%u rest_ticks=%u retransmit_count=%c invert=%c",
    "buttons_ack oid=%c count=%c",
    "config_tmcuart oid=%c rx_pin=%u pull_up=%c tx_pin=%u bit_time=%u",
    "tmcuart_send oid=%c write=%*s read=%c",
    "config_spi oid=%c pin=%u cs_active_high=%c",
    "spi_set_bus oid=%c spi_bus=%u mode=%u rate=%u",
    "spi_set_sw_bus oid=%c miso_pin=%u mosi_pin=%u sclk_pin=%u mode=%u pulse_ticks=%u",
    "spi_send oid=%c data=%*s",
    "spi_transfer oid=%c data=%*s",
    "debug_nop",
)
RESETS = ("config_reset", "reset")  # one of them: a process is started again, a chip reset

RESPONSES = (
    "clock clock=%u",
    "config is_config=%c crc=%u is_shutdown=%c move_count=%hu",
    "uptime high=%u clock=%u",
    "shutdown clock=%u static_string_id=%hu",
    "is_shutdown static_string_id=%hu",
    "stepper_position oid=%c pos=%i",
    "endstop_state oid=%c homing=%c next_clock=%u pin_value=%c",
    "trsync_state oid=%c can_trigger=%c trigger_reason=%c clock=%u",
    "buttons_state oid=%c ack_count=%c state=%*s",
    "tmcuart_response oid=%c read=%*s",
    "spi_transfer_response oid=%c response=%*s",
    "stats count=%u sum=%u sumsq=%u",
)

REASONS = (
    "Command request", "Timer too close", "Stepper too far in past", "Move queue overflow",
    "Can't reset time when stepper active", "Invalid count parameter", "Rescheduled timer in the past",
    "Scheduled digital out event will exceed max_duration", "Missed scheduling of next digital out event",
    "update_digital_out not valid with active queue", "Can't add signal that is already active", "Invalid oid type",
    "Can't assign oid", "oids already allocated", "Already finalized", "Not an output pin", "Not an input pin",
    "Shutdown cleared when not shutdown", "Command parser error", "Invalid command", "Max of 8 buttons",
    "config_reset only available when shutdown", "Set button past maximum button count", "tmcuart data too large",
)  # fmt: skip


def numbered(
    seed: int, *, leave_out: Sequence[str] = (), reset: str = "reset"
) -> tuple[dict[str, int], dict[str, int]]:
    """(commands, responses) with their numbers: two of each are fixed, the others are a permutation made of `seed`."""
    commands = [c for c in (*COMMANDS, reset) if c.split()[0] not in leave_out]
    pool = [n for n in range(-32, 160) if n not in (0, 1)]
    state = seed * 2 + 1
    for i in range(len(pool) - 1, 0, -1):  # a permutation without a random number: the seed says all
        state = (state * 6364136223846793005 + 1442695040888963407) & (1 << 64) - 1
        j = (state >> 33) % (i + 1)
        pool[i], pool[j] = pool[j], pool[i]
    texts = [*commands, *RESPONSES]
    numbers = dict(zip(texts, pool, strict=False))
    return (
        {"identify offset=%u count=%c": 1} | {text: numbers[text] for text in commands},
        {"identify_response offset=%u data=%.*s": 0} | {text: numbers[text] for text in RESPONSES},
    )


def dictionary(
    commands: Mapping[str, int], responses: Mapping[str, int], *, frequency: int,
    pins: int | Mapping[str, tuple[int, int]], window: int | None, version: str, reserved: Mapping[str, str],
) -> bytes:  # fmt: skip
    """What `identify` gives. `pins`: how many, or ranges: the name of the first, its number, and how many."""
    config: dict[str, object] = {"CLOCK_FREQ": frequency, "MCU": "fake"}
    config |= {f"RESERVE_PINS_{use}": names for use, names in reserved.items()}
    if window is not None:
        config["RECEIVE_WINDOW"] = window
    content = {
        "app": "Fake", "version": version, "commands": dict(commands), "responses": dict(responses), "config": config,
        "enumerations": {
            "pin": {"gpio0": [0, pins]} if isinstance(pins, int) else {name: [*span] for name, span in pins.items()},
            "spi_bus": {"spi0": [0, 2]},
            "static_string_id": {text: number + 2 for number, text in enumerate(REASONS)},
        },
    }  # fmt: skip
    return zlib.compress(json.dumps(content).encode())
