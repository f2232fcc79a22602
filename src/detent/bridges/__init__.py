"""Detent's axes as other systems know them: each bridge stands on host drivers, so that it moves real ones too."""
