"""Publishes heartbeats for a while, then crashes."""

import sys

from tests.deploy.supervisor.faulty.heartbeat import send_heartbeats, start

start()
send_heartbeats(float(sys.argv[2]))
raise RuntimeError("crash later")
