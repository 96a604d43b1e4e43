"""Beats once, then never comes back from a calculation."""

from tests.deploy.supervisor.faulty.heartbeat import send_heartbeat, start

start()
send_heartbeat()
while True:
    pass
