"""Beats once, then its loop hangs."""

import threading

from tests.deploy.faulty.beating import beat, start

start()
beat()
threading.Event().wait(60)
