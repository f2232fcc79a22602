"""The host's side of the GS-C200 and GS-C200S, written from their datasheet."""

from detent.hosts.gsc200.commands import UserPins
from detent.hosts.gsc200.dialogue import Feedback
from detent.hosts.gsc200.driver import AsyncGsC200, BlockingGsC200, GsC200

__all__ = ["AsyncGsC200", "BlockingGsC200", "Feedback", "GsC200", "UserPins"]
