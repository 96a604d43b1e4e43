"""Programs of a launch file beside a running fleet: restarted, ended together, with a status that tells."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from deploy.launch.join_fleet import Programs
from deploy.processes import NodeSpec, ProcessSpec
from deploy.restart_policy import RestartPolicy

pytestmark = pytest.mark.process


@pytest.fixture(autouse=True)
def handlers() -> Iterator[None]:
    """The signal handlers as they were."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def program(code: str, name: str = "a", when: str = "never", required: bool = False) -> ProcessSpec:
    policy = RestartPolicy(when=when, first=0.01, limit=2)  # type: ignore[arg-type]
    return ProcessSpec(
        name=name,
        nodes=(NodeSpec(name=f"/{name}", kind="x.py"),),
        kind="x.py",
        argv=(sys.executable, "-c", code),
        policy=policy,
        required=required,
    )


def test_programs_run_to_their_ends_and_one_that_died_is_told(capfd: pytest.CaptureFixture[str]) -> None:
    assert Programs([program("print('well')")]).run() == 0
    assert Programs([program("pass"), program("import sys; sys.exit(3)", "b")]).run() == 1
    said = capfd.readouterr()
    assert "well" in said.out
    assert "a finished cleanly" in said.err
    assert "b has died: exit status 3" in said.err


def test_one_that_respawns_is_started_again(tmp_path: Path) -> None:
    code = f"open({str(tmp_path / 'count')!r}, 'a').write('x')"
    assert Programs([program(code, when="always")]).run() == 1
    assert (tmp_path / "count").read_text() == "xxx"


def test_all_end_with_a_required_one_and_by_ctrl_c(tmp_path: Path) -> None:
    waits = f"import os, time; open({str(tmp_path / 'pid')!r}, 'w').write(str(os.getpid())); time.sleep(60)"
    begun = time.monotonic()
    assert Programs([program(waits), program("import time; time.sleep(0.3)", "b", required=True)]).run() == 0
    timer = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    assert Programs([program(waits)]).run() == 130
    assert time.monotonic() - begun < 30
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)
