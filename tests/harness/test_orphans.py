"""The processes that a killed test run leaves behind are killed, including those without a parent."""

from __future__ import annotations

import os
import signal
import subprocess
import sys

import psutil

from services.runtime.process import ROOT
from tests.harness.waiting import wait_until

RUN = """
import os, signal, subprocess, sys
from tests.harness.orphans import no_orphans

ORPHAN = "import subprocess, sys; print(subprocess.Popen(['sleep', '1000'], start_new_session=True).pid, flush=True)"
with no_orphans():
    subprocess.run([sys.executable, "-c", ORPHAN])
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_an_orphan_dies_with_the_run_that_is_killed() -> None:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    # Don't read its output to the end: the orphan holds that open.
    with subprocess.Popen([sys.executable, "-c", RUN], env=environment, stdout=subprocess.PIPE, text=True) as run:
        assert run.stdout is not None
        orphan = int(run.stdout.readline())
        assert run.wait(60) == -signal.SIGKILL
    wait_until(lambda: not psutil.pid_exists(orphan), 20, "the orphan to be gone")
