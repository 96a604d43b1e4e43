"""A killed supervisor leaves nothing running, including its children's children."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import psutil

from services.runtime.process import ROOT
from tests.deploy.supervisor.supervisor_harness import has_ended
from tests.harness.waiting import wait_until

FAMILY = 5
"""Number of processes: three children, a grandchild and the reaper."""


def test_nothing_survives_kill_9(tmp_path: Path) -> None:
    supervisor = subprocess.Popen(
        [sys.executable, "-P", "-m", "tests.deploy.supervisor.faulty.fleet", str(tmp_path)],
        cwd=ROOT,
        start_new_session=True,
    )
    try:
        wait_until(lambda: _ready(tmp_path) and len(_family(supervisor)) >= FAMILY, 30.0, "the whole family at work")
        assert supervisor.poll() is None
        family = _family(supervisor)
        assert int((tmp_path / "grandchild").read_text()) in family
    finally:
        supervisor.kill()
        supervisor.wait()
    wait_until(lambda: all(has_ended(pid) for pid in family), 15.0, "nobody left")


def _family(supervisor: subprocess.Popen[bytes]) -> list[int]:
    return [each.pid for each in psutil.Process(supervisor.pid).children(recursive=True)]


def _ready(folder: Path) -> bool:
    """Whether all three children have sent a heartbeat; the deaf one ignores signals from then on."""
    beats = folder / "beats"
    return beats.exists() and all(f'"/{name}"' in beats.read_text() for name in "abc")
