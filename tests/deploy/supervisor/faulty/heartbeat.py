"""Heartbeats of the faulty children: lines in the file ``beats`` of the run's folder, their working directory."""

import json
import os
import sys
import time

from services.runtime.process import die_with_parent

LIFE_S = 600.0
"""Wall time for which a child lives that is not ended: longer than any test waits for it."""


def node() -> str:
    """Return the name of this child's node in the fleet."""
    return sys.argv[1]


def start() -> None:
    """Make this process die with the supervisor, as services do."""
    die_with_parent()


def send_heartbeat(state: str = "running") -> None:
    """Write one heartbeat; appending a line is atomic."""
    line = json.dumps({"node": node(), "pid": os.getpid(), "state": state}) + "\n"
    descriptor = os.open("beats", os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    os.write(descriptor, line.encode())
    os.close(descriptor)


def send_heartbeats(seconds: float = LIFE_S) -> None:
    """Write heartbeats at the usual rate for ``seconds``."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        send_heartbeat()
        time.sleep(0.2)
