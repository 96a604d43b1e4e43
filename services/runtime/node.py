"""A node on the network: name, subscribers, publishers, requests, liveliness tokens and heartbeat."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import islice
from typing import Any, Protocol, Self, TypeVar

from messages.base import Message
from messages.elea import Health
from messages.names import Identity
from messages.requests import Request
from messages.rosgraph import Log as LogLine
from messages.topics import HEALTH, ROSOUT, Topic
from services.runtime.discovery import ReachabilityCheck, known_nodes
from services.runtime.errors import Stopped, TryAgain
from services.runtime.graph import Entity, Kind, ping_key, token_pattern
from services.runtime.heartbeat import Heartbeat
from services.runtime.lockstep.watermarks import Watermarks
from services.runtime.log import Log
from services.runtime.publisher import Publisher, SendBuffer
from services.runtime.requests import DEADLINE_S, DeferredReply, RequestServer, call
from services.runtime.subscriber import WAIT_BUDGET_S, Subscriber, WaitBudget
from services.runtime.transport.api import RawSubscriber, Token, Transport
from services.runtime.transport.sequences import RefusalCounter

M = TypeVar("M", bound=Message)
Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)

TAKEOVER_S = 1.5
"""Wall time in which the token of a predecessor that was killed must have gone."""
MAX_KEPT_NUMBERS = 4096
"""Maximum closed publications whose sequence numbers are kept for a restart; the oldest are forgotten."""
CLOCK_PATIENCE_S = 2.0
"""Wall time without a first clock after which a node says so."""

_PINGS = 16
"""Pings answered in one turn."""


class Extension(Protocol):
    """Something that a node's loop serves along with the node's own work."""

    def spin_once(self) -> None:
        """Do the work that is due, without blocking."""
        ...


class Node:
    """Everything of a node but its time. Used by one thread, the loop's."""

    def __init__(self, transport: Transport, identity: Identity, kind: str, log: Log) -> None:
        self.transport, self.identity, self.kind, self.log = transport, identity, kind, log
        self.heartbeat = Heartbeat(identity.node, log)
        self.send_buffer = SendBuffer()
        self.subscribers: list[Subscriber[Any]] = []
        self.publishers: list[Publisher[Any]] = []
        self.refusal_counters: list[RefusalCounter] = []
        """Of keys that no input reads; the health lists those that refused something."""
        self.request_server = RequestServer(transport, log)
        self.request_handlers = self.request_server.served
        self.extensions: list[Extension] = []
        """Served by the loop along with the node's own work, as the client of the parameter service."""
        self.clock_patience_s = CLOCK_PATIENCE_S
        self.stopping = self.calling = False
        self._tokens: dict[tuple[Kind, str, str], Token] = {}
        self._numbers: dict[str, int] = {}
        self._reachability = ReachabilityCheck(transport, log)

    def __enter__(self) -> Self:
        self._claim_name()
        self._health: Publisher[Health] = Publisher(
            HEALTH, HEALTH.name, self.identity.key(HEALTH.name), self.identity.node, self.transport, self.send_buffer
        )
        self._declare("pub", HEALTH.name, Health.ROS_TYPE, HEALTH.quality.name)
        self._rosout: Publisher[LogLine] = self.advertise(ROSOUT)
        self.log.publish = self._rosout.publish
        self._pings = self.transport.serve(ping_key(self.transport.session, self.identity.node))
        return self

    def __exit__(self, *exception: object) -> None:
        self.request_server.close()
        self.log.publish = None

    def subscribe(
        self, topic: Topic[M], name: str | None = None, decode: Callable[[bytes], Any] | None = None
    ) -> Subscriber[M]:
        """Subscribe to a topic, under another name if one is given; one subscription serves all its readers.

        ``decode`` reads the payloads of a type that this project does not know.
        """
        absolute = self.identity.resolve(name or topic.name)
        for known in self.subscribers:
            if known.name == absolute and known.topic.record is topic.record:
                return known
        made = Subscriber(topic, absolute, self.identity.key(name or topic.name), self.transport, decode)
        self.subscribers.append(made)
        self._declare("sub", absolute, topic.record.ROS_TYPE, topic.quality.name)
        return made

    def advertise(self, topic: Topic[M], name: str | None = None) -> Publisher[M]:
        """Publish on a topic, under another name if one is given.

        One that was forgotten and begins again goes on with its numbers: its readers would drop the old ones.
        """
        absolute = self.identity.resolve(name or topic.name)
        for known in self.publishers:
            if known.name == absolute:
                return known
        made = Publisher(
            topic, absolute, self.identity.key(name or topic.name), self.identity.node, self.transport, self.send_buffer
        )
        made.sent = made.reported = self._numbers.pop(absolute, 0)
        self.publishers.append(made)
        self._declare("pub", absolute, topic.record.ROS_TYPE, topic.quality.name)
        return made

    def unregister(self, *ends: Subscriber[Any] | Publisher[Any]) -> None:
        """End subscriptions and publications, as when a robot leaves the world."""
        self.send_buffer.flush()
        for end in ends:
            if isinstance(end, Subscriber):
                self.subscribers.remove(end)
                self._tokens.pop(("sub", end.name, end.topic.record.ROS_TYPE)).close()
            else:
                self.publishers.remove(end)
                self._tokens.pop(("pub", end.name, end.topic.record.ROS_TYPE)).close()
                self._numbers[end.name] = end.sent
                if len(self._numbers) > MAX_KEPT_NUMBERS:
                    del self._numbers[next(iter(self._numbers))]
            end.close()

    def serve(
        self, request: Request[Q, R], handler: Callable[[Q], R | DeferredReply[R]], name: str | None = None
    ) -> None:
        """Answer a request in this node's loop.

        The handler raises BadInput to refuse with a reason; it returns a ``DeferredReply`` to answer later.
        """
        absolute = self.identity.resolve(name or request.name)
        self.request_server.add(request, self.identity.key(name or request.name), handler)
        self._declare("srv", absolute, request.request_type.ROS_TYPE, "-")

    def call(self, request: Request[Q, R], message: Q, timeout: float = DEADLINE_S, name: str | None = None) -> R:
        """Call another node's request; raises CallFailed. The caller's loop blocks until the reply, the deadline, or
        until the process is asked to end (Stopped).
        """
        self.send_buffer.flush()
        self.calling = True
        try:
            return call(self.transport, request, self.identity.key(name or request.name), message, timeout)
        finally:
            self.calling = False

    def declare_stepping(self, period_ns: int) -> None:
        """Show that the node's ticks may begin: its inputs are declared."""
        entity = Entity(self.transport.session, "step", self.identity.node, detail=str(period_ns))
        self._tokens["step", self.identity.node, ""] = self.transport.declare_token(entity.key)

    def declare_ready(self) -> None:
        """Show, once, that the node is at work, for a node without ticks."""
        if not any((kind, self.identity.node, "") in self._tokens for kind in ("ready", "step")):
            entity = Entity(self.transport.session, "ready", self.identity.node)
            self._tokens["ready", self.identity.node, ""] = self.transport.declare_token(entity.key)

    def spin_once(self) -> None:
        """The work of every loop: end when asked (Stopped), answer requests, send the heartbeat."""
        if self.stopping:
            raise Stopped("the process was asked to end")
        self.request_server.spin_once()
        for query in islice(iter(self._pings.recv, None), _PINGS):
            query.reply(b"")
        for each in self.extensions:
            each.spin_once()
        self._reachability.update()
        self._publish_heartbeat()

    def wait(self, inlet: RawSubscriber) -> None:
        """Spin once, then block until a sample, a wake-up or a tenth of a second; held samples are sent first."""
        self.spin_once()
        self.send_buffer.flush()
        self.transport.wait(inlet)

    def update_subscribers(self, marks: Watermarks | None = None) -> None:
        """Take the snapshot of all inputs; with ``marks``, wait up to WAIT_BUDGET_S for the samples that they name."""
        if marks is None:
            for each in self.subscribers:
                each.update()
            return
        patience = WaitBudget(self._publish_heartbeat_in_burst)
        for each in self.subscribers:
            each.update(marks, patience)
        marks.clear_required()
        if patience.missed:
            missed = ", ".join(patience.missed)
            self.log.warn(
                f"announced, and not here within {WAIT_BUDGET_S:g} s, so it counts as lost: {missed}", every=5.0
            )

    def _publish_heartbeat(self) -> None:
        refusing = [each for each in self.refusal_counters if each.refused]
        inputs: list[Subscriber[Any] | RefusalCounter] = [*self.subscribers, *refusing]
        self.heartbeat.publish_if_due(self._health, inputs, self.publishers, self.request_server.refusals)

    def _publish_heartbeat_in_burst(self) -> None:
        """Send the heartbeat at once while a tick waits for samples: the burst of the tick may leave too late."""
        held = self.send_buffer.held is not None
        self.send_buffer.flush()
        self._publish_heartbeat()
        if held:
            self.send_buffer.begin()

    def _claim_name(self) -> None:
        """Take the node's name; raises TryAgain when another process holds it and does not go."""
        mine = Entity(self.transport.session, "node", self.identity.node, self.kind)
        self._tokens["node", self.identity.node, ""] = self.transport.declare_token(mine.key)
        settle = self.transport.settle_s
        if self._sees_everybody():
            if not self._sessions("node") - {mine.session}:
                return
            settle *= 2  # another node may start at the same moment, and need as long to see all others
        started = seen = time.monotonic()
        while True:
            rivals = self._rivals(mine.session)
            now = time.monotonic()
            # While links come up, an existing token may be invisible for a moment.
            seen = now if rivals else seen
            if not rivals and now - seen >= settle:
                return
            if rivals and now - started > TAKEOVER_S:
                raise TryAgain(
                    f"a node {self.identity.node} is already there (session {rivals[0]}): "
                    "give this one another --name or --namespace, or stop the other"
                )
            time.sleep(0.02)

    def _sees_everybody(self) -> bool:
        """Wait until all nodes that the router knows are visible; False if that is unknown or takes too long."""
        deadline = time.monotonic() + self.transport.settle_s
        while (expected := known_nodes(self.transport)) is not None and time.monotonic() < deadline:
            if expected <= set(self.transport.tokens(token_pattern("node"))):
                return True
            time.sleep(0.01)
        return False

    def _rivals(self, mine: str) -> list[str]:
        """Sessions with a better claim to the name: those at work under it, else those that ask at the same moment."""
        at_work = self._sessions("pub") - {mine}
        return sorted(at_work) or sorted(each for each in self._sessions("node") if each < mine)

    def _sessions(self, kind: Kind) -> set[str]:
        found = (Entity.parse(key) for key in self.transport.tokens(token_pattern(kind, self.identity.node)))
        return {each.session for each in found if each}

    def _declare(self, kind: Kind, name: str, record: str, detail: str) -> None:
        entity = Entity(self.transport.session, kind, self.identity.node, name, record, detail)
        self._tokens[kind, name, record] = self.transport.declare_token(entity.key)
