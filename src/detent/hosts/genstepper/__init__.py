"""The host's side of the BS0610 and BS0710 boards with GenStepper 2.18, written from their manual."""

from detent.hosts.genstepper.commands import Latches, Reports
from detent.hosts.genstepper.dialogue import Action
from detent.hosts.genstepper.driver import AsyncGenStepper, BlockingGenStepper, GenStepper

__all__ = ["Action", "AsyncGenStepper", "BlockingGenStepper", "GenStepper", "Latches", "Reports"]
