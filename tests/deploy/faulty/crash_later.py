"""Beats for a while, then crashes."""

import sys

from tests.deploy.faulty.beating import beat_for, start

start()
beat_for(float(sys.argv[2]))
raise RuntimeError("crash later")
