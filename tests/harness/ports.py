"""Unused ports on the loopback interface."""

from __future__ import annotations

import random
import socket

_RANGE = range(10_000, 30_000)
"""Below those that Linux gives to whoever asks for any: between choice and use, no link of another test takes one."""


def free_port() -> int:
    """A TCP port that is free, drawn anew at each call: other tests may run at the same time."""
    dice = random.SystemRandom()
    while True:
        port = dice.choice(_RANGE)
        with socket.socket() as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
        return port
