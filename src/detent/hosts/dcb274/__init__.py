"""AMS DCB-274, from the host's side (Users Manual of 07/05/06; "page" is a page of it).

`handshake` is what every way to bring a line to a unit has to do; `single_mode`, `party_line` (the daisy chain too) and
`adapter` (SIN-10) are these ways, `names` the names on a line that is shared. `unit` is one unit on its line,
`commands` every command as a call, `memory` programs, NV memory, backups, `driver` the common face of an axis;
`ranges` is what can be said, `answers` what comes back. How the manual's contradictions are read:
docs/controllers/dcb274.md.
"""

from detent.hosts.dcb274.driver import AsyncDcb274, BlockingDcb274, Dcb274

__all__ = ["AsyncDcb274", "BlockingDcb274", "Dcb274"]
