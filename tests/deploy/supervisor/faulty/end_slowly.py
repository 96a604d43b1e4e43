"""Publishes heartbeats, reports that its node ends, and crashes later; when asked to end, exits well at once."""

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
