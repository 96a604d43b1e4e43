"""On an overloaded machine, a process that waits for a processor is left alone, and a hung one is killed."""

from __future__ import annotations

import os
import re
import signal
import time
from pathlib import Path

import psutil

from deploy.progress import ProgressReporter
from deploy.supervisor.heartbeat_monitor import HEARTBEAT_TIMEOUT_S
from deploy.supervisor.supervisor import Supervisor
from tests.deploy.supervisor.supervisor_harness import (
    SupervisorHarness,
    faulty_process,
    wait_all_ready,
    wait_until,
)

SILENT_S = HEARTBEAT_TIMEOUT_S + 1.0
"""Longer than a hung process is tolerated [s]."""


def test_who_waits_for_a_processor_is_told_from_who_hangs(tmp_path: Path) -> None:
    harness = SupervisorHarness(tmp_path)
    progress = ProgressReporter(harness, tmp_path)

    async def starve(supervisor: Supervisor) -> None:
        await wait_all_ready(supervisor)
        starved, frozen = supervisor.processes["starved"], supervisor.processes["frozen"]
        pid = starved.state_message().pid
        (tmp_path / "starve").touch()
        psutil.Process(frozen.state_message().pid).suspend()
        hogs = tmp_path / "hogs"
        await wait_until(lambda: hogs.exists() and starved.starved_for(time.monotonic()) > SILENT_S)
        for _ in range(2):
            progress.on_poll([starved])
        for hog in hogs.read_text().split():
            os.kill(int(hog), signal.SIGKILL)
        await wait_until(lambda: starved.is_healthy(time.monotonic()))
        assert (starved.state, starved.state_message().pid) == ("ready", pid)
        await wait_until(lambda: harness.states("frozen").count("ready") == 2)

    outcome = harness.run(starve, faulty_process("starved", "/starved"), faulty_process("good", "/frozen"))
    (told,) = harness.notes
    assert re.fullmatch(r"starved: no heartbeat for \d+\.\d s, it is waiting for a processor: .* too busy .*", told)
    assert harness.states("starved") == ["waiting", "starting", "ready", "stopping", "stopped"]
    assert outcome.restarts == harness.states("frozen").count("backing off") == 1
    assert harness.silence("frozen") > HEARTBEAT_TIMEOUT_S - 0.2
    assert harness.unexcused_silence("frozen") < HEARTBEAT_TIMEOUT_S + 1.0
