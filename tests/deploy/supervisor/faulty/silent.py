"""Never publishes a heartbeat."""

import threading

from tests.deploy.supervisor.faulty.heartbeat import start

start()
threading.Event().wait(60)
