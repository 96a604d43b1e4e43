"""A machine that is too busy: who waits for a processor is left alone, who hangs beside it is not."""

from __future__ import annotations

import os
import re
import signal
import time
from pathlib import Path

import psutil

from deploy.progress import Progress
from deploy.supervisor.pulse import LIMIT_S
from deploy.supervisor.supervisor import Supervisor
from tests.deploy.harness import Stage, all_ready, child, own_silence, until

SILENT_S = LIMIT_S + 2.0
"""Longer than a process that hangs is left alone."""


def test_who_waits_for_a_processor_is_told_from_who_hangs(tmp_path: Path) -> None:
    stage = Stage(tmp_path)
    progress = Progress(stage, tmp_path)

    async def starve(supervisor: Supervisor) -> None:
        await all_ready(supervisor)
        starved, frozen = supervisor.lives["starved"], supervisor.lives["frozen"]
        pid = starved.show().pid
        (tmp_path / "starve").touch()
        psutil.Process(frozen.show().pid).suspend()
        await until(lambda: starved.starved(time.monotonic()) > SILENT_S)
        for _ in range(2):
            progress.turned([starved])
        for hog in (tmp_path / "hogs").read_text().split():
            os.kill(int(hog), signal.SIGKILL)
        await until(lambda: starved.well(time.monotonic()))
        assert (starved.state, starved.show().pid) == ("ready", pid)
        await until(lambda: frozen.state == "ready")

    outcome = stage.run(starve, child("starved", "/starved"), child("good", "/frozen"))
    (told,) = stage.said
    assert re.fullmatch(r"starved: no heartbeat for \d+\.\d s, it waits for a processor: .* too busy .*", told)
    assert stage.states("starved") == ["waiting", "starting", "ready", "stopping", "stopped"]
    assert outcome.restarts == stage.states("frozen").count("backing off") == 1
    assert LIMIT_S - 0.1 < own_silence(stage.log("frozen")) < LIMIT_S + 1.0


def test_an_endless_loop_is_no_wait_for_a_processor(tmp_path: Path) -> None:
    stage = Stage(tmp_path)

    async def watch(supervisor: Supervisor) -> None:
        await until(lambda: stage.states("a").count("ready") == 2)

    stage.run(watch, child("spin", "/a"))
    assert own_silence(stage.log("a")) < LIMIT_S + 1.0
