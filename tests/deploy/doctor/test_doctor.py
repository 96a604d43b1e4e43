"""``doctor``: each check reports its finding, why it matters, and the remedy."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from deploy.doctor import checks, fleet, installation, machine, network
from messages.base import encode
from messages.elea import Health, InputHealth
from messages.topics import ODOM, Quality
from services.runtime.fleet_instances import FleetInstance
from services.runtime.graph import Entity
from services.runtime.network_address import NetworkAddress
from services.runtime.process import ROOT
from services.runtime.transport.unix_sockets import router_endpoint
from services.runtime.transport.wire import encoding
from tests.harness.fork_server import run_verb
from tests.harness.ports import free_port
from tests.harness.processes import Network
from tests.harness.waiting import wait_until


def test_a_sound_machine_passes_and_a_busy_network_is_told(tmp_path: Path) -> None:
    with Network(tmp_path) as net, net.node() as node:
        source = node.subscribe(ODOM, "/odom")
        node.transport.advertise("odom", encoding("geometry_msgs/Twist"), Quality.SENSOR).put(
            encode({"linear": {"x": 1}}), attachment=b""
        )
        wait_until(lambda: (source.update(), source.refused)[1], 10.0, "a refusal")

        def diagnose() -> Any:
            """Return what the doctor tells, unless this node was held up while the doctor listened to it."""
            with subprocess.Popen(
                [sys.executable, "-P", "-m", "deploy", "doctor", "--json", "--connect", net.endpoint],
                cwd=ROOT,
                env={**os.environ, "XDG_STATE_HOME": str(tmp_path)},
                stdout=subprocess.PIPE,
                text=True,
            ) as process:
                while process.poll() is None:
                    node.spin_once()
                    time.sleep(0.05)
                assert process.stdout is not None
                told = json.loads(process.stdout.read())
            assert process.returncode == 0, told
            silent = [each["name"] for each in told["checks"] if each["why"].startswith("no heartbeat")]
            return None if "node /tester" in silent else told

        told = wait_until(diagnose, 60.0, "a node that answers the doctor in time")
    checks = {each["name"]: each for each in told["checks"]}
    assert {each["name"] for each in told["checks"] if each["state"] == "fail"} == set()
    for name in ("platform", "python", "version", "packages", "libraries", "loopback", "clock", "run folder", "router"):
        assert checks[name]["state"] == "ok", checks[name]
    refused = checks["node /tester"]
    assert (refused["state"], refused["why"].startswith("/odom: 1 messages refused")) == ("warn", True)
    assert "geometry_msgs/Twist" in refused["why"]
    assert refused["do"]
    assert all(each["why"] and (each["do"] or each["state"] == "ok") for each in told["checks"])


def test_a_missing_router_fails_with_advice() -> None:
    ran = run_verb("doctor", "--connect", f"tcp/127.0.0.1:{free_port()}")
    assert ran.returncode == 1
    line = next(line for line in ran.stdout.splitlines() if line.startswith("fail"))
    assert "no router at" in line
    assert "-> start a fleet: ./elea up" in ran.stdout
    assert ran.stdout.splitlines()[-1].endswith("1 failures")


def test_the_advice_is_about_the_router_that_was_asked_for() -> None:
    lab = FleetInstance(fleet="lab", mode="real", port=7500, pid=1, folder="", started="")
    assert "its router may hang" in network._advice(router_endpoint(7500), [lab])
    assert network._advice(router_endpoint(7447), [lab]).endswith("running: lab with --port 7500")


def test_a_port_in_foreign_hands_is_told() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        [found] = [f for f in network.ports(NetworkAddress(f"tcp/127.0.0.1:{port}", "")) if f.name == "port"]
    assert found.state == "warn"
    assert "not one of your fleets" in found.why
    assert f":{port}" in found.do


def test_packages_that_differ_from_the_lock_are_named(tmp_path: Path) -> None:
    lock = "numpy==0.1.0 \\\n    --hash=x\nnot-there==1.0 \\\n    --hash=x\nelsewhere==1 ; sys_platform == 'win32' \\\n"
    (tmp_path / "requirements.lock").write_text(lock)
    [found] = installation.packages(tmp_path)
    assert found.state == "fail"
    assert "the lock says 0.1.0; not-there is missing" in found.why
    assert "elsewhere" not in found.why
    (tmp_path / "requirements.lock").unlink()
    assert next(installation.packages(tmp_path)).state == "fail"


def test_versions_that_differ_are_told(tmp_path: Path) -> None:
    (tmp_path / "pyproject.toml").write_text('[project]\nversion = "9.9.9"\n')
    [found] = installation.version(tmp_path)
    assert (found.state, "9.9.9" in found.why) == ("fail", True)
    assert next(installation.environment(tmp_path)).state == "warn"


@pytest.mark.process
def test_a_library_that_does_not_load_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation, "NATIVE_LIBRARIES", ("json", "not_there"))
    [found] = installation.libraries()
    assert (found.state, found.why) == ("fail", "not_there: ModuleNotFoundError: No module named 'not_there'")


def test_a_folder_that_cannot_be_written_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    [found] = machine.run_folder_writable(tmp_path / "runs")
    assert found.state == "ok"
    [found] = machine.run_folder_writable(Path("/proc/runs"))
    assert (found.state, "cannot be written" in found.why) == ("fail", True)
    monkeypatch.setattr(machine, "MIN_DISK_MIB", 1 << 40)
    assert next(machine.run_folder_writable(tmp_path)).state == "fail"


def test_displays_are_told_apart(tmp_path: Path) -> None:
    assert next(machine.display({})).why.startswith("none")
    assert next(machine.display({"DISPLAY": ":4711"})).state == "warn"
    assert next(machine.display({"DISPLAY": "far:0"})).state == "ok"
    assert next(machine.display({"WAYLAND_DISPLAY": "w", "XDG_RUNTIME_DIR": str(tmp_path)})).state == "warn"
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(tmp_path / "w"))
        assert next(machine.display({"WAYLAND_DISPLAY": "w", "XDG_RUNTIME_DIR": str(tmp_path)})).state == "ok"


@pytest.mark.process
def test_the_machine_is_looked_at() -> None:
    assert [
        each.state
        for check in (machine.python_version, machine.platform_supported, machine.loopback)
        for each in check()
    ] == ["ok"] * 3
    assert {each.name for each in machine.cores_and_memory()} == {"cores", "memory"}


def test_a_clock_that_steps_is_told_from_a_process_that_is_interrupted(monkeypatch: pytest.MonkeyPatch) -> None:
    class Clocks:
        """Clocks of which one reading in four is interrupted for a second."""

        strftime = staticmethod(time.strftime)

        def __init__(self, step: float) -> None:
            self.passed, self.ahead, self.readings, self.step = 0.0, 1.8e9, 0, step

        def monotonic(self) -> float:
            self.readings += 1
            self.passed += 1.0 if self.readings % 4 == 0 else 1e-7
            return self.passed

        def time(self) -> float:
            return self.passed + self.ahead

        def sleep(self, seconds: float) -> None:
            self.passed += seconds
            self.ahead += self.step

    for step, said in ((0.0, "steady"), (0.2, "the wall clock stepped by 200 ms"), (-3.0, "stepped by 3000 ms")):
        monkeypatch.setattr(machine, "time", Clocks(step))
        (found,) = machine.clock()
        assert said in found.why
        assert found.state == ("warn" if step else "ok")


def test_nodes_tell_what_troubles_them() -> None:
    entities = [Entity("1", "node", each) for each in ("/sim", "/hung", "/_tf_echo_12")]
    lossy = InputHealth(topic="/odom", received=90, lost=10)
    beats = {"/sim": Health(node="/sim", state="running", inputs=(lossy,)), "/w": Health(node="/w", state="waiting")}
    found = [(each.name, each.state, each.why) for each in network.nodes(entities, beats)]
    assert found == [
        ("node /hung", "warn", "no heartbeat in 2 s: it is busy, stopped or hung"),
        ("node /sim", "warn", "/odom: 10 of 100 messages were lost on the way"),
        ("node /w", "warn", "it waits: it does not say for what"),
    ]


def test_a_process_that_lost_its_supervisor_is_found(tmp_path: Path) -> None:
    """The service is orphaned: the shell that starts it ends at once."""
    command = f"{sys.executable} -P -m services router --param listen=tcp/127.0.0.1:{free_port()} & echo $!"
    shell = subprocess.run(
        ["bash", "-c", f"{command.replace(' & ', ' >/dev/null 2>&1 & ')}"],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    pid = int(shell.stdout)
    try:
        wait_until(lambda: f"router ({pid})" in next(fleet.orphans()).why, 10.0, "the orphan")
        assert next(fleet.orphans()).state == "warn"
    finally:
        os.kill(pid, 9)


def test_what_many_nodes_have_in_common_is_said_once() -> None:
    beats = {f"/tb3_{i}/nav": Health(node=f"/tb3_{i}/nav", state="waiting", note="no clock") for i in range(100)}
    lossy = tuple(InputHealth(topic=f"/tb3_{i}/odom", received=9, lost=1) for i in range(5))
    [loss, _] = network.nodes([], {"/grader": Health(node="/grader", state="running", inputs=lossy, lost=5)})
    assert loss.why == (
        "5 topics, /tb3_0/odom, /tb3_1/odom, /tb3_2/odom and 2 more: 5 of 50 messages were lost on the way"
    )
    several = checks.merge_alike([*network.nodes([], beats), *network.nodes([], {"/sim": beats["/tb3_0/nav"]})])
    assert [each.name for each in several] == ["101 nodes", "nodes", "nodes"]
    assert several[0].why == "it waits: no clock: /tb3_0/nav, /tb3_1/nav, /tb3_10/nav and 98 more"
