"""Beats for a minute, then ends; ends at once when asked."""

import signal
import sys

from tests.deploy.faulty.beating import beat_for, start

signal.signal(signal.SIGINT, lambda number, frame: sys.exit(0))
start()
beat_for(60)
