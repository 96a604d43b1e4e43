"""Unused ports on the loopback interface."""

from __future__ import annotations

import random
import socket

_RANGE = range(10_000, 30_000)
"""Below Linux's ephemeral ports, so that between choice and use no connection of another test gets one."""


def free_port() -> int:
    """Return a free TCP port, chosen at random since other tests may run at the same time."""
    dice = random.SystemRandom()
    while True:
        port = dice.choice(_RANGE)
        with socket.socket() as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
        return port
