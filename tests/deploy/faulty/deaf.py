"""Ignores SIGINT and SIGTERM."""

import signal

from tests.deploy.faulty.beating import beat_for, start

signal.signal(signal.SIGINT, signal.SIG_IGN)
signal.signal(signal.SIGTERM, signal.SIG_IGN)
start()
beat_for(60)
