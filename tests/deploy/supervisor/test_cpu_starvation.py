"""On an overloaded machine, a process that waits for a processor is left alone, and a hung one is killed."""

from __future__ import annotations

import os
import re
import signal
import time
from pathlib import Path

import psutil
import pytest

from deploy.progress import ProgressReporter
from deploy.supervisor import heartbeat_monitor
from deploy.supervisor.heartbeat_monitor import HEARTBEAT_TIMEOUT_S, ThreadTimes
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


def test_the_waits_of_the_router_do_not_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Heartbeats pass through it."""
    harness = SupervisorHarness(tmp_path)

    async def starve(supervisor: Supervisor) -> None:
        await wait_all_ready(supervisor)
        router, waits = supervisor.processes["router"].state_message().pid, supervisor.processes["waits"]

        def starved_router(pid: int) -> dict[int, ThreadTimes]:
            return {1: ThreadTimes(0, time.monotonic_ns(), False)} if pid == router else {}

        with monkeypatch.context() as patch:
            patch.setattr(heartbeat_monitor, "read_threads", starved_router)
            harness.bus.mute = {"/waits"}
            await wait_until(lambda: waits.starved_for(time.monotonic()) > SILENT_S or waits.state != "ready")
            assert waits.state == "ready"
        await wait_until(lambda: "backing off" in harness.states("waits"))

    behind = faulty_process("good", "/waits", depends_on=("router",))
    harness.run(starve, faulty_process("good", "/router", kind="router"), behind)
    assert "backing off" not in harness.states("router")
