"""A heartbeat for the faulty children: a line in the file ``beats`` of the run's folder, their working directory."""

import json
import os
import sys
import time

from services.runtime.process import die_with_parent


def node() -> str:
    """The name that the fleet gave this child."""
    return sys.argv[1]


def start() -> None:
    """Die with the supervisor, as services do."""
    die_with_parent()


def send_heartbeat(state: str = "running") -> None:
    """One heartbeat; appends of a line are whole."""
    line = json.dumps({"node": node(), "pid": os.getpid(), "state": state}) + "\n"
    descriptor = os.open("beats", os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    os.write(descriptor, line.encode())
    os.close(descriptor)


def send_heartbeats(seconds: float) -> None:
    """Heartbeats at the usual rate."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        send_heartbeat()
        time.sleep(0.2)
