"""The order of publishing in a step: commands at once, then the report, then the rest together; nothing is lost."""

from __future__ import annotations

from messages.base import encode
from messages.std import Float64
from messages.topics import Quality, Topic
from services.runtime.graph import Entity
from services.runtime.lockstep.protocol import SIMULATION, StepGrant, StepReport, decode_report, grant_key, report_key
from services.runtime.node import Node
from services.runtime.pacing import LockstepPacer
from services.runtime.transport.api import Transport
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from tests.harness.memory_node import memory_node

TRAIL = Topic("/trail", Float64, 50, Quality.SENSOR, "what nobody waits for")
EFFORT = Topic("/effort", Float64, 50, Quality.COMMAND, "what the simulation waits for")


class Peer:
    """A simulation that grants steps to one member and counts the samples that it receives."""

    def __init__(self, transport: Transport, member: Node) -> None:
        self._go = transport.advertise(grant_key(member.transport.session), "", Quality.EVENT)
        self._session, self._nonce = transport.session, b""
        transport.declare_token(Entity(transport.session, "node", SIMULATION, "sim").key)
        self._inlets = {
            name: transport.subscribe(key, 8)
            for name, key in (("effort", "effort"), ("done", report_key(transport.session)), ("trail", "trail"))
        }
        self.done = StepReport(session="0", tick=0)

    def greet(self, pacer: LockstepPacer) -> None:
        """Greet the member and read its answer."""
        pacer.start()
        self._put(0, ("/member",))
        assert pacer.next() is None
        assert self.heard()["done"] == 1
        self._nonce = self.done.nonce

    def release(self, tick: int) -> None:
        self._put(tick, ())

    def _put(self, tick: int, roster: tuple[str, ...]) -> None:
        go = StepGrant(simulation=self._session, tick=tick, time=tick, epoch=0, roster=roster, nonce=self._nonce)
        self._go.put(encode(go), attachment=b"")

    def heard(self) -> dict[str, int]:
        """Return how many samples of each kind have arrived since the last call."""
        counts = {}
        for name, inlet in self._inlets.items():
            while (sample := inlet.recv()) is not None:
                counts[name] = counts.get(name, 0) + 1
                if name == "done":
                    self.done = decode_report(sample[0])
        return counts


def test_commands_and_done_leave_before_the_rest_of_a_step() -> None:
    bus = MemoryBus()
    with MemoryTransport(bus) as outside, memory_node(bus, "member") as member:
        trail, effort = member.advertise(TRAIL), member.advertise(EFFORT)
        peer, pacer = Peer(outside, member), LockstepPacer(member, 5_000_000)
        peer.greet(pacer)
        peer.release(7)
        assert pacer.next() is not None
        trail.publish(Float64(data=1.0))
        effort.publish(Float64(data=2.0))
        trail.publish(Float64(data=3.0))
        assert peer.heard() == {"effort": 1}, "a command waits for nothing"
        member.send_buffer.held, burst = [], member.send_buffer.held
        pacer.finish()
        assert peer.heard() == {"done": 1}, "Done is in no burst"
        assert (peer.done.tick, sorted(peer.done.sequence_numbers)) == (7, ["effort", "trail"])
        member.send_buffer.held = burst
        member.send_buffer.flush()
        assert peer.heard() == {"trail": 2}
        trail.publish(Float64(data=4.0))
        assert peer.heard() == {"trail": 1}, "between steps everything leaves at once"


def test_a_step_that_breaks_off_loses_nothing() -> None:
    bus = MemoryBus()
    with MemoryTransport(bus) as outside, memory_node(bus, "member") as member:
        trail = member.advertise(TRAIL)
        peer, pacer = Peer(outside, member), LockstepPacer(member, 5_000_000)
        peer.greet(pacer)
        peer.release(1)
        assert pacer.next() is not None
        trail.publish(Float64(data=1.0))
        assert peer.heard() == {}
        pacer.close()
        assert peer.heard() == {"trail": 1, "done": 1}
        assert peer.done.leaving
