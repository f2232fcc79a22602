"""What the command ends with, beside 0."""

FAILED = 1
ASKED_WRONGLY = 2
