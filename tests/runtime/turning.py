"""A node's loop in a thread."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from services.runtime.errors import Stopped
from services.runtime.node import Node


@contextmanager
def turning(made: Node) -> Iterator[None]:
    """The node's loop in a thread, doing nothing but what every loop does."""
    inlet = made.transport.subscribe("rest", 8)

    def loop() -> None:
        with suppress(Stopped):
            while True:
                made.wait(inlet)
                inlet.take()

    thread = threading.Thread(target=loop)
    thread.start()
    try:
        yield
    finally:
        made.stopping = True
        made.transport.nudge()
        thread.join(10)
        assert not thread.is_alive()
