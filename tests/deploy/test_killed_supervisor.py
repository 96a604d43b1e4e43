"""A supervisor that is killed takes everything with it, children of its children too."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import psutil

from services.runtime.process import ROOT
from tests.deploy.harness import gone

FAMILY = 5
"""Three children, a grandchild and the warden."""


def wait_until_gone(pids: list[int], seconds: float) -> list[int]:
    """Who is left after a time."""
    deadline = time.monotonic() + seconds
    while (left := [pid for pid in pids if not gone(pid)]) and time.monotonic() < deadline:
        time.sleep(0.02)
    return left


def test_nothing_survives_kill_9(tmp_path: Path) -> None:
    supervisor = subprocess.Popen(
        [sys.executable, "-P", "-m", "tests.deploy.faulty.fleet", str(tmp_path)], cwd=ROOT, start_new_session=True
    )
    try:
        family: list[int] = []
        deadline = time.monotonic() + 30
        while len(family) < FAMILY or not _ready(tmp_path):
            assert supervisor.poll() is None
            assert time.monotonic() < deadline
            family = [each.pid for each in psutil.Process(supervisor.pid).children(recursive=True)]
            time.sleep(0.05)
        assert int((tmp_path / "grandchild").read_text()) in family
    finally:
        supervisor.kill()
        supervisor.wait()
    assert wait_until_gone(family, 2.0) == []


def _ready(folder: Path) -> bool:
    """Whether all three children beat: the deaf one has then made itself deaf."""
    beats = folder / "beats"
    return beats.exists() and all(f'"/{name}"' in beats.read_text() for name in "abc")
