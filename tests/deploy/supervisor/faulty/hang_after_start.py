"""Publishes one heartbeat, then its loop hangs."""

import threading

from tests.deploy.supervisor.faulty.heartbeat import LIFE_S, send_heartbeat, start

start()
send_heartbeat()
threading.Event().wait(LIFE_S)
