"""The context of a service's loop: topics, ticks, requests, transforms, parameters, checks and the log."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from typing import Any, Generic, NamedTuple, TypeVar

import msgspec

from messages.base import Message
from messages.elea import MOST_CHECKS, Check, Checks
from messages.requests import Request
from messages.topics import CHECKS, Topic
from services.runtime.errors import BadInput
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.pacing import ClockPacer, Instant, LockstepPacer, Pacer
from services.runtime.parameters.base import Parameters
from services.runtime.parameters.schema import ALL_LEVELS
from services.runtime.parameters.subscription import ParameterSubscription
from services.runtime.publisher import Publisher
from services.runtime.requests import DEADLINE_S
from services.runtime.step import period_of
from services.runtime.subscriber import Latest, Stream
from services.runtime.tf.buffer import CACHE_S
from services.runtime.tf.listener import TransformListener
from services.runtime.transport.api import RawSubscriber, idle_subscriber


class ServiceChecks:
    """The checks of a node, by name; the last statement of each counts."""

    def __init__(self) -> None:
        self._stated: dict[str, Check] = {}

    def state(
        self, name: str, value: float | bool | None, least: float | None, most: float | None, reason: str
    ) -> tuple[Check, ...] | None:
        """State a check; returns all checks, or None if nothing has changed. Raises BadInput."""
        value, least, most = map(_python_number, (value, least, most))
        if isinstance(value, bool):
            least = 1.0 if least is None and most is None else least
        if least is None and most is None:
            raise BadInput(f"the check {name!r} needs a bound: give min, max or both (a bool needs none)")
        try:
            number = None if value is None or not math.isfinite(value) else float(value)
            made = msgspec.convert(
                {"name": name, "value": number, "min": least, "max": most, "reason": reason}, Check, strict=True
            )
        except (msgspec.ValidationError, TypeError, OverflowError) as error:
            raise BadInput(f"the check {name!r} cannot be stated: {error}") from None
        if self._stated.get(name) == made:
            return None
        if name not in self._stated and len(self._stated) == MOST_CHECKS:
            raise BadInput(f"the check {name!r} is one too many: a node may state {MOST_CHECKS}")
        self._stated[name] = made
        return tuple(self._stated.values())

    def holds(self, name: str) -> bool:
        """Return whether the value of a check is within its bounds; False without a value."""
        known = self._stated[name]
        if known.value is None:
            return False
        return (known.min is None or known.value >= known.min) and (known.max is None or known.value <= known.max)


def _python_number(value: Any) -> Any:
    """Return a scalar of numpy as a number or bool of Python."""
    return value.item() if type(value).__module__ == "numpy" and getattr(value, "ndim", None) == 0 else value


M = TypeVar("M", bound=Message)
Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)
P = TypeVar("P", bound=Parameters)

PARAMETER_ANSWER_S = 30.0
"""Wall time [s] that a starting node waits for the parameter service to answer its announcement."""
PARAMETER_POLL_S = 0.1
"""Wall time [s] between two polls of the parameters in loops without ticks."""


class Tick(NamedTuple):
    """One tick of a loop: simulation time [ns], time since the last tick [s], epoch, and whether time was reset.

    ``dt`` is 0 at the first tick and after a reset.
    """

    time: int
    dt: float
    epoch: int
    reset: bool


MakePacer = Callable[[Node, int, bool], Pacer]
"""Makes the pacer of a node for a period [ns]; the last argument is ``reports_reads`` of ``Context.ticks``."""


def _lockstep_pacer(node: Node, period_ns: int, reports_reads: bool) -> Pacer:
    return LockstepPacer(node, period_ns, reports_reads)


def _clock_pacer(node: Node, period_ns: int, reports_reads: bool) -> Pacer:
    return ClockPacer(node, period_ns)


class Context(Generic[P]):
    """The argument of a service's loop, for use in the loop's own thread only."""

    def __init__(
        self,
        node: Node,
        params: P,
        rate: float | None,
        lockstep: bool = False,
        observer: bool = False,
        subscription: ParameterSubscription[P] | None = None,
        make_pacer: MakePacer | None = None,
    ) -> None:
        self.params_changed = ALL_LEVELS
        self.now = 0
        self._params, self._subscription = params, subscription
        self._polled = 0.0
        self._node = node
        self._rate, self._lockstep, self._observer = rate, lockstep, observer
        self._make_pacer = make_pacer or (_lockstep_pacer if lockstep else _clock_pacer)
        self._views: list[Latest[Any] | Stream[Any] | TransformListener] = []
        self._publishers: dict[str, Publisher[Any]] = {}
        self._idle_subscriber: RawSubscriber | None = None
        self._checks = ServiceChecks()
        node.log.now = lambda: self.now

    @property
    def params(self) -> P:
        """The parameters as of the start of this tick; read them again at each tick.

        ``params_changed`` is the bitwise OR of the levels of the parameters that changed at this tick: 0 if none did,
        all ones at the first tick.
        """
        return self._params

    @property
    def node_name(self) -> str:
        """The node's full name."""
        return self._node.identity.node

    @property
    def namespace(self) -> str:
        """The node's namespace."""
        return self._node.identity.namespace

    @property
    def log(self) -> Log:
        """The node's log."""
        return self._node.log

    @property
    def node(self) -> Node:
        """The underlying node, for the few services that pace themselves."""
        return self._node

    def latest(self, topic: Topic[M]) -> Latest[M]:
        """Subscribe to the newest message of a topic.

        Args:
            topic: The topic in the node's namespace; ``ODOM.of("tb3_0")`` for that of another one.

        Returns:
            A view of the newest message as of the start of each tick: ``value``, ``age``, ``fresh(seconds)``.
        """
        view = Latest(self._node.subscribe(topic), lambda: self.now)
        self._views.append(view)
        return view

    def stream(self, topic: Topic[M]) -> Stream[M]:
        """Subscribe to every message of a topic.

        Args:
            topic: The topic in the node's namespace; ``ODOM.of("tb3_0")`` for that of another one.

        Returns:
            A view of the messages as of the start of each tick, oldest first: ``drain()``.
        """
        view = Stream(self._node.subscribe(topic))
        self._views.append(view)
        return view

    def transforms(self, cache: float = CACHE_S, moving: bool = True) -> TransformListener:
        """Subscribe to the transforms between all frames, like tf2's Buffer and TransformListener.

        Args:
            cache: Length of the history [s of simulation time].
            moving: Whether to read ``/tf`` as well as ``/tf_static``.
        """
        view = TransformListener(self._node, cache, moving)
        self._views.append(view)
        return view

    def advertise(self, topic: Topic[M]) -> Publisher[M]:
        """Declare a publication before its first message, so that the graph shows it."""
        return self._node.advertise(topic)

    def publish(self, topic: Topic[M], message: M) -> None:
        """Publish a message; the first one declares the publication, unless ``advertise`` did.

        Args:
            topic: The topic in the node's namespace; ``CMD_VEL.of("tb3_0")`` for that of another one.
            message: A record of the topic's type.

        Raises:
            TypeError: The message is not of the topic's type.
        """
        output = self._publishers.get(topic.name)
        if output is None:
            output = self._publishers[topic.name] = self._node.advertise(topic)
        output.publish(message)

    def check(
        self,
        name: str,
        value: float | bool | None,
        *,
        min: float | None = None,  # noqa: A002 as in a fleet's bounds
        max: float | None = None,  # noqa: A002
        reason: str = "",
    ) -> bool:
        """State a check, shown as ``NODE.name`` in the report of the run; if one fails, the run's exit status is 1.

        The last statement of a name counts, even after the process was asked to end. A check that stays None fails.

        Args:
            name: letters, digits and underscores, 64 at most; a node has 64 checks at most.
            value: the measured number, or a bool, which needs no bounds; None, inf and NaN mean not measured.
            min: the lowest passing value.
            max: the highest passing value.
            reason: an explanation for the reader of the report, at most 200 characters.

        Returns:
            Whether the check passes.

        Raises:
            BadInput: a bad name, no bound, a bound that is not finite, or too many checks.
        """
        if (stated := self._checks.state(name, value, min, max, reason)) is not None:
            self.publish(CHECKS, Checks(node=self.node_name, checks=stated))
        return self._checks.holds(name)

    def call(self, request: Request[Q, R], message: Q, timeout: float = DEADLINE_S, name: str | None = None) -> R:
        """Call another node's request; the loop blocks until the reply.

        Args:
            request: The request, an entry of ``messages.requests``.
            message: Its request record.
            timeout: Wall time to wait for the reply [s].
            name: The name of the request, if it is not the request's own.

        Returns:
            The response record.

        Raises:
            NoAnswer: The request has no server, or got no reply in time.
            CallFailed: The server refused it; the text has the reason.
        """
        return self._node.call(request, message, timeout, name)

    def serve(self, request: Request[Q, R], handler: Callable[[Q], R], name: str | None = None) -> None:
        """Serve a request in this loop, between ticks.

        Args:
            request: The request, an entry of ``messages.requests``.
            handler: Returns the response; raises BadInput to refuse with a reason.
            name: The name of the request, if it is not the request's own.
        """
        self._node.serve(request, handler, name)

    @property
    def lockstep(self) -> bool:
        """Whether the node runs in lockstep with the simulation."""
        return self._lockstep

    def ticks(
        self,
        rate: float | None = None,
        meanwhile: Callable[[], None] | None = None,
        reports_reads: bool = False,
        before_leaving: Callable[[], None] | None = None,
    ) -> Iterator[Tick]:
        """Yield ticks at the service's rate in simulation time, until the process is asked to end (Stopped).

        Inputs are a snapshot taken at the start of the tick. After a reset they are empty, except for latched topics.

        Args:
            rate: replaces the declared rate [Hz], for services whose rate is a parameter.
            meanwhile: called at least ten times a second while the loop waits for the next tick.
            reports_reads: whether the loop adds subscriptions while it runs, which are then reported to lockstep.
            before_leaving: called when the loop ends, while the simulation still waits for the node. Afterwards the
                others go on, and may send faster than this node reads.
        """
        if (chosen := self._rate if rate is None else rate) is None:
            raise BadInput("a service without a rate has no ticks: declare one, as rate=25 [Hz], or call ctx.ticks(25)")
        period = period_of(chosen, self._lockstep)
        pacer = self._make_pacer(self._node, period, reports_reads)
        if self._subscription is not None:
            self._subscription.client.watermarks = pacer.watermarks
        try:
            self._await_parameters()
            pacer.start()
            yield from self._ticks(pacer, meanwhile)
        finally:
            try:
                if before_leaving is not None:
                    before_leaving()
            finally:
                pacer.close()

    def messages(self, topic: Topic[M]) -> Iterator[M]:
        """Yield every message of a topic as it arrives, for services driven by messages instead of time.

        Parameter changes are applied between messages, ten times a second.
        """
        source = self._node.subscribe(topic)
        self._node.declare_ready()
        self._node.heartbeat.state = "running"
        while True:
            if (message := source.recv()) is not None:
                yield message
            else:
                self._poll_parameters()
                self._node.wait(source.raw)

    def idle(self) -> None:
        """Serve the node for up to 0.1 s of wall time, for services driven by neither time nor messages."""
        if self._rate is None:
            self._node.declare_ready()
        if self._idle_subscriber is None:
            self._idle_subscriber = idle_subscriber(self._node.transport)
        self._poll_parameters()
        self._node.wait(self._idle_subscriber)
        self._idle_subscriber.recv()

    def update_params(self, admitted: bool = False) -> int:
        """Apply parameter changes now, in a loop without ticks.

        Args:
            admitted: Whether the loop has just updated all subscribers.

        Returns:
            The levels of the changed parameters, like ``params_changed``.
        """
        subscription = self._subscription
        if subscription is None:
            return 0
        if not admitted:
            subscription.update()
        self.params_changed = subscription.refresh()
        self._params = subscription.params
        return self.params_changed

    def _await_parameters(self) -> None:
        """Wait up to PARAMETER_ANSWER_S for an expected parameter service: a node is ready once its parameters are
        known."""
        if self._subscription is None or not self._subscription.client.expected:
            return
        client, deadline = self._subscription.client, time.monotonic() + PARAMETER_ANSWER_S
        while client.unanswered and time.monotonic() < deadline:
            self._node.heartbeat.detail = "waiting for the answer of the parameter service"
            self.idle()
        self._node.heartbeat.detail = ""

    def _poll_parameters(self) -> None:
        """Apply parameter changes every PARAMETER_POLL_S; in lockstep only ticks do that."""
        if self._subscription is None or self._lockstep:
            return
        now = time.monotonic()
        if now - self._polled >= PARAMETER_POLL_S:
            self._polled = now
            self.update_params()

    def _ticks(self, pacer: Pacer, meanwhile: Callable[[], None] | None) -> Iterator[Tick]:
        last: Instant | None = None
        while True:
            self._node.spin_once()
            instant = pacer.next()
            while instant is None:
                if meanwhile is not None:
                    meanwhile()
                self._node.transport.wait(pacer.raw)
                if (instant := pacer.next()) is None:
                    self._node.spin_once()
            reset = last is not None and (instant.epoch, instant.simulation) != (last.epoch, last.simulation)
            dt = 0.0 if reset or last is None else (instant.time - last.time) / 1e9
            first = last is None
            self.now, last = instant.time, instant
            self._snapshot(pacer, reset)
            if first:
                self.params_changed = ALL_LEVELS
            self._node.heartbeat.ticks += 1
            if self._observer:
                pacer.finish()
            yield Tick(instant.time, dt, instant.epoch, reset)
            if not self._observer:
                pacer.finish()

    def _snapshot(self, pacer: Pacer, reset: bool) -> None:
        self._node.update_subscribers(pacer.watermarks)
        self.params_changed = 0
        self.update_params(admitted=True)
        for view in self._views:
            if reset and not view.latched:
                view.clear()
            else:
                view.refresh()
