"""A network full of nonsense: on the topics that services read, on their own keys, and among their tokens."""

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
from services.runtime.network.transport import KERNEL
from services.runtime.process import ROOT
from tests.processes import Process
from tests.system.stranger import stranger
from tests.system.watched import WITHIN_S, Watched, apart
from tests.system.world import World, world
from tests.waiting import until

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
def running(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[World]:
    mode = str(request.param)
    with world(tmp_path_factory.mktemp(mode), mode) as made:
        until(lambda: made.beat("/witness").ticks > 0, WITHIN_S, "ticks of the witness")
        yield made


@pytest.fixture(scope="module")
def driver(running: World) -> Process:
    """A waypoint service for tb3_0 without a goal."""
    started = running.network.start("waypoint", "--namespace", "tb3_0")
    until(lambda: running.beat("/tb3_0/waypoint").ticks > 0, WITHIN_S, "ticks of the waypoint service")
    return started


@pytest.fixture(scope="module")
def session(running: World) -> Iterator[zenoh.Session]:
    """A foreign session that those whom it will bother can hear: what is put before its links are up is lost."""
    with stranger(running.network.endpoint) as made:
        for key in ("tb3_0/e_stop", "tb3_0/goal_pose", "tb3_0/cmd_vel"):
            publisher = made.declare_publisher(key)
            until(lambda p=publisher: p.matching_status.matching, WITHIN_S, f"somebody who hears {key}")  # type: ignore[misc]
            publisher.undeclare()
        yield made


@pytest.fixture(autouse=True)
def _all_live(running: World, driver: Process) -> Iterator[None]:
    """Every process runs, and its loop turns."""
    yield
    for process in (running.sim, running.witness, running.network.router, driver):
        assert process.status is None, process.text
    begun = len(running.health.all())
    for node in ("/sim", "/witness", "/tb3_0/waypoint"):
        until(lambda n=node: turns(running, n, begun), WITHIN_S, f"ticks of {node}")  # type: ignore[misc]
    assert "Traceback" not in running.sim.text + running.witness.text + driver.text


def sessions(running: World, node: str) -> list[str]:
    """The sessions of a node, by its tokens."""
    return [each.session for each in snapshot(running.node.transport) if each.node == node]


def turns(running: World, node: str, begun: int) -> bool:
    """Whether the last heartbeat of a node came after the first ``begun`` ones of all, with other ticks than before."""
    beats = [(index, each.ticks) for index, each in enumerate(running.health.all()) if each.node == node]
    return len(beats) > 1 and beats[-1][0] >= begun and beats[-1][1] != beats[-2][1]


def refused(running: World, node: str, topic: str) -> int:
    return next(each.refused for each in running.beat(node).inputs if each.topic == topic)


def test_garbage_on_e_stop_stops_nobody(running: World, session: zenoh.Session) -> None:
    before = refused(running, "/sim", "/tb3_0/e_stop")
    for payload in GARBAGE:
        session.put("tb3_0/e_stop", payload)
    for key in ("*/e_stop", "**"):
        session.put(key, STOP)
    session.delete("tb3_0/e_stop")
    sent = len(GARBAGE) + 3
    until(lambda: refused(running, "/sim", "/tb3_0/e_stop") >= before + sent, WITHIN_S, "refusals")
    truth, commands = running.truth["tb3_0"], running.node.write(CMD_VEL, "/tb3_0/cmd_vel")
    start = truth.next()

    def moved() -> bool:
        commands.publish(Twist.planar(-0.2, 0.0))
        return apart(start, truth.next()) > 0.02

    until(moved, WITHIN_S, "a robot that obeys")


def test_garbage_on_goal_pose(running: World, session: zenoh.Session) -> None:
    before = refused(running, "/tb3_0/waypoint", "/tb3_0/goal_pose")
    bad: list[Any] = [math.nan, math.inf, 1e308, "1", None]
    for payload in (*GARBAGE[:4], *(msgpack.packb({"pose": {"position": {"x": each}}}) for each in bad)):
        session.put("tb3_0/goal_pose", payload)
    session.put("**", msgpack.packb({"pose": {"position": {"x": 50.0}}}))
    until(lambda: refused(running, "/tb3_0/waypoint", "/tb3_0/goal_pose") >= before + 10, WITHIN_S, "refusals")
    start = running.truth["tb3_0"].after(0.6)
    assert apart(start, running.truth["tb3_0"].after(0.5)) < 1e-3
    status: Watched[GoalStatus] = Watched(running.node.read(STATUS, "/tb3_0/status"))
    goals = running.node.write(GOAL_POSE, "/tb3_0/goal_pose")
    at = start.pose.pose.position
    goals.publish(PoseStamped(pose=Pose.planar(at.x + 0.1, at.y)))
    until(
        lambda: any(each.state == "finished" and each.goal.position.x == at.x + 0.1 for each in status.all()),
        WITHIN_S,
        "the next good goal reached",
    )


def test_garbage_on_the_clock(running: World, session: zenoh.Session) -> None:
    for payload in CLOCKS:
        for encoding in (None, "text/plain", "application/msgpack;rosgraph_msgs/Clock"):
            session.put("clock", payload, encoding=encoding)
    session.delete("clock")


def test_a_wildcard_does_not_set_the_clock(running: World, session: zenoh.Session) -> None:
    resets = running.witness.text.count("reset")
    for payload in (b"\x80", msgpack.packb(FAR), msgpack.packb({"paused": True})):
        session.put("**", payload)
        session.put("*", payload, encoding="application/msgpack;rosgraph_msgs/Clock")
    session.put("clock", msgpack.packb(FAR), encoding="application/msgpack;std_msgs/Bool")
    running.truth["tb3_0"].after(0.5)
    assert running.beat("/witness").state == "running"
    assert running.witness.text.count("reset") == resets


def test_garbage_on_the_keys_of_lockstep(running: World, session: zenoh.Session) -> None:
    nodes = ("/sim", "/witness", "/tb3_0/waypoint")
    ids = [until(lambda n=node: sessions(running, n), WITHIN_S, f"the tokens of {node}")[0] for node in nodes]  # type: ignore[misc]
    for payload in (*GARBAGE, msgpack.packb(["x"]), msgpack.packb(["x", -1, "0", None])):
        for key in (f"{KERNEL}/**", *(f"{KERNEL}/{each}/{end}" for each in ids for end in ("go", "done", "rest"))):
            session.put(key, payload)


def test_odd_tokens(running: World, session: zenoh.Session) -> None:
    token = session.liveliness().declare_token
    live = until(lambda: sessions(running, "/witness"), WITHIN_S, "the tokens of the witness")[0]
    odd = ("x", "%", "%%", "no_slash", "%a%", "%tb3_0%cmd_vel", "ünïcode", "a b", "'\"\\", "-", "9" * 300, "%witness")
    tokens = [token(f"{KERNEL}/x")]
    for text in odd:
        for kind in ("node", "pub", "sub", "srv", "step", "none"):
            tokens.append(token(f"{KERNEL}/{text}/{kind}/{text}/{text}/{text}/{text}"))
            tokens.append(token(f"{KERNEL}/{live[:8]}/{kind}/%foe/{text}/geometry_msgs%Twist/{text}"))
    for period in ("0", "-5", "1e9", "²", "²²", "9" * 400, "nan"):
        tokens.append(token(f"{KERNEL}/abc{len(tokens)}/step/%witness/-/-/{period}"))
    running.truth["tb3_0"].after(0.5)
    drawn = subprocess.run(
        [sys.executable, "-P", "-m", "deploy", "graph", "--connect", running.network.endpoint, "--json"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert drawn.returncode == 0, drawn.stderr
    nodes = {each["node"] for each in json.loads(drawn.stdout)}
    assert {"/sim", "/witness", "/tb3_0/waypoint", "/router"} <= nodes
    assert all(each.startswith("/") for each in nodes)
    for each in tokens:
        each.undeclare()  # type: ignore[no-untyped-call]
    running.truth["tb3_0"].after(0.5)
