"""A board of our own, in virtual time: what stock firmware does, as far as a host of Detent's can tell.

It answers in blocks, executes steps, samples inputs and shuts down as the firmware was seen to, with message numbers
that are shuffled and partly negative, so that nothing is hard-wired. A machine behind it moves switches. It can be made
to lose and damage blocks, to stall, to drift and to forget everything. Users reach it by the address `fake:`, tests by
`FakeBoard` and `FakePort`. What it does was compared with the firmware's Linux process (docs/reference/boards.md).

| module | what |
|---|---|
| `words` | its commands and responses, and the dictionary that it sends |
| `board` | blocks, timers, configuration, shutdown |
| `stepping`, `pins`, `stopping`, `chips` | steppers; outputs and buttons; endstops and triggers; driver chips |
| `machine` | axes and the switches that they move |
| `port` | a wire between it and a host, which may be bad |
"""
