"""Ignores SIGINT and SIGTERM."""

import signal

from tests.deploy.supervisor.faulty.heartbeat import send_heartbeats, start

signal.signal(signal.SIGINT, signal.SIG_IGN)
signal.signal(signal.SIGTERM, signal.SIG_IGN)
start()
send_heartbeats()
