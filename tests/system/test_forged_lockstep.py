"""Lockstep with an intruder that knows every session: forged grants, reports, tokens and samples on a real fleet."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import msgpack
import psutil
import zenoh

from messages.base import raw_decoder
from messages.elea import Health
from messages.geometry import Twist
from services.runtime.graph import EVERYTHING, Entity
from services.runtime.lockstep.protocol import grant_key, report_key
from services.runtime.transport.unix_sockets import check_reachable, router_endpoint
from services.runtime.transport.wire import encoding, member_id, pack_attachment, publisher_id
from tests.harness.command_line import CommandLine
from tests.harness.external_client import external_client
from tests.harness.waiting import wait_until

FLEET = """
name = "watched"
[run]
mode = "lockstep"
ends = "goals"
latency = 1
[[robot]]
name = "r"
model = "burger"
services = [{ kind = "waypoint", parameters = { goals = [[1.0, 0.0], [1.0, 0.5], [0.2, 0.5]] } }]
"""
GATE = """
from pathlib import Path

from services.runtime import main


def run(ctx):
    for _ in ctx.ticks():
        while not Path({file!r}).exists():
            ctx.idle()


main(run, name="gate", about="Holds time at its first tick until a file exists.", rate=25)
"""
WAYPOINT, SIM = "/r/waypoint", "/sim"
START_S, RUN_S = 60.0, 150.0
FAR = 2**62
REFUSED = ((WAYPOINT, "lockstep: Go"), (SIM, "lockstep: Done"), (SIM, "/r/cmd_vel"))
"""The nodes whose health counts forged messages, with the name of each count."""
EVERY = 25
"""Clock messages between two rounds of forgeries: half a second of simulation time."""


class Forger:
    """An intruder in a fleet, which sees all tokens and heartbeats and may send anything."""

    def __init__(self, session: zenoh.Session, gate: Path) -> None:
        self.session, self.own = session, str(session.zid())
        self.gate = gate
        self.beats: dict[str, Health] = {}
        self.clocks = 0
        self._tokens: list[Any] = []
        self._read = raw_decoder(Health)
        self._health = session.declare_subscriber("health", lambda sample: self._hear(sample))
        self._clock = session.declare_subscriber("clock", lambda _: self._tick())

    def _hear(self, sample: Any) -> None:
        beat = self._read(sample.payload.to_bytes())
        self.beats[beat.node] = beat

    def _tick(self) -> None:
        self.clocks += 1

    def sessions(self, kind: str) -> dict[str, str]:
        """Return the session of each node with a token of this kind, except the forger's own."""
        keys = [str(reply.ok.key_expr) for reply in self.session.liveliness().get(EVERYTHING, timeout=30.0) if reply.ok]
        found = [entity for entity in map(Entity.parse, keys) if entity is not None]
        return {each.node: each.session for each in found if each.kind == kind and each.session != self.own}

    def show(self, *entities: Entity) -> None:
        self._tokens += [self.session.liveliness().declare_token(each.key) for each in entities]

    def hide(self) -> None:
        for token in self._tokens:
            token.undeclare()
        self._tokens = []

    def refused(self, node: str, name: str) -> int:
        """Return a node's count of rejected messages under this name, from its health."""
        beat = self.beats.get(node)
        return next((each.refused for each in beat.inputs if each.topic == name), 0) if beat else 0

    def ask(self, key: str, request: dict[str, Any]) -> None:
        """Send a request, as any tool may."""
        (reply,) = self.session.get(key, payload=msgpack.packb(request), timeout=30.0)
        assert reply.ok, reply.err

    def begin_paused(self) -> None:
        """Pause time before its first tick has passed: however slow this process is, the run does not end before."""
        members = {WAYPOINT, "/grader", "/params", "/gate"}
        wait_until(lambda: members <= self.sessions("step").keys(), START_S, "the members")
        wait_until(lambda: SIM in self.sessions("node"), START_S, "the simulation")
        payload = msgpack.packb({})
        wait_until(lambda: [*self.session.get("sim/pause", payload=payload, timeout=60.0)], START_S, "a pause")
        self.gate.touch()

    def await_health(self, nodes: set[str]) -> None:
        """Wait for another heartbeat of each node."""
        before = {node: self.beats.get(node) for node in nodes}
        wait_until(lambda: all(self.beats.get(node) is not before[node] for node in nodes), RUN_S, "health")

    def attack(self, sim: str, members: dict[str, str]) -> None:
        """Send one round of all forgeries, each well-formed on the wire."""
        for node, member in members.items():
            for simulation in (sim, self.own, "feed", "", "a?b", "a/b", "*", "x" * 99):
                for rest in (
                    [0, 0, 0, False],
                    [FAR, FAR, FAR, False],
                    [2**20, 2**20 * 5_000_000, 0, False],
                    [-1, -1, -1, False],
                    [8, 40_000_000, 0, True],
                    [9, 45_000_000, 0, False, [], [b"m" * 10], {"clock": {b"m" * 16: FAR}}, {}, b"t" * 8, b"n" * 8],
                    [0, 0, 0, False, [node, "/nobody"], [], {}, {}, b"t" * 8],
                    [0, 0, 0, False, ["\x1b]0;"], [], {}, {}, b"t" * 8],
                ):
                    self.session.put(grant_key(member), msgpack.packb([simulation, *rest]))
            mine = publisher_id(node, member, "r/cmd_vel")
            for marks in ({}, {"r/cmd_vel": {mine: 7}}, {"r/cmd_vel": {mine: FAR}}, {"r/odom": {b"x" * 16: FAR}}):
                for tick in (-1, 0, 8, FAR):
                    for leaving, answers_join in ((False, False), (True, False), (False, True)):
                        done = [member, tick, marks, marks, leaving, answers_join, 0, b"t" * 8, b"n" * 8, 7]
                        self.session.put(report_key(sim), msgpack.packb(done))
                        self.session.put(report_key(sim), msgpack.packb([self.own, *done[1:]]))
            claims = (
                Entity(self.own, "node", node, "waypoint"),
                Entity(self.own, "sub", node, "/r/odom", "-", "SENSOR"),
                Entity(self.own, "step", node, detail="5000000"),
                # The same in the victim's name, appearing and disappearing beside its own.
                Entity(member, "step", node, detail="7"),
                Entity(member, "node", node, "nothing"),
                Entity(member, "sub", node, "/r/odom", "-", "-"),
            )
            self.show(*claims)
            attached = member_id(node, member) + b"forged"
            for number in (1, 2, 10**6):
                put: Callable[..., None] = self.session.put
                put(
                    "r/cmd_vel",
                    msgpack.packb({}),
                    attachment=pack_attachment(number, attached),
                    encoding=encoding(Twist.ROS_TYPE),
                )
        self.show(Entity(self.own, "node", SIM, "sim"), Entity(sim, "node", SIM, "nothing"))
        self.hide()


def run(
    folder: Path, name: str, disturb: Callable[[Forger, Callable[[], bool]], None], laps: int = 1
) -> tuple[int, Any, str]:
    """Run a fleet with an intruder; return exit status, report, and all logs."""
    terminal, gate = CommandLine(folder), folder / f"{name}.begin"
    (folder / f"{name}.py").write_text(GATE.format(file=str(gate)))
    fleet = FLEET.replace("goals = [[", f"laps = {laps}, goals = [[")
    (folder / f"{name}.toml").write_text(f'{fleet}[[service]]\nkind = "{name}.py"\n')
    results = folder / name
    arguments = [
        "up",
        f"{name}.toml",
        "--port",
        str(terminal.port),
        "--report",
        str(results),
        "--no-view",
        "--no-picture",
        "--no-saved",
    ]
    up = terminal.start(*arguments, "--json")
    try:
        wait_until(lambda: up.poll() is not None or _listens(terminal.port), START_S, "the router")
        with external_client(router_endpoint(terminal.port)) as session:
            disturb(Forger(session, gate), lambda: up.poll() is None)
        out, err = up.communicate(timeout=RUN_S)
    finally:
        up.kill()
    assert out, err
    logs = "".join(each.read_text() for each in sorted((results / "logs").iterdir()))
    return up.returncode, json.loads(out), logs


def _listens(port: int) -> bool:
    try:
        check_reachable(router_endpoint(port))
    except OSError:
        return False
    return True


def _nothing(forger: Forger, runs: Callable[[], bool]) -> None:
    forger.gate.touch()


def test_what_strangers_say_changes_nothing_and_is_counted(tmp_path: Path) -> None:
    rounds = 0

    def disturb(forger: Forger, runs: Callable[[], bool]) -> None:
        nonlocal rounds
        # Until the health reports the rejections, time advances only on request.
        forger.begin_paused()
        sim = forger.sessions("node")[SIM]
        members = {node: session for node, session in forger.sessions("step").items() if node != "/gate"}
        while not all(forger.refused(node, name) for node, name in REFUSED):
            forger.attack(sim, members)
            rounds += 1
            forger.ask("sim/step", {"count": EVERY})
            forger.await_health({WAYPOINT, SIM})
        forger.ask("sim/resume", {})
        while runs():
            forger.attack(sim, members)
            heard = forger.clocks
            wait_until(lambda h=heard: forger.clocks > h + EVERY or not runs(), RUN_S, "time to go on")  # type: ignore[misc]

    with ThreadPoolExecutor(1) as pool:
        alone = pool.submit(run, tmp_path, "alone", _nothing)
        status, disturbed, logs = run(tmp_path, "forged", disturb)
        alone_status, undisturbed, _ = alone.result()
    assert (alone_status, undisturbed["ok"]) == (0, True)
    assert "Traceback" not in logs
    assert disturbed["run"]["trajectory_hash"] == undisturbed["run"]["trajectory_hash"], logs
    assert (disturbed["run"]["members_lost"], disturbed["run"]["members_left"]) == (0, 0), logs
    assert disturbed["run"]["restarts"] == disturbed["run"]["messages_lost"] == 0, logs
    assert (status, disturbed["ok"]) == (0, True), logs
    assert rounds
    assert "a Go is refused" in logs
    assert "a Done is refused" in logs


def test_a_member_that_dies_makes_the_report_say_so(tmp_path: Path) -> None:
    def disturb(forger: Forger, runs: Callable[[], bool]) -> None:
        forger.begin_paused()
        forger.ask("sim/step", {"count": 4 * EVERY})
        state = json.loads((tmp_path / "killed" / "processes.json").read_text())
        (pid,) = (each["pid"] for each in state["processes"] if each["name"] == WAYPOINT.strip("/"))
        psutil.Process(pid).send_signal(signal.SIGKILL)
        forger.ask("sim/resume", {})

    status, report, logs = run(tmp_path, "killed", disturb, laps=2)
    assert (status, report["ok"]) == (1, False)
    assert report["run"]["members_lost"] == 1
    assert [each["name"] for each in report["checks"] if each["value"] == 1 and not each["ok"]] == ["members_lost"]
    assert f"lockstep went on without {WAYPOINT}: the run does not repeat" in report["notes"]
    assert f"{WAYPOINT} is lost, the others go on without it" in logs
