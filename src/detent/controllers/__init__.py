"""The controllers. Each is a package with the same rooms: pins, link, commands, program, firmware.

`device` is the contract they all fit, `catalogue` finds them by model name. A controller may import
the axis, the UART, the ramps and what lies below, and never another controller.
"""
