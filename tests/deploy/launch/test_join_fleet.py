"""Programs of a launch file in a running fleet: restarted, ended together, with a meaningful exit status."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

from deploy.fleet import Fleet, RobotConfig
from deploy.launch import join_fleet
from deploy.launch.join_fleet import Programs, _set_parameters, stop_fleet
from deploy.processes import NodeSpec, ProcessSpec
from deploy.restart_policy import RestartPolicy
from messages.elea import ModelState
from messages.rosparam import RosparamSet
from messages.simulation import ModelList
from services.runtime import light_node, requests
from services.runtime.fleet_instances import FleetInstance
from services.runtime.network_address import NetworkAddress
from tests.harness.waiting import wait_until

pytestmark = pytest.mark.process


@pytest.fixture(autouse=True)
def handlers() -> Iterator[None]:
    """Restore the signal handlers after the test."""
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
    pid = tmp_path / "pid"
    waits = (
        f"import os, time; open({str(pid)!r} + '.new', 'w').write(str(os.getpid()));"
        f" os.rename({str(pid)!r} + '.new', {str(pid)!r}); time.sleep(60)"
    )
    ends = f"import os, time\nwhile not os.path.exists({str(pid)!r}): time.sleep(0.01)"
    begun = time.monotonic()
    assert Programs([program(waits), program(ends, "b", required=True)]).run() == 0
    _assert_ended(pid)

    def interrupt() -> None:
        wait_until(pid.exists, 20.0, "the program")
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=interrupt)
    thread.start()
    assert Programs([program(waits)]).run() == 130
    thread.join()
    assert time.monotonic() - begun < 60
    _assert_ended(pid)


@pytest.mark.parametrize(
    ("namespace", "running", "keys"),
    [
        ("/", 1, {"/robot_description"}),
        ("/r1", 0, {"/r1/robot_description", "/robot_description"}),
        ("/r1", 1, {"/r1/robot_description"}),  # the root's is that of the running robot
    ],
)
def test_the_description_of_a_spawned_robot_is_a_parameter(
    monkeypatch: pytest.MonkeyPatch, namespace: str, running: int, keys: set[str]
) -> None:
    done: list[RosparamSet] = []
    models = ModelList(models=(ModelState(name="other"),) * running)

    def call(transport: object, request: object, key: str, message: Any, timeout: float) -> ModelList:
        done.extend([message] if isinstance(message, RosparamSet) else [])
        return models

    monkeypatch.setattr(light_node, "open_transport", lambda router, domain: nullcontext())
    monkeypatch.setattr(requests, "call", call)
    robot = RobotConfig(name="one", model="burger", namespace=namespace)
    _set_parameters(Fleet(name="f", robot=(robot,)), NetworkAddress("", ""))
    assert {each.key for each in done} == keys
    assert all("<robot" in json.loads(each.value) for each in done)


def test_an_interrupt_while_a_program_starts_leaves_none_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[subprocess.Popen[bytes]] = []

    def start(spec: ProcessSpec) -> subprocess.Popen[bytes]:
        started.append(start_program(spec))
        os.kill(os.getpid(), signal.SIGINT)
        return started[-1]

    start_program = join_fleet._start
    monkeypatch.setattr(join_fleet, "_start", start)
    assert Programs([program("import time; time.sleep(60)")]).run() == 130
    assert [each.poll() is None for each in started] == [False]


def test_a_fleet_that_has_just_ended_needs_no_stop() -> None:
    with subprocess.Popen([sys.executable, "-c", ""]) as ended:
        ended.wait()
    stop_fleet(FleetInstance(fleet="roscore", mode="real", port=1, pid=ended.pid, folder="", started=""))


def _assert_ended(pid: Path) -> None:
    """Assert that the process whose id is in the file has ended, and delete the file for the next one."""
    with pytest.raises(ProcessLookupError):
        os.kill(int(pid.read_text()), 0)
    pid.unlink()
