"""Never publishes a heartbeat."""

import threading

from tests.deploy.supervisor.faulty.heartbeat import LIFE_S, start

start()
threading.Event().wait(LIFE_S)
