"""Detent: intelligent stepper motor controllers in software, exact to the pulse.

Start reading at ARCHITECTURE.md ("life of a move"); the packages below are listed there from the
command line down to the integer nanoseconds that everything stands on.
"""

__version__ = "0.1.0"
