"""Publishes heartbeats, reports that its node is stopping, and crashes later; on SIGINT it exits normally at once."""

import os
import signal
import sys
import time

from tests.deploy.supervisor.faulty.heartbeat import send_heartbeat, send_heartbeats, start

signal.signal(signal.SIGINT, lambda number, frame: os._exit(0))
start()
send_heartbeats(0.5)
send_heartbeat("stopping")
time.sleep(float(sys.argv[2]))
raise RuntimeError("crash at the end")
