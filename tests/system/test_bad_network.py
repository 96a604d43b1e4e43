"""Invalid data on the network: on the topics that services read, on internal keys, and among liveliness tokens."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import msgpack
import pytest
import zenoh

from messages.elea import GoalStatus
from messages.geometry import Pose, PoseStamped, Twist
from messages.topics import CMD_VEL, GOAL_POSE, STATUS
from services.runtime.graph import snapshot
from services.runtime.process import ROOT
from services.runtime.transport.api import ADMIN_SPACE
from tests.harness.external_client import external_client
from tests.harness.message_recorder import WITHIN_S, MessageRecorder, distance
from tests.harness.processes import Process
from tests.harness.waiting import wait_until
from tests.system.two_robot_simulation import TwoRobotSimulation, two_robot_simulation

GARBAGE = (b"", b"\xc1", b"\x81", b"\x90", msgpack.packb({"data": 1}), b"\xdb" * 100_000, b"\x91" * 10_000)
STOP = msgpack.packb({"data": True})
FAR = {"clock": {"sec": 2**31 - 1, "nanosec": 0}, "tick": 2**62, "epoch": 2**62}
CLOCKS = (
    *GARBAGE,
    msgpack.packb({"clock": "now"}),
    msgpack.packb({"clock": {"sec": math.nan}}),
    msgpack.packb({"clock": {"sec": -5}}),
    msgpack.packb({"clock": {"sec": 2**70 % 2**64}}),
    msgpack.packb(FAR),
    msgpack.packb({"paused": True}),
)


@pytest.fixture(scope="module", params=["real", "lockstep"])
def running(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[TwoRobotSimulation]:
    mode = str(request.param)
    with two_robot_simulation(tmp_path_factory.mktemp(mode), mode) as made:
        wait_until(lambda: made.health("/reset_monitor").ticks > 0, WITHIN_S, "ticks of the reset monitor")
        yield made


@pytest.fixture(scope="module")
def driver(running: TwoRobotSimulation) -> Process:
    """A waypoint service for tb3_0 without a goal."""
    started = running.network.start("waypoint", "--namespace", "tb3_0")
    wait_until(lambda: running.health("/tb3_0/waypoint").ticks > 0, WITHIN_S, "ticks of the waypoint service")
    return started


@pytest.fixture(scope="module")
def session(running: TwoRobotSimulation) -> Iterator[zenoh.Session]:
    """A foreign session, once its links to the services are up: earlier messages would be lost."""
    with external_client(running.network.endpoint) as made:
        for key in ("tb3_0/e_stop", "tb3_0/goal_pose", "tb3_0/cmd_vel"):
            publisher = made.declare_publisher(key)
            wait_until(lambda p=publisher: p.matching_status.matching, WITHIN_S, f"somebody who hears {key}")  # type: ignore[misc]
            publisher.undeclare()
        yield made


@pytest.fixture(autouse=True)
def _all_live(running: TwoRobotSimulation, driver: Process) -> Iterator[None]:
    """Assert after each test that every process still runs."""
    yield
    for process in (running.sim, running.reset_monitor, running.network.router, driver):
        assert process.status is None, process.text
    assert "Traceback" not in running.sim.text + running.reset_monitor.text + driver.text


@pytest.fixture(scope="module", autouse=True)
def _all_turn(running: TwoRobotSimulation, driver: Process) -> Iterator[None]:
    """Assert after all tests that every loop still runs."""
    yield
    for node in ("/sim", "/reset_monitor", "/tb3_0/waypoint"):
        before = running.health(node).ticks
        wait_until(lambda n=node, b=before: running.health(n).ticks > b, WITHIN_S, f"ticks of {node}")  # type: ignore[misc]


def sessions(running: TwoRobotSimulation, node: str) -> list[str]:
    """Return the sessions of a node, from its tokens."""
    return [each.session for each in snapshot(running.node.transport) if each.node == node]


def refused(running: TwoRobotSimulation, node: str, topic: str) -> int:
    return next(each.refused for each in running.health(node).inputs if each.topic == topic)


def test_garbage_on_e_stop_stops_nobody(running: TwoRobotSimulation, session: zenoh.Session) -> None:
    before = refused(running, "/sim", "/tb3_0/e_stop")
    for payload in GARBAGE:
        session.put("tb3_0/e_stop", payload)
    for key in ("*/e_stop", "**"):
        session.put(key, STOP)
    session.delete("tb3_0/e_stop")
    sent = len(GARBAGE) + 3
    wait_until(lambda: refused(running, "/sim", "/tb3_0/e_stop") >= before + sent, WITHIN_S, "refusals")
    truth, commands = running.truth["tb3_0"], running.node.advertise(CMD_VEL, "/tb3_0/cmd_vel")
    start = truth.wait_next()

    def moved() -> bool:
        commands.publish(Twist.planar(-0.2, 0.0))
        return distance(start, truth.wait_next()) > 0.02

    wait_until(moved, WITHIN_S, "a robot that obeys")


def test_garbage_on_goal_pose(running: TwoRobotSimulation, session: zenoh.Session) -> None:
    before = refused(running, "/tb3_0/waypoint", "/tb3_0/goal_pose")
    bad: list[Any] = [math.nan, math.inf, 1e308, "1", None]
    for payload in (*GARBAGE[:4], *(msgpack.packb({"pose": {"position": {"x": each}}}) for each in bad)):
        session.put("tb3_0/goal_pose", payload)
    session.put("**", msgpack.packb({"pose": {"position": {"x": 50.0}}}))
    wait_until(lambda: refused(running, "/tb3_0/waypoint", "/tb3_0/goal_pose") >= before + 10, WITHIN_S, "refusals")
    start = running.truth["tb3_0"].wait_until_still()
    assert distance(start, running.truth["tb3_0"].wait_after(0.5)) < 1e-3
    status: MessageRecorder[GoalStatus] = MessageRecorder(running.node.subscribe(STATUS, "/tb3_0/status"))
    goals = running.node.advertise(GOAL_POSE, "/tb3_0/goal_pose")
    at = start.pose.pose.position
    goals.publish(PoseStamped(pose=Pose.planar(at.x + 0.1, at.y)))
    wait_until(
        lambda: any(each.state == "finished" and each.goal.position.x == at.x + 0.1 for each in status.received()),
        WITHIN_S,
        "the next good goal reached",
    )


def test_garbage_on_the_clock(running: TwoRobotSimulation, session: zenoh.Session) -> None:
    """It makes no node's time jump, stop or restart."""
    resets = running.reset_monitor.text.count("reset:")
    before = running.truth["tb3_0"].wait_next().header.stamp.ns
    for payload in CLOCKS:
        for encoding in (None, "text/plain", "application/msgpack;rosgraph_msgs/Clock"):
            session.put("clock", payload, encoding=encoding)
    session.delete("clock")
    after = running.truth["tb3_0"].wait_after(0.5).header.stamp.ns
    assert before < after < before + 60 * 10**9
    wait_until(lambda: running.health("/reset_monitor").state == "running", WITHIN_S, "a node that runs")
    assert running.reset_monitor.text.count("reset:") == resets
    assert "twice at" not in running.reset_monitor.text


def test_a_wildcard_does_not_set_the_clock(running: TwoRobotSimulation, session: zenoh.Session) -> None:
    resets = running.reset_monitor.text.count("reset")
    for payload in (b"\x80", msgpack.packb(FAR), msgpack.packb({"paused": True})):
        session.put("**", payload)
        session.put("*", payload, encoding="application/msgpack;rosgraph_msgs/Clock")
    session.put("clock", msgpack.packb(FAR), encoding="application/msgpack;std_msgs/Bool")
    running.truth["tb3_0"].wait_after(0.5)
    wait_until(lambda: running.health("/reset_monitor").state == "running", WITHIN_S, "a node that runs")
    assert running.reset_monitor.text.count("reset") == resets


def test_garbage_on_the_keys_of_lockstep(running: TwoRobotSimulation, session: zenoh.Session) -> None:
    nodes = ("/sim", "/reset_monitor", "/tb3_0/waypoint")
    ids = [wait_until(lambda n=node: sessions(running, n), WITHIN_S, f"the tokens of {node}")[0] for node in nodes]  # type: ignore[misc]
    for payload in (*GARBAGE, msgpack.packb(["x"]), msgpack.packb(["x", -1, "0", None])):
        for key in (
            f"{ADMIN_SPACE}/**",
            *(f"{ADMIN_SPACE}/{each}/{end}" for each in ids for end in ("go", "done", "rest")),
        ):
            session.put(key, payload)


def test_odd_tokens(running: TwoRobotSimulation, session: zenoh.Session) -> None:
    token = session.liveliness().declare_token
    live = wait_until(lambda: sessions(running, "/reset_monitor"), WITHIN_S, "the tokens of the reset monitor")[0]
    odd = (
        "x",
        "%",
        "%%",
        "no_slash",
        "%a%",
        "%tb3_0%cmd_vel",
        "ünïcode",
        "a b",
        "'\"\\",
        "-",
        "9" * 300,
        "%reset_monitor",
    )
    tokens = [token(f"{ADMIN_SPACE}/x")]
    for text in odd:
        for kind in ("node", "pub", "sub", "srv", "step", "none"):
            tokens.append(token(f"{ADMIN_SPACE}/{text}/{kind}/{text}/{text}/{text}/{text}"))
            tokens.append(token(f"{ADMIN_SPACE}/{live[:8]}/{kind}/%foe/{text}/geometry_msgs%Twist/{text}"))
    for period in ("0", "-5", "1e9", "²", "²²", "9" * 400, "nan"):
        tokens.append(token(f"{ADMIN_SPACE}/abc{len(tokens)}/step/%reset_monitor/-/-/{period}"))
    running.truth["tb3_0"].wait_after(0.5)
    drawn = subprocess.run(
        [sys.executable, "-P", "-m", "deploy", "graph", "--connect", running.network.endpoint, "--json"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert drawn.returncode == 0, drawn.stderr
    nodes = {each["node"] for each in json.loads(drawn.stdout)}
    assert {"/sim", "/reset_monitor", "/tb3_0/waypoint", "/router"} <= nodes
    assert all(each.startswith("/") for each in nodes)
    for each in tokens:
        each.undeclare()  # type: ignore[no-untyped-call]
    running.truth["tb3_0"].wait_after(0.5)
