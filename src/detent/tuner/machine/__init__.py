"""Tuning on the machine: trials with a real unit, the home switch as witness, no model of the motor.

`bench` is what each controller can do, `carriage` references and the way out and back, `recipe` which settings are
tried, `session` all of it, as steps of a driver (`detent.hosts.exchange`): no file, clock or port is touched here.
"""
