"""What the verbs are pointed at (`realtime.target`), and how one ends that cannot do what it was asked to."""

from detent.cli.endings import asked_wrongly, failed
from detent.realtime.target import Target, target

__all__ = ["Target", "asked_wrongly", "failed", "target"]
