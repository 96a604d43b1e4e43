"""Writes a lot to its output, then publishes heartbeats."""

import sys

from tests.deploy.supervisor.faulty.heartbeat import send_heartbeats, start

start()
for number in range(int(sys.argv[2])):
    print(f"{number:07} {'x' * 91}")
send_heartbeats()
