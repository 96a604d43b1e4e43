"""Publishes heartbeats; ends at once on SIGINT."""

import signal
import sys

from tests.deploy.supervisor.faulty.heartbeat import send_heartbeats, start

signal.signal(signal.SIGINT, lambda number, frame: sys.exit(0))
start()
send_heartbeats()
