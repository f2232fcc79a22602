"""Step pulses on real pins: boards with stock Klipper firmware, as a host meets them.

Written from what the firmware says of itself (its dictionary) and from the behaviour of its Linux process; see
docs/reference/boards.md. Nothing here reads a clock or a descriptor but `ports`: classes take bytes and a reading of
the wall clock and give bytes, so the same code runs against the fake board in virtual time and on a serial port.

| module | what |
|---|---|
| `frames` | blocks, their checksum, integers of variable length |
| `dictionary` | what a board says of itself; messages by name, pins, constants |
| `link` | sequence numbers, window, retransmission |
| `clock` | the board's time, estimated from round trips; ticks of cell time |
| `setup` | what hangs on which pin |
| `board` | one board: configuration, move queue, shutdown, recovery |
| `stepper` | one axis: motion entries in, runs of steps out; `count` is what the firmware counts of them |
| `outputs`, `inputs`, `stops` | digital outputs with a watchdog, inputs, stops in the firmware |
| `drivers`, `registers` | TMC2208/2209 by UART, TMC2130/5160 by SPI |
| `boards` | all boards of a cell, one of them master of time |
| `ports` | a serial device, or the fake board |
| `events` | what comes back |
| `plan`, `opening`, `drive` | a cell file's tables to setups; boards opened and ready; what a service needs |
| `driven` | the cell behind its pins, as the loop serves it; made of those that follow |
| `outgoing` | what the cell does, on its way out: `channels`, `axis_ledger`, `guard` (who watches), `replies` |
| `currents` | what each power stage is told, when the steps before it have left; `stages`: at first |
| `incoming`, `rollback` | what comes from the boards; a stop takes the cell back (`past`), and they are told |
| `cell_clock`, `cell_inputs`, `certainty` | its time, the inputs that it was given, what nothing can take back |
| `faults` | faults, emergency stop, recovery; `states` is how all of it stands, for those who look |
| `checking` | a look at the wiring: inputs live, axes jogged |

**Time.** `wall` is always the host's monotonic clock in ns. Cell time is the board's time: `Boards.now` gives its
nanoseconds, from which a `Pace` makes cell time. What the cell does at t leaves the pins at t + lead.
"""
