"""The start of lockstep on a lossy network: greetings and answers are repeated, and count once."""

from __future__ import annotations

import threading
from collections.abc import Callable

import pytest

from services.runtime.errors import Stopped
from services.runtime.lockstep import barrier
from services.runtime.lockstep.barrier import Barrier
from services.runtime.lockstep.member import LockstepMember
from services.runtime.lockstep.protocol import StepGrant
from services.runtime.node import Node
from services.runtime.step import STEP_NS
from services.runtime.transport.api import Transport
from services.runtime.transport.memory import MemoryBus
from services.runtime.transport.wire import publisher_id
from tests.harness.memory_node import memory_node
from tests.harness.waiting import wait_until


@pytest.fixture(autouse=True)
def _soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(barrier, "RETRY_S", 0.05)


def _node(transport: Transport, name: str) -> Node:
    return memory_node(MemoryBus(), name, transport=transport)


class WaitingMember:
    """A simulation, in a thread, that waits for one member to join."""

    def __init__(self, made: Node) -> None:
        self.node = made
        self.barrier = Barrier(made.transport, made.send_buffer, ("/m",), made.log, made.wait, self.go)
        self._thread = threading.Thread(target=self._gather)
        self._thread.start()

    def go(self) -> StepGrant:
        return StepGrant(simulation=self.node.transport.session, tick=0, time=0, epoch=0)

    def _gather(self) -> None:
        try:
            self.barrier.wait_for_members()
        except Stopped:
            return

    @property
    def gathered(self) -> bool:
        return not self._thread.is_alive()

    def end(self) -> None:
        self.node.stopping = not self.gathered
        self._thread.join(60)


def test_a_lost_greeting_goes_again_and_a_lost_answer_is_given_again_the_same(connect: Callable[[], Transport]) -> None:
    with connect() as here, connect() as there, _node(here, "sim") as made, _node(there, "m") as member:
        follower = LockstepMember(member.transport, ["/m"], STEP_NS)
        sim = WaitingMember(made)
        truth, late = (publisher_id("/m", there.session, key) for key in ("truth", "late"))
        try:
            follower.join()
            wait_until(follower.poll, what="a first greeting, which counts as lost")
            greeting = wait_until(follower.poll, what="the second")
            assert greeting is not None
            assert greeting.roster == ("/m",)
            assert not sim.gathered
            follower.send_join(greeting, {"truth": {truth: 7}}, {})
            wait_until(lambda: sim.gathered, what="the answer")
        finally:
            sim.end()
        assert sim.barrier.watermarks.admitted_upto == {"truth": {truth: 7}}
        sim.barrier.grant(sim.go(), [])

        def granted() -> bool:
            go = follower.poll()
            return go is not None and not go.roster  # more greetings may have come before the answer arrived

        wait_until(granted, what="the leave to step")
        follower.send_join(greeting, {"late": {late: 1}}, {})  # a repeated greeting isn't a step
        follower.finish(0, {"truth": {truth: 8}}, {})
        sim.barrier.collect_reports(0)
        assert sim.barrier.watermarks.admitted_upto == {"truth": {truth: 8}}
