"""Client of a running fleet: read topics, publish, call requests, set parameters, step paused simulation time.

    from services.runtime import CMD_VEL, ODOM, Twist, Vector3, connect

    with connect() as fleet:
        fleet.publish(CMD_VEL.of("tb3_0"), Twist(linear=Vector3(x=0.1)), seconds=2.0)
        print(fleet.latest(ODOM.of("tb3_0")).pose.pose.position)

It is for notebooks and short programs; write a service to drive a robot continuously.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

from messages.base import Message
from messages.names import key as key_of
from messages.parameters import Assignment
from messages.requests import PAUSE, RESUME, STEP, Request
from messages.simulation import SimTime, Steps
from messages.topics import CLOCK, Topic
from services.runtime.errors import BadInput, NoAnswer
from services.runtime.fleet_instances import running_fleets
from services.runtime.graph import snapshot
from services.runtime.light_node import LightNode, open_transport
from services.runtime.network_address import port_of_fleet, resolve_address, select_fleet
from services.runtime.parameters.service_client import ParameterServiceClient
from services.runtime.publisher import Publisher
from services.runtime.requests import call
from services.runtime.subscriber import Subscriber

M = TypeVar("M", bound=Message)
Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)

TIMEOUT_S = 5.0
"""Default wall time [s] to wait for a message, a reply, or the next step of simulation time."""
PUBLISH_PERIOD_NS = 50_000_000
"""Simulation time [ns] between two samples of a repeated message; a base stops after 0.5 s without one."""
_SETTLE_S = 0.3
"""Wall time [s] in which the links to the subscribers of a new publication are established."""


def connect(fleet: str = "", port: int | None = None, router: str = "", domain: str = "") -> Client:
    """Connect to a running fleet.

    Args:
        fleet: Its name; not needed if only one fleet is running.
        port: Its port, if several fleets have this name.
        router: The endpoint of a router on another machine, as ``tcp/host:7447``; then fleet and port are ignored.
        domain: The fleet's domain; not needed for a fleet of this user.

    Returns:
        The connection; ``close`` it, or use it in a ``with``.

    Raises:
        BadInput: No fleet is running, or several are and none is chosen.
    """
    chosen = port_of_fleet(fleet, port) if fleet and not router else port
    address = resolve_address(router, domain, chosen)
    folder = None if router or not running_fleets() else Path(select_fleet(chosen).folder)
    with ExitStack() as resources:
        transport = resources.enter_context(open_transport(address.router, address.domain))
        return Client(LightNode(transport, "client"), resources.pop_all(), folder)


class Client:
    """A connection to a running fleet, for use by one thread.

    ``folder`` is the run's folder, which contains the report once the fleet has ended; None for a fleet on another
    machine.
    """

    def __init__(self, node: LightNode, resources: ExitStack, folder: Path | None = None) -> None:
        self._node, self._resources, self.folder = node, resources, folder
        self._transport = node.transport
        self._subscribers: dict[tuple[str, str], Subscriber[Any]] = {}
        self._publishers: dict[str, Publisher[Any]] = {}
        self._last: dict[tuple[str, str], Any] = {}
        self._epoch = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Leave the network; further calls do nothing."""
        self._resources.close()

    def topics(self) -> dict[str, str]:
        """Return the ROS types of all topics in use, by name."""
        found = snapshot(self._transport)
        hidden = {each.node for each in found if each.node.rpartition("/")[2].startswith("_")}
        ends = [each for each in found if each.kind in ("pub", "sub") and each.node not in hidden]
        return {each.name: each.record for each in sorted(ends, key=lambda each: each.name)}

    def latest(self, topic: Topic[M], timeout: float = TIMEOUT_S) -> M:
        """Return the newest message of a topic.

        Args:
            topic: For example ``ODOM.of("tb3_0")``.
            timeout: Wall time to wait for a first message [s].

        Raises:
            NoAnswer: None arrived; the text says whether the topic has a publisher.
        """
        self.messages(topic)
        deadline = time.monotonic() + timeout
        while (found := self._last.get(_identity(topic))) is None:
            if time.monotonic() > deadline:
                raise NoAnswer(self._silence(topic, timeout))
            self._transport.wait(self._subscriber(topic).raw)
            self.messages(topic)
        result: M = found
        return result

    def next(self, topic: Topic[M], timeout: float = TIMEOUT_S) -> M:
        """Return the next message that arrives on a topic; raises NoAnswer after ``timeout`` [s] of wall time."""
        self.messages(topic)
        self._last.pop(_identity(topic), None)
        return self.latest(topic, timeout)

    def messages(self, topic: Topic[M]) -> list[M]:
        """Return the messages received since the last call for this topic, oldest first; the first call subscribes.

        Up to 1,024 are kept (8,192 of event topics, fewer of large messages); beyond that, the oldest are lost.
        """
        subscriber = self._subscriber(topic)
        subscriber.update()
        found: list[M] = [message for message, _ in subscriber.messages]
        if found:
            self._last[_identity(topic)] = found[-1]
        return found

    def publish(self, topic: Topic[M], message: M, seconds: float = 0.0) -> None:
        """Publish a message once, or 20 times a second for ``seconds`` of simulation time.

        A base stops when its last command is older than its timeout, so give ``seconds`` to keep it moving.

        Raises:
            NoAnswer: Simulation time does not advance.
        """
        publisher = self._publisher(topic)
        publisher.publish(message)
        if seconds <= 0:
            return
        begin = self._now()
        end, due = begin + round(seconds * 1e9), begin + PUBLISH_PERIOD_NS
        while (now := self._tick()) < end:
            if now >= due:
                publisher.publish(message)
                due = now + PUBLISH_PERIOD_NS

    def call(self, request: Request[Q, R], message: Q | None = None, timeout: float = TIMEOUT_S) -> R:
        """Call a request and wait for its reply.

        Args:
            request: For example ``messages.requests.GET_STATE``.
            message: The request record; one with default values if not given.
            timeout: Wall time to wait for the reply [s].

        Raises:
            NoAnswer: It has no server, or was not answered in time.
            CallFailed: It was refused; the text has the reason.
        """
        asked: Any = request.request_type() if message is None else message
        return call(self._transport, request, key_of(request.name), asked, timeout)

    def time(self) -> float:
        """Return the simulation time [s]."""
        return self._now() / 1e9

    def wait(self, seconds: float) -> None:
        """Wait for ``seconds`` of simulation time; raises NoAnswer if it does not advance."""
        end = self._now() + round(seconds * 1e9)
        while self._tick() < end:
            pass

    def pause(self) -> SimTime:
        """Pause simulation time."""
        return self.call(PAUSE)

    def resume(self) -> SimTime:
        """Resume simulation time."""
        return self.call(RESUME)

    def step(self, count: int = 1, timeout: float = 60.0) -> SimTime:
        """Run ``count`` physics steps of 5 ms while simulation time is paused; returns when they are done."""
        return self.call(STEP, Steps(count=count), timeout)

    def params(self, name: str) -> dict[str, Any]:
        """Return the parameters of a node or parameter set by name; raises BadInput with the nearest name."""
        client = self._parameters()
        return {each.name: each.value for each in client.values(client.find_set(name).set).values}

    def set_params(self, name: str, values: Mapping[str, Any], save: bool = True) -> dict[str, Any]:
        """Set parameters of a node or parameter set, all or none.

        Args:
            name: The node or the set, for example "/tb3_0/waypoint".
            values: The new values by parameter name.
            save: Whether to save them for later runs.

        Returns:
            All parameters of the set, like ``params``.

        Raises:
            BadInput: There is no such set.
            CallFailed: A value was refused; the text has its bound.
        """
        client = self._parameters()
        changes = tuple(Assignment(name=each, value=value) for each, value in values.items())
        done = client.set(client.find_set(name).set, changes, clamp=False, run=not save)
        return {each.name: each.value for each in done.values}

    def _parameters(self) -> ParameterServiceClient:
        return ParameterServiceClient(self._transport, TIMEOUT_S)

    def _now(self) -> int:
        clock = self.latest(CLOCK)
        self._epoch = clock.epoch
        return clock.clock.ns

    def _tick(self) -> int:
        """Wait for the next clock and return its simulation time [ns]; raises NoAnswer if paused, silent or reset."""
        epoch = self._epoch
        try:
            clock = self.next(CLOCK)
        except NoAnswer:
            raise NoAnswer(f"simulation time did not advance for {TIMEOUT_S:g} s: is it paused?") from None
        if clock.paused:
            raise NoAnswer("simulation time is paused: resume it, or step it")
        if clock.epoch != epoch:
            raise NoAnswer("the simulation was reset meanwhile")
        return clock.clock.ns

    def _subscriber(self, topic: Topic[M]) -> Subscriber[M]:
        found = self._subscribers.get(_identity(topic))
        if found is None:
            name = _absolute(topic)
            found = Subscriber(topic, name, key_of(name), self._transport)
            self._node.declare_subscription(name, topic.record.ROS_TYPE, topic.quality.name)
            self._subscribers[_identity(topic)] = found
        return found

    def _publisher(self, topic: Topic[M]) -> Publisher[M]:
        name = _absolute(topic)
        found = self._publishers.get(name)
        if found is None:
            found = self._publishers[name] = Publisher(topic, name, key_of(name), self._node.node, self._transport)
            self._node.declare_publication(name, topic.record.ROS_TYPE, topic.quality.name)
            time.sleep(_SETTLE_S)
        return found

    def _silence(self, topic: Topic[Any], timeout: float) -> str:
        name = _absolute(topic)
        known = self.topics()
        if name not in known:
            return f"{name} has no publisher: topics() lists the topics in use"
        if known[name] != topic.record.ROS_TYPE:
            return f"{name} carries {known[name]}, not {topic.record.ROS_TYPE}"
        return f"nothing on {name} for {timeout:g} s: is the simulation paused?"


def _absolute(topic: Topic[Any]) -> str:
    """Return the topic's absolute name: relative names are resolved in the root; raises BadInput for private ones."""
    if topic.name.startswith("~"):
        raise BadInput(f"{topic.name} belongs to a node: use of() with the name of the node")
    return f"/{topic.name.removeprefix('/')}"


def _identity(topic: Topic[Any]) -> tuple[str, str]:
    return _absolute(topic), topic.record.ROS_TYPE
