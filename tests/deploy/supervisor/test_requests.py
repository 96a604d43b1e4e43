"""Concurrent requests: a name never has two processes, and all processes end with the fleet."""

from __future__ import annotations

import asyncio
from itertools import product
from pathlib import Path

import psutil

from deploy.supervisor.node import SupervisorNode
from deploy.supervisor.supervisor import ActionHandler, ProcessAction, Supervisor
from messages.base import encode
from messages.elea import FleetState, Health
from messages.names import Identity, key
from messages.requests import SUPERVISOR_START, Done, Name
from services.runtime.errors import CallFailed
from services.runtime.graph import token_pattern
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.requests import read_replies
from services.runtime.transport.api import PendingReplies, QueryServer, Transport
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import configuration
from tests.deploy.supervisor.supervisor_harness import (
    SupervisorHarness,
    faulty_process,
    play_side_by_side,
    wait_all_ready,
    wait_until,
)
from tests.harness.processes import Network


def processes(node: str) -> list[psutil.Process]:
    """Return this test's child processes for the node."""
    alive = []
    for each in psutil.Process().children():
        try:
            if node in each.cmdline():
                alive.append(each)
        except psutil.NoSuchProcess:
            continue
    return alive


VERBS: tuple[ProcessAction, ...] = ("start", "stop", "restart")


def test_two_orders_of_one_turn_leave_one_process_at_most(tmp_path: Path) -> None:
    play_side_by_side(tmp_path, (start_and_another, stop_and_another, restart_and_another))


async def start_and_another(harness: SupervisorHarness) -> None:
    await _two_orders(harness, "start", "a")


async def stop_and_another(harness: SupervisorHarness) -> None:
    await _two_orders(harness, "stop", "b")


async def restart_and_another(harness: SupervisorHarness) -> None:
    await _two_orders(harness, "restart", "c")


async def _two_orders(harness: SupervisorHarness, first: ProcessAction, name: str) -> None:
    answers = harness.bus.answers

    async def order(supervisor: Supervisor) -> None:
        await wait_all_ready(supervisor)
        life = supervisor.processes[name]

        def settled() -> bool:
            return life.state == ("ready" if life.is_running else "stopped")

        for runs, second in product((True, False), VERBS):
            if life.is_running != runs:
                answers.clear()
                harness.bus.requests.append(("start" if runs else "stop", name))
                await wait_until(lambda: answers and not supervisor.is_busy(name) and settled())
            answers.clear()
            harness.bus.requests += [(first, name), (second, name)]
            await wait_until(lambda: len(answers) == 2 and not supervisor.is_busy(name) and settled())
            assert len(processes(f"/{name}")) == life.is_running, (runs, first, second, answers)
            if (first, second) == ("start", "start"):
                assert [each.startswith(f"refused: {name} is already running") for each in answers] == [runs, True]
            if "stop" in (first, second) and (first, second) != ("stop", "start"):
                assert not runs or not life.is_running, "a process that was to be stopped runs"

    outcome = await harness.play(order, faulty_process("good", f"/{name}"))
    assert outcome.ended == "interrupted"
    assert processes(f"/{name}") == []


class TransportGate:
    """A bus that holds requests back while ``shut``, so that they are then answered in one turn."""

    def __init__(self, bus: SupervisorNode, behind: QueryServer, harness: SupervisorHarness) -> None:
        self.shut, self.behind = False, behind
        self._bus, self._stage = bus, harness

    def heartbeats(self) -> list[Health]:
        return [*self._stage.bus.heartbeats()]

    @property
    def flooded(self) -> bool:
        return self._bus.flooded

    @property
    def delay_s(self) -> float:
        return self._bus.delay_s

    def router_answers(self) -> bool:
        return self._bus.router_answers()

    def publish(self, state: FleetState) -> None:
        self._bus.publish(state)

    def answer_requests(self, handle_action: ActionHandler) -> bool:
        return not self.shut and self._bus.answer_requests(handle_action)


def test_two_starts_over_the_network_answered_in_one_turn(tmp_path: Path) -> None:
    harness = SupervisorHarness(tmp_path)
    told: list[Done | CallFailed] = []

    async def start_twice(supervisor: Supervisor, gate: TransportGate, network: Network) -> None:
        await wait_all_ready(supervisor)
        supervisor.handle_action("stop", "a")
        await wait_until(lambda: supervisor.processes["a"].state == "stopped" and not supervisor.is_busy("a"))
        with network.node() as node:
            seen = node.transport.tokens
            await wait_until(lambda: seen(token_pattern("srv", "/supervisor", SUPERVISOR_START.name)))
            gate.shut = True
            payload, asked = encode(Name(name="a")), key(SUPERVISOR_START.name)
            pending = [node.transport.query_async(asked, payload, 20.0) for _ in range(2)]
            node.transport.query_async("behind", b"", 20.0)  # its arrival shows that both earlier requests have arrived
            await wait_until(gate.behind.recv)
            gate.shut = False
            for each in pending:
                told.append(await answer(each, node.transport))
        await wait_all_ready(supervisor)
        assert len(processes("/a")) == 1

    async def run(gate: TransportGate, network: Network) -> str:
        supervisor = Supervisor("test", "real", [faulty_process("good", "/a")], gate, harness.spawner, harness)
        running = asyncio.create_task(supervisor.run())
        try:
            await asyncio.wait_for(start_twice(supervisor, gate, network), 60)
        finally:
            supervisor.interrupt()
            outcome = await asyncio.wait_for(running, 30)
        return outcome.ended

    identity = Identity.of("supervisor")
    try:
        with (
            Network(tmp_path) as network,
            ZenohTransport(configuration("direct", (network.endpoint,))) as transport,
            Node(transport, identity, "supervisor", Log(identity.node)) as node,
        ):
            ended = asyncio.run(run(TransportGate(SupervisorNode(node), transport.serve("behind"), harness), network))
    finally:
        harness.reaper.close()
    assert ended == "interrupted"
    assert processes("/a") == []
    assert sorted(type(each).__name__ for each in told) == ["CallFailed", "Done"]
    assert any("a is already running (" in str(each) for each in told)


async def answer(pending: PendingReplies, transport: Transport) -> Done | CallFailed:
    """Wait for the reply to a request; return it, or the error if it was rejected."""
    replies = None
    while replies is None:
        await asyncio.sleep(0.02)
        replies = pending.poll()
    try:
        return read_replies(SUPERVISOR_START, key(SUPERVISOR_START.name), replies, 20.0, transport)
    except CallFailed as error:
        return error
