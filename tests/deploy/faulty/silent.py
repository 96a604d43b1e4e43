"""Never beats."""

import threading

from tests.deploy.faulty.beating import start

start()
threading.Event().wait(60)
