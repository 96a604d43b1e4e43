"""Runs for the given time [s], then exits with status 0."""

import sys

from tests.deploy.supervisor.faulty.heartbeat import send_heartbeats, start

start()
send_heartbeats(float(sys.argv[2]))
