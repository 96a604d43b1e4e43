"""Publishes heartbeats; once the file ``starve`` exists, it competes for one processor with busy children.

It then computes for WORK_S before each heartbeat, scheduled as SCHED_IDLE: it gets a thousandth of the processor. The
file ``hogs`` has the process ids of the children.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from tests.deploy.supervisor.faulty.heartbeat import send_heartbeat, send_heartbeats, start

HOGS = 4
WORK_S = 0.02
"""Processor time spent before each heartbeat."""
signal.signal(signal.SIGINT, lambda number, frame: sys.exit(0))
start()
while not Path("starve").exists():
    send_heartbeats(0.2)
os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
hogs = [subprocess.Popen([sys.executable, "-S", "-c", "while True: pass"]) for _ in range(HOGS)]
unfinished = Path("hogs.part")
unfinished.write_text(" ".join(str(each.pid) for each in hogs))
unfinished.rename("hogs")
os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
while True:
    done = time.thread_time() + WORK_S
    while time.thread_time() < done:
        pass
    send_heartbeat()
    time.sleep(0.2)
