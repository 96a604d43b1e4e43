"""A node on the network: name, subscribers, publishers, requests, liveliness tokens and heartbeat."""

from __future__ import annotations

from collections.abc import Callable
from itertools import islice
from typing import Any, Protocol, Self, TypeVar

from messages.base import Message
from messages.elea import Health
from messages.names import Identity
from messages.requests import Request
from messages.rosgraph import Log as LogLine
from messages.topics import HEALTH, ROSOUT, Topic
from services.runtime.discovery import ReachabilityCheck
from services.runtime.errors import Stopped, TryAgain
from services.runtime.graph import ASKS_HEALTH, REPLACED, Entity, Kind, ping_key, shutdown_key, token_pattern
from services.runtime.heartbeat import Heartbeat
from services.runtime.lockstep.watermarks import Watermarks
from services.runtime.log import Log
from services.runtime.name_claim import claim_names
from services.runtime.publisher import Publisher, SendBuffer
from services.runtime.requests import DEADLINE_S, DeferredReply, RequestServer, call
from services.runtime.subscriber import WAIT_BUDGET_S, Subscriber, WaitBudget
from services.runtime.transport.api import QueryServer, RawSubscriber, Token, Transport
from services.runtime.transport.request_queue import Refusals
from services.runtime.transport.sequences import RefusalCounter
from services.runtime.transport.wire import member_id

M = TypeVar("M", bound=Message)
Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)

MAX_KEPT_NUMBERS = 4096
"""Maximum closed publications whose sequence numbers are kept in case they restart; the oldest are dropped."""
CLOCK_PATIENCE_S = 2.0
"""Wall time [s] without a first clock after which a node logs a warning."""

_PINGS = 16
"""Maximum pings answered in one turn of the loop."""
_LONGEST_REASON = 400
"""Maximum bytes of the reason in a shutdown request; the rest is cut off."""


class Extension(Protocol):
    """An addition to a node that its loop serves along with the node's own work."""

    def spin_once(self) -> None:
        """Do the work that is due, without blocking."""
        ...


class Node:
    """A node without its pacing. Used by the loop's thread only."""

    def __init__(self, transport: Transport, identity: Identity, kind: str, log: Log, sole: bool = True) -> None:
        """Create a node of a service's ``kind``.

        If it is not the ``sole`` node of its process, its container does what is needed once for all nodes: claiming
        their names, and checking that they are reachable.
        """
        self.transport, self.identity, self.kind, self.log = transport, identity, kind, log
        self.heartbeat = Heartbeat(identity.node, log)
        self.send_buffer = SendBuffer()
        self.command_buffer: SendBuffer | None = None
        """Collects commands to send them together with those of other nodes; None to send each at once."""
        self.subscribers: list[Subscriber[Any]] = []
        self.publishers: list[Publisher[Any]] = []
        self.version = 0
        """Incremented by each subscription and publication that begins or ends."""
        self.refusal_counters: list[RefusalCounter] = []
        """Counters of keys that no subscriber reads; the health lists those that refused something."""
        self.request_server = RequestServer(transport, log)
        self.request_handlers = self.request_server.served
        self.extensions: list[Extension] = []
        """Served by the loop along with the node's own work, such as the client of the parameter service."""
        self.clock_patience_s = CLOCK_PATIENCE_S
        self.on_asked_to_end: Callable[[str], None] | None = None
        """Called with the reason when another process asks this node to end; None if none may."""
        self.replaceable = False
        """Whether a later node of the same name ends this one; it also takes over the name from such a node itself."""
        self.stopping = self.calling = False
        self._tokens: dict[tuple[Kind, str, str], Token] = {}
        self._numbers: dict[str, int] = {}
        self._sole = sole
        self._shutdowns: QueryServer | None = None
        self._reachability = ReachabilityCheck(transport, log) if sole else None

    @property
    def names(self) -> tuple[str, ...]:
        """The node's name, as the only one of a lockstep member."""
        return (self.identity.node,)

    def __enter__(self) -> Self:
        if self._sole:
            mine = Entity(self.transport.session, "node", self.identity.node, self.kind)
            [self._tokens["node", self.identity.node, ""]] = claim_names(
                self.transport, [mine], replaces=self.replaceable
            )
            if self.on_asked_to_end is not None:
                self._shutdowns = self.transport.serve(shutdown_key(self.transport.session, self.identity.node))
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
        self,
        topic: Topic[M],
        name: str | None = None,
        decode: Callable[[bytes], Any] | None = None,
        rare: bool = False,
        capacity: int | None = None,
    ) -> Subscriber[M]:
        """Subscribe to a topic, under another name if one is given; its readers in this node share one subscription.

        ``decode`` decodes the payloads of a type that this project does not know; ``rare`` is for topics that rarely
        carry anything and that no loop waits on; ``capacity`` is the number of samples kept between two updates.
        """
        absolute = self.identity.resolve(name or topic.name)
        for known in self.subscribers:
            if known.name == absolute and known.topic.record is topic.record:
                return known
        key = self.identity.key(name or topic.name)
        made = Subscriber(topic, absolute, key, self.transport, decode, capacity, rare=rare)
        self.attach(made)
        return made

    def attach(self, subscriber: Subscriber[Any]) -> None:
        """Add a subscription to this node: it is shown in the graph and counted in the health."""
        self.subscribers.append(subscriber)
        self.version += 1
        topic = subscriber.topic
        self._declare("sub", subscriber.name, topic.record.ROS_TYPE, topic.quality.name)

    def advertise(self, topic: Topic[M], name: str | None = None) -> Publisher[M]:
        """Declare a publication of a topic, under another name if one is given.

        If it was closed before, its sequence numbers continue: subscribers would drop repeated ones.
        """
        absolute = self.identity.resolve(name or topic.name)
        for known in self.publishers:
            if known.name == absolute:
                return known
        key, own = self.identity.key(name or topic.name), self.identity.node
        made = Publisher(topic, absolute, key, own, self.transport, self.send_buffer, self.command_buffer)
        made.sent = made.reported = self._numbers.pop(absolute, 0)
        self.publishers.append(made)
        self.version += 1
        self._declare("pub", absolute, topic.record.ROS_TYPE, topic.quality.name)
        return made

    def unregister(self, *ends: Subscriber[Any] | Publisher[Any]) -> None:
        """End subscriptions and publications, for example when a robot is deleted."""
        self.send_buffer.flush()
        self.version += 1
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
        """Serve a request in this node's loop.

        The handler raises BadInput to refuse with a reason; it returns a ``DeferredReply`` to answer later.
        """
        absolute = self.identity.resolve(name or request.name)
        self.request_server.add(request, self.identity.key(name or request.name), handler)
        self.declare_server(absolute, request.request_type.ROS_TYPE)

    def declare_server(self, name: str, ros_type: str) -> None:
        """Declare to the graph that this node serves ``name``."""
        self._declare("srv", name, ros_type, "-")

    def withdraw_server(self, name: str, ros_type: str) -> None:
        """Declare to the graph that this node no longer serves ``name``."""
        self._tokens.pop(("srv", name, ros_type)).close()

    def call(self, request: Request[Q, R], message: Q, timeout: float = DEADLINE_S, name: str | None = None) -> R:
        """Call another node's request; raises CallFailed. The caller's loop blocks until the reply or the deadline, or
        until the process is asked to end (Stopped).
        """
        self.send_buffer.flush()
        self.calling = True
        try:
            return call(self.transport, request, self.identity.key(name or request.name), message, timeout)
        finally:
            self.calling = False

    def declare_stepping(self, period_ns: int) -> None:
        """Declare that the node's inputs are declared and its ticks may begin."""
        entity = Entity(self.transport.session, "step", self.identity.node, detail=str(period_ns))
        self._tokens["step", self.identity.node, ""] = self.transport.declare_token(entity.key)

    def declare_ready(self) -> None:
        """Declare once that the node is running, for a node without ticks."""
        if not any((kind, self.identity.node, "") in self._tokens for kind in ("ready", "step")):
            entity = Entity(self.transport.session, "ready", self.identity.node)
            self._tokens["ready", self.identity.node, ""] = self.transport.declare_token(entity.key)

    def leave(self) -> None:
        """Remove the node from the network while its process continues with others; sends a last heartbeat."""
        self.heartbeat.state = "stopping"
        self.heartbeat.request_now()
        self.publish_heartbeat()
        self.send_buffer.flush()
        for subscriber in self.subscribers:
            subscriber.close()
        for publisher in (*self.publishers, self._health):
            publisher.close()
        self._pings.close()
        for handler in self.request_handlers:
            handler.end()
        for token in self._tokens.values():
            token.close()

    def spin_once(self) -> None:
        """Do the work of every loop: stop when asked (Stopped), answer requests, send the heartbeat."""
        if self.stopping:
            raise Stopped("the process was asked to end")
        self.request_server.spin_once()
        for query in islice(iter(self._pings.recv, None), _PINGS):
            query.reply(self.heartbeat.payload(*self._ends()) if query.payload == ASKS_HEALTH else b"")
        if self._shutdowns is not None:
            self._answer_shutdowns(self._shutdowns)
        for each in self.extensions:
            each.spin_once()
        if self._reachability is not None:
            self._reachability.update()
        self.publish_heartbeat()

    def _answer_shutdowns(self, asked: QueryServer) -> None:
        for query in islice(iter(asked.recv, None), 1):
            reason = query.payload[:_LONGEST_REASON].decode(errors="replace")
            if self.on_asked_to_end is None or (reason == REPLACED and not self.replaceable):
                query.refuse(b"")
                continue
            query.reply(b"")
            self.on_asked_to_end(reason if reason.isprintable() else repr(reason))

    def wait(self, subscriber: RawSubscriber) -> None:
        """Spin once, send held samples, then block until a sample or a wake-up arrives, or for 0.1 s."""
        self.spin_once()
        self.send_buffer.flush()
        self.transport.wait(subscriber)

    def update_subscribers(self, watermarks: Watermarks | None = None) -> None:
        """Take the snapshot of all inputs; with ``watermarks``, wait up to WAIT_BUDGET_S for those they require."""
        if watermarks is None:
            for each in self.subscribers:
                if each.pending:
                    each.update()
            return
        budget = WaitBudget(self._publish_heartbeat_in_burst, self._present_members)
        for each in self.subscribers:
            if each.pending or each.key in watermarks.required:
                each.update(watermarks, budget)
        watermarks.clear_required()
        if budget.missed:
            missed = ", ".join(budget.missed)
            self.log.warn(
                f"samples did not arrive within {WAIT_BUDGET_S:g} s, or before their publisher ended; counted as "
                f"lost: {missed}",
                every=5.0,
            )

    def _present_members(self) -> set[bytes] | None:
        """Return the ids of all nodes that have a token; None if the network does not answer in time."""
        try:
            nodes = [Entity.parse(each) for each in self.transport.all_tokens(token_pattern("node"))]
        except TryAgain:
            return None
        return {member_id(each.node, each.session) for each in nodes if each is not None}

    def publish_heartbeat(self) -> None:
        """Send the heartbeat if it is due; part of ``spin_once``."""
        if not self.heartbeat.is_due(self._health):
            return
        self.heartbeat.publish(self._health, *self._ends())

    def _ends(self) -> tuple[list[Subscriber[Any] | RefusalCounter], list[Publisher[Any]], Refusals]:
        """Return the subscribers, publishers and refused requests for the node's health."""
        refusing = [each for each in self.refusal_counters if each.refused]
        return [*self.subscribers, *refusing], self.publishers, self.request_server.refusals

    def _publish_heartbeat_in_burst(self) -> None:
        """Send the heartbeat at once while a tick waits for samples: the tick's burst may be sent too late."""
        held = self.send_buffer.held is not None
        self.send_buffer.flush()
        self.publish_heartbeat()
        if held:
            self.send_buffer.begin()

    def _declare(self, kind: Kind, name: str, record: str, detail: str) -> None:
        entity = Entity(self.transport.session, kind, self.identity.node, name, record, detail)
        self._tokens[kind, name, record] = self.transport.declare_token(entity.key)
