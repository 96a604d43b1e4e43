"""The actions of a script's node at the ticks of lockstep."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any, Protocol
from weakref import WeakSet

from messages.topics import Quality
from services.runtime.node import Node
from services.runtime.publisher import Publisher
from services.runtime.transport.api import TIMEOUT, Reply
from services.script.api import Origin, ScriptStopped
from services.script.clock import ScriptClock
from services.script.lockstep_calls import LockstepCalls
from services.script.lockstep_network import ENDPOINTS, SCRIPT, Endpoint, LockstepNetwork, encode_announcement
from services.script.network import Network
from services.script.services import ServiceServer
from services.script.topics import ForeignSubscriber, SubscriberFollower, TopicOutput, TopicReader
from services.script.turns import TurnThreads


class SteppingKernel(Protocol):
    """The steps' interface to the script's kernel: its clock and rate, and the script's declarations."""

    clock: ScriptClock
    lock_node: AbstractContextManager[Any]
    rate: float

    @property
    def network(self) -> Network:
        """The nodes on the network, as last seen."""
        ...

    @property
    def readers(self) -> Mapping[str, TopicReader]:
        """The script's subscriptions, by topic."""
        ...

    @property
    def outputs(self) -> Sequence[TopicOutput]:
        """The script's publications."""
        ...

    @property
    def servers(self) -> Sequence[ServiceServer]:
        """The script's services."""
        ...

    @property
    def followers(self) -> Mapping[str, SubscriberFollower]:
        """The publications that are informed about their subscribers."""
        ...

    def spin(self) -> None:
        """Answer requests and follow the network."""
        ...

    def publish(self, publisher: Publisher[Any], payload: bytes) -> None:
        """Publish a payload on one of the script's publications."""
        ...


class SteppingNode:
    """The actions of a script's node at the ticks of lockstep."""

    def __init__(self, kernel: SteppingKernel, node: Node, turns: TurnThreads) -> None:
        network = kernel.network
        assert isinstance(network, LockstepNetwork)
        self.turns, self.clock, self.lock_node = turns, kernel.clock, kernel.lock_node
        self.simulated, self.rate, self.spin = True, kernel.rate, kernel.spin
        self.calls = LockstepCalls(node, kernel.publish)
        self._kernel, self._node, self._network = kernel, node, network
        self._endpoints = ForeignSubscriber(ENDPOINTS, node.transport)
        node.attach(self._endpoints)
        self._announcements = node.advertise(ENDPOINTS)
        self._last: tuple[Endpoint, ...] | None = None
        self._early: list[tuple[Publisher[Any], bytes]] = []
        self._own: list[tuple[Publisher[Any], bytes]] = []
        self._own_latched: dict[str, tuple[Publisher[Any], bytes]] = {}
        self._readers: WeakSet[TopicReader] = WeakSet()
        """Those that have received what this script had latched before they were created."""

    def roster_seen(self, roster: tuple[str, ...]) -> bool:
        """Return whether everything that these nodes declared before they were ready is known."""
        return set(roster) <= self._network.steppers()

    def publish(self, publisher: Publisher[Any], payload: bytes) -> None:
        """Send a payload; one published before the first tick is held until then.

        Before the first tick, which nodes are already linked differs between runs. A latched payload reaches all of
        them once they are.
        """
        if self._network.begun or publisher.topic.quality is Quality.LATCHED:
            publisher.publish_encoded(payload)
            self.sent(publisher, payload)
        else:
            self._early.append((publisher, payload))

    def send_early(self) -> None:
        """Send the messages published before the first tick."""
        self._network.begun = True
        early, self._early = self._early, []
        for publisher, payload in early:
            self.publish(publisher, payload)

    def sent(self, publisher: Publisher[Any], payload: bytes) -> None:
        """Deliver a published message to the script's own subscriptions at the next tick, like to others."""
        if publisher.name in self._kernel.readers:
            self._own.append((publisher, payload))
        if publisher.topic.quality is Quality.LATCHED:
            self._own_latched[publisher.name] = publisher, payload

    def admit(self, reset: bool) -> None:
        """Pass the messages, calls and changes of this tick to their threads."""
        for payload, _ in self._endpoints.messages:
            self._network.receive(payload)
        self._endpoints.messages = []
        self._network.freeze()
        own, self._own = self._own, []
        for reader in self._kernel.readers.values():
            reader.admit(reset)
            if reader not in self._readers:
                self._readers.add(reader)
                latched = self._own_latched.get(reader.name)
                own += [latched] if latched is not None and latched not in own else []
        for publisher, payload in own if not reset else ():
            if (own_reader := self._kernel.readers.get(publisher.name)) is not None:
                origin = Origin(self._node.identity.node, publisher.topic.quality is Quality.LATCHED)
                own_reader.put(payload, origin, publisher.publisher)
        for reader in self._kernel.readers.values():
            if reader.queue:
                reader.worker.notify()
        self.calls.admit()
        for follower in self._kernel.followers.values():
            follower.worker.notify()
        self.send_early()

    def idle_until(self) -> int:
        """Return the time [ns] before which nothing is due unless a message arrives; 0 if something may be due at any
        tick.
        """
        new = any(each not in self._readers for each in self._kernel.readers.values())
        if new or self._own or self._early or self._kernel.followers:
            return 0
        return self.turns.idle_until()

    def announce(self, final: bool = False) -> None:
        """Announce this script's publications, subscriptions and services to the other scripts, if
        they have changed.
        """
        kernel = self._kernel
        ends = [Endpoint("pub", each.name, each.ros_type, each.latched) for each in kernel.outputs]
        ends += [Endpoint("sub", each.name, each.ros_type or "*") for each in kernel.readers.values()]
        ends += [Endpoint("srv", each.name, each.ros_type) for each in kernel.servers]
        announced = () if final else tuple(dict.fromkeys([*ends, Endpoint("node", self._node.identity.node, SCRIPT)]))
        if announced != self._last:
            self._last = announced
            self._announcements.publish_encoded(
                encode_announcement(self._node.identity.node, self._node.transport.session, announced)
            )

    def call(self, name: str, payload: bytes, timeout: float | None) -> list[Reply] | None:
        """Call a service of this script or another; return None for a node that answers within the tick."""
        own = next((each for each in self._kernel.servers if each.name == name), None)
        if own is not None:
            return self._call_own(own, payload, timeout)
        server = self._network.server(name)
        if server is None or not self._network.has_announced(server.session):
            return None
        with self.lock_node:
            number = self.calls.ask(name, payload)
        try:
            self.turns.wait_until(
                lambda: self.calls.answer(number) is not None or self._network.server(name) is None, timeout
            )
            answer = self.calls.answer(number)
        finally:
            self.calls.forget(number)
        return self._outcome(name, answer)

    def _call_own(self, server: ServiceServer, payload: bytes, timeout: float | None) -> list[Reply]:
        answers: list[Reply] = []
        server.put(
            payload, lambda text: answers.append(Reply(True, text)), lambda text: answers.append(Reply(False, text))
        )
        self.turns.wait_until(lambda: bool(answers), timeout)
        return self._outcome(server.name, answers[0] if answers else None)

    def _outcome(self, name: str, answer: Reply | None) -> list[Reply]:
        if answer is None and self.turns.stopped:
            raise ScriptStopped(f"the process was asked to end while it waited for {name}")
        return [answer if answer is not None else Reply(False, TIMEOUT)]
