"""Publishes heartbeats, reports that its node is stopping, and crashes once the file ``end`` is in the run's folder.

On SIGINT it exits normally at once.
"""

import os
import signal
import time
from pathlib import Path

from tests.deploy.supervisor.faulty.heartbeat import send_heartbeat, send_heartbeats, start

signal.signal(signal.SIGINT, lambda number, frame: os._exit(0))
start()
send_heartbeats(0.5)
send_heartbeat("stopping")
while not Path("end").exists():
    time.sleep(0.01)
raise RuntimeError("crash at the end")
