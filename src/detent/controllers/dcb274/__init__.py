"""AMS DCB-274 with the SMC-27X2 command set.

Start at `firmware` (the device), `commands` (the one table), `link` (single mode, party line, daisy chain). How the
manual's contradictions are settled: docs/controllers/dcb274.md.
"""
