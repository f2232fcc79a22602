"""AMS DCB-274, from the host's side (Users Manual of 07/05/06; "page" is a page of it).

`handshake` has the four ways to bring a line to a unit (single mode, party line, daisy chain, SIN-10), `unit` one unit
on its line, `commands` every command as a call, `memory` programs, NV memory, backups, `driver` the common face of an
axis; `ranges` is what can be said, `answers` what comes back. How the manual's contradictions are read:
docs/controllers/dcb274.md.
"""

from detent.hosts.dcb274.driver import AsyncDcb274, BlockingDcb274, Dcb274

__all__ = ["AsyncDcb274", "BlockingDcb274", "Dcb274"]
