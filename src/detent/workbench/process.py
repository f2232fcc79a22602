"""What the process of the engine runs: it reads what is ordered of its pipe, and serves until that ends.

`Bench.open` starts it (`joining`).
"""

import contextlib
import pickle
import socket
import sys
from contextlib import AbstractContextManager

from detent.cell.description import Problem
from detent.realtime.endpoints.endpoint import EndpointError
from detent.realtime.endpoints.tcp import TcpAddress
from detent.realtime.images import ImagesUnusable
from detent.realtime.polling import allow_many
from detent.workbench.engine import Engine
from detent.workbench.joining import joined
from detent.workbench.messages import Failed, Order
from detent.workbench.pipe import HEAD, packed


def _engine(end: socket.socket, order: Order) -> Engine:
    if not order.real:
        return Engine(end, order)
    from detent.workbench.driven import DrivenEngine

    return DrivenEngine(end, order)


def _controlled(engine: Engine, address: TcpAddress, token: str | None) -> AbstractContextManager[str]:
    from detent.workbench.governed import controlled  # only for who asks

    return controlled(engine, address, token)


def _read_order(end: socket.socket) -> Order | None:
    """The first message; None if there is none."""
    head = end.recv(HEAD.size, socket.MSG_WAITALL)
    if len(head) < HEAD.size:
        return None
    (length,) = HEAD.unpack(head)
    order = pickle.loads(end.recv(length, socket.MSG_WAITALL))  # of the process that made us
    return order if isinstance(order, Order) else None


def main(words: list[str]) -> int:
    """Open what the first message on the pipe orders, and serve it until the pipe ends."""
    allow_many()
    end = joined(words)
    order = _read_order(end)
    if order is None:
        return 0
    told = end.dup()  # an engine that cannot be made closes its own
    try:
        with _engine(end, order) as engine, contextlib.ExitStack() as beside:
            if order.control is not None:
                try:
                    engine.control = beside.enter_context(_controlled(engine, order.control, order.token))
                except EndpointError as error:
                    engine.refuse(error)
                    return 2
            try:
                engine.run()
            except Exception as error:
                engine.fail(error)
                return 1
    except (Problem, ImagesUnusable, EndpointError, ValueError) as error:
        told.setblocking(True)
        told.sendall(packed(Failed(str(error), "", asked_wrongly=True)))
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
