"""The panel of a real fleet, without a browser: access, the cost of a dead page, hung requests, the command."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import psutil
import pytest
from websockets.exceptions import InvalidStatus

from messages.topics import HEALTH
from services.panel.address import ADDRESS_FILE, read_address
from services.runtime.process import ROOT
from tests.harness.ports import free_port
from tests.harness.processes import Network, Process
from tests.harness.stopping import stop_process
from tests.harness.waiting import wait_until
from tests.services.panel.conftest import ROBOTS, WITHIN_S, PanelFleet
from tests.services.panel.page_client import page_client, send, wait_message

POSES = [
    {"id": number, "topic": f"{robot}/odom", "path": path}
    for number, (robot, path) in enumerate(
        (robot, path)
        for robot in ROBOTS
        for path in ("pose.pose.position.x", "twist.twist.linear.x", "header.stamp.sec")
    )
]


def outlive_dead_page(fleet: PanelFleet, begun: threading.Event) -> tuple[int, int]:
    """Run a page beside one that never reads, until that one is dropped; return the frames received and the turns that
    the panel's loop took meanwhile.
    """
    with (
        fleet.join("watcher") as node,
        page_client(fleet.address) as alive,
        page_client(fleet.address, queue=1) as dead,
    ):
        beats = node.subscribe(HEALTH)
        send(alive, k="subscribe", channels=["poses"], series=POSES)
        send(dead, k="subscribe", channels=["poses", "graph", "rates", "sets", "values"], series=POSES)
        wait_until(lambda: wait_message(alive, "about")["pages"] == 2, WITHIN_S, "both are there")
        begun.set()
        frames, turns = 0, list[int]()

        def dropped() -> bool:
            nonlocal frames
            wait_message(alive, "frame")
            frames += 1
            beats.update()
            turns.extend(health.ticks for health, _ in beats.messages if health.node == "/panel")
            return frames % 10 == 0 and wait_message(alive, "about")["pages"] == 1

        wait_until(dropped, 40.0, "the dead page is given up")
    return frames, max(turns, default=0) - min(turns, default=0)


@pytest.fixture(scope="module")
def dead_page(fleet: PanelFleet) -> Iterator[Future[tuple[int, int]]]:
    """A dead page during the other tests, as the panel waits seven seconds for it."""
    begun = threading.Event()
    with ThreadPoolExecutor(1) as pool:
        outlived = pool.submit(outlive_dead_page, fleet, begun)
        wait_until(lambda: begun.is_set() or outlived.done(), WITHIN_S, "both pages")
        yield outlived


@pytest.mark.usefixtures("dead_page")
@pytest.mark.parametrize(
    "wrong", [{"token": "forged-token-of-another-run-000000"}, {"origin": "http://evil.example"}, {"origin": "null"}]
)
def test_a_forged_token_or_a_foreign_page_changes_nothing(fleet: PanelFleet, wrong: dict[str, str]) -> None:
    with pytest.raises(InvalidStatus) as refused, page_client(fleet.address, **wrong) as at:
        send(at, k="estop", id=1, on=True)
    assert refused.value.response.status_code == 403
    fleet.wait(lambda: not any(fleet.base[robot].e_stopped for robot in ROBOTS))


def test_it_listens_on_the_loopback_alone(fleet: PanelFleet) -> None:
    listening = [
        each.laddr.ip for each in psutil.Process(fleet.address.pid).net_connections("tcp") if each.status == "LISTEN"
    ]
    assert set(listening) == {"127.0.0.1"}


def test_a_request_to_a_process_that_hangs_is_given_up_in_time(fleet: PanelFleet) -> None:
    params = fleet.processes["params"]
    stop_process(params.pid)
    with page_client(fleet.address) as at:
        send(at, k="subscribe", channels=["clock"])
        send(at, k="set", id=5, set="/tb3_0/waypoint", values={"max_linear": 0.2}, run=True)
        reply = wait_message(at, "reply")
        assert reply["id"] == 5
        assert not reply["ok"]
        wait_message(at, "clock")

    def back() -> bool:
        now = fleet.processes["params"]
        return now.state == "ready" and now.pid != params.pid

    fleet.wait(back, 2 * WITHIN_S, "the parameter service is back")


def test_a_page_whose_words_stop_lets_the_robot_go(fleet: PanelFleet) -> None:
    fleet.reset_world()
    # Nobody reads what it receives while it waits; a page with a full queue would not answer the panel's pings.
    with page_client(fleet.address, queue=1 << 14) as at:
        send(at, k="subscribe", channels=["robots"])

        def driven() -> bool:
            send(at, k="drive", robot="/tb3_1", v=0.2)
            time.sleep(0.05)  # as a page does: a panel that is held up would read more than 200 in a second
            return fleet.is_moving("/tb3_1")

        fleet.wait(driven, WITHIN_S, "it moves while the page drives")
        fleet.wait(lambda: fleet.is_standing("/tb3_1"), WITHIN_S, "it stands, with the page still there")
        send(at, k="drive", robot="/tb3_1", v=0.2)
        send(at, k="drive", robot="/tb3_1", v=40.0)
        assert "no page drives faster" in wait_message(at, "error")["reason"]


def verb(
    fleet: PanelFleet, *arguments: str, environment: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    state = {"PYTHONPATH": str(ROOT), "XDG_STATE_HOME": str(fleet.folder / "state")}
    environment = {**os.environ, **state, **(environment or {})}
    command = [sys.executable, "-P", "-m", "deploy", "panel", *arguments]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300, check=False)


def test_the_verb_tells_where_the_page_of_the_running_fleet_is(fleet: PanelFleet) -> None:
    ran = verb(fleet, "--json")
    assert ran.returncode == 0, ran.stderr
    assert json.loads(ran.stdout)["url"] == fleet.address.url
    assert verb(fleet, "--no-open").stdout.strip() == fleet.address.url
    wait_until(lambda: fleet.address.url in fleet.up.text, WITHIN_S, "the page's address")
    assert fleet.address.token not in (fleet.folder / "run" / "logs" / "panel.log").read_text()


def test_the_browsers_command_line_holds_no_token(fleet: PanelFleet, tmp_path: Path) -> None:
    shown = tmp_path / "shown"
    browser = tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\necho "$@" > {shown}\n')
    browser.chmod(0o700)
    environment = {"DISPLAY": ":0", "BROWSER": f"{browser} %s"}
    assert verb(fleet, environment=environment).stdout.strip() == fleet.address.url
    wait_until(lambda: shown.exists() and shown.read_text().endswith("\n"), 10.0, "a browser")
    address = shown.read_text().strip()
    assert address.startswith(f"http://127.0.0.1:{fleet.address.port}/?once=")
    assert fleet.address.token not in address


def test_the_verb_starts_a_panel_where_there_is_none(tmp_path: Path) -> None:
    with Network(tmp_path) as network:
        command = ["-m", "deploy", "panel", "--connect", network.endpoint, "--page-port", "0", "--json"]
        with Process(command, tmp_path / "verb.log", {"XDG_STATE_HOME": str(tmp_path)}) as process:
            wait_until(lambda: process.status is not None or "url" in process.text, 30.0)
            assert process.status is None, process.text
            port = json.loads(next(line for line in process.text.splitlines() if line.startswith("{")))["port"]
            assert port > 0
            process.signal(signal.SIGINT)
            assert process.wait(WITHIN_S) == 0
    nobody = subprocess.run(
        [sys.executable, "-P", "-m", "deploy", "panel", "--connect", network.endpoint],
        env={**os.environ, "PYTHONPATH": str(ROOT), "XDG_STATE_HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert nobody.returncode == 2
    assert "no router at" in nobody.stderr


LOCKSTEP = """
name = "pair"
[run]
mode = "lockstep"
latency = 1
ends = "goals"
duration = 60
[[robot]]
name = "a"
model = "burger"
[[robot]]
name = "b"
model = "burger"
pose = { y = 1.0 }
[[every_robot]]
kind = "waypoint"
from_start = ["goals"]
parameters = { goals = [[0.3, 0.1]] }
[[service]]
kind = "starter.py"
"""
STARTER = """
from collections.abc import Iterator, Mapping
from pathlib import Path
from services.runtime import Parameters, Service, main

def run(ctx):
    while not Path({signal!r}).exists():
        ctx.idle()
    for _ in ctx.ticks():
        pass

if __name__ == "__main__":
    main(Service(name="starter", about="Time begins when a file is there.", run=run, rate=25))
"""


def driven(folder: Path, watched: bool) -> str:
    """Return the hash of a lockstep run's trajectories, without a panel or with one whose page reads everything."""
    folder.mkdir()
    file, begin = folder / "pair.toml", folder / "begin"
    (folder / "starter.py").write_text(STARTER.format(signal=str(begin)))
    file.write_text(LOCKSTEP + ('[[service]]\nkind = "panel"\nparameters = { port = 0 }\n' if watched else ""))
    command = ["-m", "deploy", "up", str(file), "--report", str(folder / "run"), "--port", str(free_port())]
    with Process(
        [*command, "--no-view", "--no-picture", "--json"], folder / "up.log", {"XDG_STATE_HOME": str(folder)}
    ) as up:
        if watched:
            wait_until(lambda: read_address(folder / "run" / ADDRESS_FILE), 40.0, "the panel's address")
            address = read_address(folder / "run" / ADDRESS_FILE)
            assert address is not None
            topics = [f"/{robot}/{topic}" for robot in "ab" for topic in ("odom", "cmd_vel", "imu", "scan")]
            paths = ("twist.twist.linear.x", "linear.x", "linear_acceleration.x", "ranges[0]")
            series = [{"id": n, "topic": t, "path": paths[n % 4]} for n, t in enumerate(topics)]
            with page_client(address) as at:
                channels = ["poses", "robots", "graph", "rates", "log", "sets", "values"]
                send(at, k="subscribe", channels=channels, series=series)
                wait_message(at, "graph", 30.0)
                begin.touch()
                wait_message(at, "frame", 30.0)
                up.wait(300.0)
        else:
            begin.touch()
            up.wait(300.0)
    report = json.loads((folder / "run" / "report.json").read_text())
    return str(report["run"]["trajectory_hash"])


def test_lockstep_runs_alike_whether_or_not_somebody_looks(tmp_path: Path) -> None:
    with ThreadPoolExecutor(1) as beside:
        alone = beside.submit(driven, tmp_path / "alone", watched=False)
        assert driven(tmp_path / "watched", watched=True) == alone.result()


def test_a_page_that_is_dead_slows_nobody_and_is_dropped(dead_page: Future[tuple[int, int]]) -> None:
    """It is dropped after seven seconds of 25 frames each; on a busy machine a second or two of that may be left."""
    frames, turns = dead_page.result()
    assert frames >= 20
    assert turns > 10, "the panel's own heart went on"
