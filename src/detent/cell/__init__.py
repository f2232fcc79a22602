"""A cell: units, wires, switches, lines and a script, told the time together.

`description` reads the TOML, `build` checks it and makes a `Cell`, `cell` schedules, `recording` keeps what
happened, `switches` and `detector` are the parts that are not controllers. A cell runs as fast as it goes;
only `realtime` paces it.
"""
