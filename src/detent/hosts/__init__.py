"""Host-side drivers, one a controller, written from the manuals: a second witness that knows no controller's code.

A driver is given a port (`write` and `read`, as a serial port has them) and a way to wait; it opens nothing and
reads no clock. The same driver works over a wire, a pseudo-terminal, TCP, or on a line of a cell in virtual time.
"""
