"""Publishes one heartbeat, then never returns from a calculation."""

from tests.deploy.supervisor.faulty.heartbeat import send_heartbeat, start

start()
send_heartbeat()
while True:
    pass
