"""Starts a child of its own that ignores signals, and writes the child's process id to ``grandchild``."""

import signal
import subprocess
import sys
from pathlib import Path

from tests.deploy.supervisor.faulty.heartbeat import LIFE_S, send_heartbeats, start

start()
code = f"import signal, time\nfor n in (2, 15, 1): signal.signal(n, signal.SIG_IGN)\ntime.sleep({LIFE_S})"
grandchild = subprocess.Popen([sys.executable, "-c", code])
Path("grandchild").write_text(str(grandchild.pid))
signal.signal(signal.SIGINT, lambda number, frame: sys.exit(0))
send_heartbeats()
