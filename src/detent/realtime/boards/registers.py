"""Registers of TMC2208, TMC2209, TMC2130 and TMC5160: what is written for what a controller commands, and how.

From the data sheets of Trinamic (now Analog Devices): TMC2208 rev. 1.13, TMC2209 rev. 1.09, TMC2130 rev. 1.15,
TMC5160 rev. 1.17; sections are named where they matter.
"""

from math import floor, sqrt
from typing import NamedTuple

from detent.controllers.device import Stage
from detent.realtime.boards.setup import DriverSetup, SetupProblem
from detent.ticks import SECOND, Ns

# the same number in all four
GCONF, GSTAT, IFCNT = 0x00, 0x01, 0x02
IHOLD_IRUN, TPOWERDOWN, TPWMTHRS = 0x10, 0x11, 0x13
GLOBAL_SCALER = 0x0B  # TMC5160
CHOPCONF, DRV_STATUS, PWMCONF = 0x6C, 0x6F, 0x70

MOST_CURRENT = 31  # of the current scale, in 32nds
FULL_SCALE = {"tmc2208": 0.325, "tmc2209": 0.325, "tmc2130": 0.320, "tmc5160": 0.325}
"""V across the sense resistor at scale 32/32, with vsense 0 where there is one: typical, of the electrical sections."""
LOW_SCALE = 0.180  # with vsense 1
EXTRA = 0.020  # ohm within these chips, in series
RATED = {"tmc2208": 1.4, "tmc2209": 2.0, "tmc2130": 1.4}
"""A, RMS: what the power stages within the chips carry at most; a 5160 has those outside."""
CLOCK = 12_000_000  # Hz of the chips' own oscillator


class Written(NamedTuple):
    """A register, its number and the value it is to have."""

    name: str
    register: int
    value: int


def settings(chip: DriverSetup, stage: Stage) -> list[Written]:
    """What is written to `chip` for `stage`. SetupProblem where it cannot do that."""
    run, hold = _amperes(chip, stage.run, stage), _amperes(chip, stage.hold, stage)
    if not stage.settling:
        hold = run
    scale, vsense, global_scale = _scaled(chip, max(run, hold))
    run_scale = _in_32nds(chip, run, scale)
    hold_scale = _in_32nds(chip, hold, scale)
    microsteps = _microsteps(chip, stage)
    chopper = _chopper(chip, stage, microsteps, vsense)
    written = [Written("GCONF", GCONF, _general(chip, stage))]
    if global_scale is not None:
        written.append(Written("GLOBALSCALER", GLOBAL_SCALER, global_scale & 0xFF))
    # IHOLDDELAY 1: 2**18 clocks for each step down of the current, 22 ms
    delay = 1 if hold_scale != run_scale else 0
    written += [
        Written("IHOLD_IRUN", IHOLD_IRUN, hold_scale | run_scale << 8 | delay << 16),
        Written("TPOWERDOWN", TPOWERDOWN, _settling(chip, stage.settling)),
        Written("CHOPCONF", CHOPCONF, chopper),
    ]
    threshold = _threshold(chip, stage, microsteps)
    if threshold is not None:
        written.append(Written("TPWMTHRS", TPWMTHRS, threshold))
    return written


def _amperes(chip: DriverSetup, current: float, stage: Stage) -> float:
    """A phase current in amperes: what `amperes` of the setup stands for, or what the controller says itself."""
    if stage.chops:
        return current if chip.amperes is None else min(current, chip.amperes)
    if chip.amperes is None:
        raise SetupProblem(chip.name, "amperes", "the controller commands fractions of full power; say how many "
                           "amperes a phase that is, like amperes = 0.8")  # fmt: skip
    return current * chip.amperes


def _scaled(chip: DriverSetup, most: float) -> tuple[float, bool, int | None]:
    """(amperes at scale 32/32, vsense, GLOBALSCALER or None) for currents up to `most`: the finest that reaches it.

    I_rms = (CS + 1) / 32 * V_fs / (R_sense + 20 mOhm) / sqrt 2 (2209, section 9); the 5160 has a scaler of 256ths
    instead of two ranges, of which less than 32 are not allowed, and 0 stands for 256.
    """
    if chip.sense <= 0:
        raise SetupProblem(chip.name, "sense", f"a sense resistor of {chip.sense:g} ohm: write it in ohm, like 0.11")
    if most > RATED.get(chip.kind, most):
        limit = RATED[chip.kind]
        what = f"a {chip.kind} carries {limit:g} A a phase, not {most:.2f}"
        raise SetupProblem(
            chip.name, "kind", f"{what}: say that less will do, amperes = {limit:g}, or take another driver"
        )
    if chip.kind == "tmc5160":
        full = FULL_SCALE[chip.kind] / chip.sense / sqrt(2)
        if most > full:
            raise _too_much(chip, most, full)
        _enough(chip, full * 32 / 256 / 32)
        scaler = min(max(-(-int(most / full * 256 * 1000) // 1000), 32), 256)
        return full * scaler / 256, False, scaler
    low, high = (volts / (chip.sense + EXTRA) / sqrt(2) for volts in (LOW_SCALE, FULL_SCALE[chip.kind]))
    _enough(chip, low / 32)
    if most <= low:
        return low, True, None
    if most > high:
        raise _too_much(chip, most, high)
    return high, False, None


def _too_much(chip: DriverSetup, most: float, full: float) -> SetupProblem:
    limit = floor(full * 10) / 10
    what = f"a {chip.kind} with {chip.sense:g} ohm gives {full:.2f} A a phase, not {most:.2f}"
    remedy = f"say that less will do, amperes = {limit:g}, or take a smaller resistor or another driver"
    return SetupProblem(chip.name, "sense", f"{what}: {remedy}")


def _enough(chip: DriverSetup, least: float) -> None:
    """The current that somebody wrote down is not less than the chip's least."""
    if chip.amperes is not None and chip.amperes < least:
        what = f"a {chip.kind} with {chip.sense:g} ohm gives {least:.3g} A a phase at least"
        raise SetupProblem(chip.name, "amperes", f"{what}: take a larger resistor, or a motor for more")


def _in_32nds(chip: DriverSetup, current: float, full: float) -> int:
    """CS for a current: the nearest, 0 .. 31, which is (CS + 1) / 32 of full."""
    return min(max(round(current / full * 32) - 1, 0), MOST_CURRENT)


def _microsteps(chip: DriverSetup, stage: Stage) -> int:
    """Microsteps a full step: a position moves the cycle by `places` 64ths of a full step."""
    if stage.fast_from is not None:
        raise SetupProblem(chip.name, "kind", "the controller changes its sequence of phase currents with the rate: no "
                           f"{chip.kind} does that; use a driver of step and direction alone")  # fmt: skip
    places = abs(stage.places)
    steps, rest = divmod(64, places) if places else (0, 1)
    if rest or steps & steps - 1 or not 1 <= steps <= 64:
        raise SetupProblem(chip.name, "kind", f"{places}/64 of a full step a pulse: a {chip.kind} divides a step by a "
                           "power of two")  # fmt: skip
    return steps


def _chopper(chip: DriverSetup, stage: Stage, microsteps: int, vsense: bool) -> int:
    """CHOPCONF: TOFF 3, HSTRT 5, HEND 2 (the sheets' start values), TBL 2, MRES, and who interpolates to 256."""
    mres = 8 - (microsteps.bit_length() - 1)
    value = 3 | 4 << 4 | (2 + 3) << 7 | 2 << 15 | mres << 24
    if vsense:
        value |= 1 << 17
    if chip.interpolate:
        value |= 1 << 28
    return value


def _general(chip: DriverSetup, stage: Stage) -> int:
    """GCONF: registers count and not the pins; spreadCycle or stealthChop."""
    quiet = chip.quiet
    if chip.kind in ("tmc2208", "tmc2209"):
        # pdn_disable, mstep_reg_select; en_spreadcycle
        return 1 << 6 | 1 << 7 | (0 if quiet else 1 << 2)
    return 1 << 2 if quiet else 0  # en_pwm_mode


def _settling(chip: DriverSetup, settling: Ns) -> int:
    """TPOWERDOWN: units of 2**18 clocks, 0 .. 255 (5.6 s); at least 2 with stealthChop (2209, section 5.2)."""
    units = round(settling * CLOCK / (SECOND << 18))
    if units > 255:
        raise SetupProblem(chip.name, "kind", f"hold current {settling / SECOND:g} s behind a motion: a {chip.kind} "
                           f"waits {255 * (1 << 18) / CLOCK:.1f} s at most")  # fmt: skip
    return max(units, 2)


def _threshold(chip: DriverSetup, stage: Stage, microsteps: int) -> int | None:
    """TPWMTHRS, clocks between 1/256 steps: stealthChop below that rate, where slow decay is asked for."""
    if not chip.quiet:
        return None
    if stage.slow_over is None:
        return 0
    return min(stage.slow_over * CLOCK * microsteps // (SECOND * 256), (1 << 20) - 1)


def check_byte(data: bytes) -> int:
    """CRC-8 with x**8 + x**2 + x + 1, least significant bits first (2209, section 4.2): of 05 00 00 it is 48h."""
    value = 0
    for byte in data:
        for _ in range(8):
            value = value << 1 ^ (0x07 if (value >> 7 ^ byte) & 1 else 0)
            value &= 0xFF
            byte >>= 1
    return value


def write_frame(address: int, register: int, value: int) -> bytes:
    """The eight bytes that write a register by UART."""
    body = bytes((0x05, address, register | 0x80)) + value.to_bytes(4, "big")
    return body + bytes((check_byte(body),))


def read_frame(address: int, register: int) -> bytes:
    """The four bytes that ask for one."""
    body = bytes((0x05, address, register))
    return body + bytes((check_byte(body),))


def read_answer(frame: bytes | None, register: int) -> int | None:
    """The value in the eight bytes of an answer; None if it is damaged or not about that register."""
    if frame is None or len(frame) != 8 or check_byte(frame[:-1]) != frame[-1] or frame[:2] != b"\x05\xff":
        return None
    return int.from_bytes(frame[3:7], "big") if frame[2] == register else None


def bits_of_bytes(data: bytes) -> bytes:
    """Bytes as bits on a serial line: start bit 0, eight bits, stop bit 1; packed, least significant first."""
    bits = 0
    for i, byte in enumerate(data):
        bits |= (byte << 1 | 0x200) << 10 * i
    return bits.to_bytes(-(-10 * len(data) // 8), "little")


def bytes_of_bits(data: bytes) -> bytes | None:
    """The other way; None if a start or stop bit is missing."""
    bits = int.from_bytes(data, "little")
    found = bytearray()
    for i in range(len(data) * 8 // 10):
        frame = bits >> 10 * i & 0x3FF
        if frame & 1 or not frame & 0x200:
            return None
        found.append(frame >> 1 & 0xFF)
    return bytes(found)
