"""The node of a script: topics, services, parameters and time for the threads that the script owns."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass
from typing import Any

from messages.base import encode
from messages.elea import Check, Checks
from messages.names import Identity, validate
from messages.names import key as key_of
from messages.rosgraph import Log as LogLine
from messages.std import Header, Time
from messages.topics import CHECKS, ROSOUT
from services.runtime.errors import BadInput
from services.runtime.graph import REPLACED
from services.runtime.interfaces import InterfaceAnnouncer
from services.runtime.log import Log
from services.runtime.name_claim import ask_to_end
from services.runtime.node import Node
from services.runtime.publisher import Publisher
from services.runtime.transport.api import Reply, Transport
from services.runtime.transport.wire import member_id
from services.runtime.transport.zenoh_config import LARGEST_MESSAGE
from services.script.api import GraphEntry, Origin, Parameters, ScriptStopped, TimeMovedBackwards
from services.script.budget import CALL, GazeboCalls
from services.script.clock import ScriptClock
from services.script.lockstep_network import SCRIPT, LockstepNetwork
from services.script.network import Network
from services.script.node_loop import LockstepLoop, NodeLoop, RealTimeLoop
from services.script.parameter_tree import SharedParameters
from services.script.robot_frames import RobotFrames
from services.script.services import FOREVER_S, ServiceServer, read_answer
from services.script.stepping_node import SteppingNode
from services.script.threads import FreeThreads, Threads, report_exception
from services.script.topics import SubscriberFollower, TopicInput, TopicOutput, TopicReader
from services.script.turns import TurnThreads

_SEND_S = 0.03
"""Wall time [s] for the last messages to leave before the tokens are removed, which would overtake them."""
_LEAVE_S = 0.3
"""The same in lockstep, for the report of the last tick: without it the script counts as lost, not as finished."""
_ANSWER_S = 330.0
"""Wall time [s] to wait for a service of this project in lockstep. The simulation answers only once every other member
is done or calling too, so this is longer than its own patience with a slow member.
"""
_SETTLE_S = 0.4
"""Wall time [s] that a script of a fleet leaves for the network to connect before it computes."""
_LATE_S = 0.05
"""Wall time [s] within which several checks by the main thread count as one, once the process is asked to end."""
_LOCKSTEP_PATIENCE_S = 60.0
"""Wall time [s] without a first tick after which a script reports it; the simulation reports earlier which members it
waits for.
"""
_START_S = 10.0
"""Wall time [s] that a call waits for time to begin: messages arrive only from then on."""
_LINK_S = 10.0
"""Wall time [s] for which a service that is announced, but does not receive a call yet, is called again: its process
may be waiting for a processor.
"""
_FIRST_POLL_S, _SLOWEST_POLL_S = 0.0002, 0.01


@dataclass(frozen=True, kw_only=True)
class KernelOptions:
    """The options of a script's kernel: ``simulated`` is False with ``--wall-time``."""

    simulated: bool = True
    lockstep: bool = False
    rate: float = 100.0
    log_level: str = "info"
    awaits_parameters: bool = False
    frame_prefix: str = ""


class ScriptKernel:
    """The kernel of a script over a transport; it connects when first needed."""

    def __init__(self, transport: Callable[[], Transport], options: KernelOptions | None = None) -> None:
        self.options = options or KernelOptions()
        self.simulated, self.lockstep = self.options.simulated, self.options.lockstep
        self.rate = self.options.rate
        self.frames = RobotFrames(self.options.frame_prefix)
        self.noticed = self.hooks_done = False
        """Whether the main thread has noticed that the process is asked to end; whether the hooks have run."""
        self.late_checks = 0
        """Number of periods of _LATE_S in which it checked or waited since then: a loop that goes on does so
        repeatedly.
        """
        self._late_since = 0.0
        self._shutting_down = False
        self.lock_node: AbstractContextManager[Any] = threading.RLock()
        """Held while the node is used: by its own thread, and by threads that declare or publish."""
        self.clock = ScriptClock(self.simulated, interpolated=not self.lockstep)
        self.turns: TurnThreads | None = TurnThreads(self.clock, self._warn) if self.lockstep else None
        self.threads: Threads = self.turns or FreeThreads(self.clock)
        self.parameters: Parameters = SharedParameters(self, self._writer, self.options.awaits_parameters)
        self.readers: dict[str, TopicReader] = {}
        self.servers: list[ServiceServer] = []
        self.outputs: list[TopicOutput] = []
        self.followers: dict[str, SubscriberFollower] = {}
        self.node: Node | None = None
        self._announcer: InterfaceAnnouncer | None = None
        self._open_transport = transport
        self._resources = ExitStack()
        self._transport: Transport | None = None
        self._network: Network | None = None
        self._loop: NodeLoop | None = None
        self._ended: NodeLoop | None = None
        """The loop that has ended: its lockstep token is removed with the network, after its last report."""
        self._stepping: SteppingNode | None = None
        self._hooks: list[Callable[[], None]] = []
        self._warned: set[str] = set()
        self._linked: set[str] = set()
        """The followed publications that reach a subscriber."""
        self._hooks_lock = threading.RLock()
        self._ending = self._unrepeatable_reported = self._early = False
        self._gazebo = GazeboCalls()
        self.end_process: Callable[[str], None] = self.shut_down
        """Ends the process, with a reason, as if asked from outside."""

    @property
    def shutting_down(self) -> bool:
        """Whether the process was asked to end, and its hooks have run."""
        self._notice()
        return self._shutting_down

    @property
    def transport(self) -> Transport:
        """The transport, opened when first needed."""
        with self.lock_node:
            if self._transport is None:
                self._transport = self._resources.enter_context(self._open_transport())
                self._network = LockstepNetwork(self._transport) if self.lockstep else Network(self._transport)
            return self._transport

    @property
    def network(self) -> Network:
        """The nodes on the network, as last seen."""
        _ = self.transport
        assert self._network is not None
        if self.node is None:
            self._network.update()
        return self._network

    def start_early(self, node: str, namespace: str) -> None:
        """Claim the node name that the fleet gave this process before the script does, since the
        script may wait first.
        """
        self.start(node, namespace, SCRIPT)
        self._early = True
        deadline, seen = time.monotonic() + _SETTLE_S, -1
        while self.network.version != seen and time.monotonic() < deadline:  # the links of a whole fleet come up
            seen = self.network.version
            time.sleep(_SETTLE_S / 8)

    def start(self, node: str, namespace: str, kind: str) -> None:
        with self.lock_node:
            if self.node is not None and self._early:
                self._early = False
                if node != self.node.identity.node:
                    self._warn(
                        f"the fleet names this node {self.node.identity.node}; the script's own name {node} is ignored"
                    )
                return
            if self.node is not None:
                raise BadInput(f"this process is the node {self.node.identity.node} already")
            log = Log(node, self.options.log_level)
            log.now = self.now
            made = Node(self.transport, Identity(namespace, node), SCRIPT, log)
            if self.lockstep:
                made.clock_patience_s = _LOCKSTEP_PATIENCE_S
            else:
                made.replaceable = True
            made.on_asked_to_end = self._on_asked_to_end
            self._resources.enter_context(made)
            self.node = made
            self._announcer = InterfaceAnnouncer(made)
            if self.turns is not None:
                self._stepping = SteppingNode(self, made, self.turns)
            for output in self.outputs:
                self._bind_output(output, made)
            for reader in self.readers.values():
                self._bind_reader(reader, made)
            for server in self.servers:
                self._bind_server(server, made)
            self._loop = RealTimeLoop(self, made) if self._stepping is None else LockstepLoop(self._stepping, made)
            self._loop.start()

    def advertise(
        self,
        name: str,
        ros_type: str,
        latched: bool = False,
        queue_size: int = 10,
        joined: Callable[[str], bytes | None] | None = None,
        left: Callable[[str], None] | None = None,
    ) -> TopicOutput:
        validate(name)
        output = TopicOutput(name, ros_type, latched, self)
        with self.lock_node:
            if self.node is not None:
                self._bind_output(output, self.node)
            self.outputs.append(output)
            if joined is not None or left is not None:
                self.followers[name] = SubscriberFollower(output, joined, left, self.threads)
        return output

    def subscribe(
        self, name: str, ros_type: str, receive: Callable[[bytes, Any], None], queue_size: int | None = None
    ) -> TopicInput:
        validate(name)
        made = TopicInput(name, ros_type, receive, queue_size, self)
        with self.lock_node:
            reader = self.readers.get(name)
            if reader is None:
                reader = self.readers[name] = TopicReader(name, ros_type, self.threads, self)
                if self.node is not None:
                    self._bind_reader(reader, self.node)
            reader.add(made)
        return made

    def serve(self, name: str, ros_type: str, handle: Callable[[bytes], bytes]) -> ServiceServer:
        validate(name)
        server = ServiceServer(name, ros_type, handle, self)
        with self.lock_node:
            if any(each.name == name for each in self.servers):
                raise BadInput(f"service [{name}] is served by this node already")
            if self.node is not None:
                self._bind_server(server, self.node)
            self.servers.append(server)
        return server

    def call(self, name: str, ros_type: str, payload: bytes, timeout: float | None = None) -> bytes:
        validate(name)
        self.point(CALL if self.turns is None else self._gazebo.cost(name, self.turns.identity(), self.now()))
        if self._stepping is not None:
            if not self.clock.started and not self._shutting_down:
                self.wait_until(lambda: self.clock.started)  # before that, calls of several scripts have no order
            if (replies := self._stepping.call(name, payload, timeout)) is not None:
                return read_answer(name, replies)
        elif isinstance(self._loop, RealTimeLoop) and not self.clock.started and self.network.server(name) is not None:
            self.wait_until(lambda: self.clock.started, _START_S)  # as in ROS, where a call lets time pass
        asked = self._query(name, payload, timeout)
        until = time.monotonic() + _LINK_S
        while not asked and time.monotonic() < until and self.network.server(name) is not None:
            time.sleep(_SLOWEST_POLL_S)
            asked = self._query(name, payload, timeout)
        return read_answer(name, asked)

    def _query(self, name: str, payload: bytes, timeout: float | None) -> Sequence[Reply]:
        """Send a query and wait for the answers; in lockstep, time stands still meanwhile."""
        before = self._shutting_down
        patience = (_ANSWER_S if self.lockstep else FOREVER_S) if timeout is None else timeout
        sender = b""
        if self.lockstep and self.node is not None:
            sender = member_id(self.node.identity.node, self.transport.session)
        pending = self.transport.query_async(key_of(name), payload, patience, sender)
        pause = _FIRST_POLL_S
        while (replies := pending.poll()) is None:
            if (answers := pending.received()) and self._answered(name, answers):
                return answers
            if self._shutting_down and not before:
                raise ScriptStopped(f"the process was asked to end while it waited for {name}")
            time.sleep(pause)
            pause = min(pause * 1.2, _SLOWEST_POLL_S)
        return replies

    def _answered(self, name: str, replies: Sequence[Reply]) -> bool:
        """Return whether the expected answer has arrived, although the network has not reported it as the last one.

        The query goes to every process that may serve the name, including those about which too little is known. One
        that stood still while its links came up may never complete its answer.
        """
        server = self.network.server(name)
        return any(each.ok or (server is not None and each.session == server.session) for each in replies)

    def service_type(self, name: str) -> str | None:
        server = self.network.server(name)
        return None if server is None else server.record

    def graph(self) -> list[GraphEntry]:
        return self.network.entries()

    def nodes(self) -> list[str]:
        return self.network.nodes()

    def end_node(self, node: str, reason: str) -> bool:
        if self.lockstep:  # when that node ends would depend on the machine
            return False
        return any(ask_to_end(self.transport, each, node, reason) for each in self.network.sessions(node))

    @property
    def time_has_begun(self) -> bool:
        """Whether simulation time runs, or has run."""
        return self.clock.started

    def now(self) -> int:
        return self.clock.now() if self.clock.started else 0

    def sleep_until(self, time_ns: int) -> None:
        self.declare_ready()
        try:
            self.threads.sleep_until(time_ns)
        finally:
            self._notice()

    def wait_until(self, ready: Callable[[], bool], timeout: float | None = None, by_messages: bool = False) -> bool:
        self.declare_ready()
        try:
            return self.threads.wait_until(ready, timeout, by_messages)
        finally:
            self._notice()

    def wake(self) -> None:
        self.threads.wake()

    def point(self, cost: float = 1.0) -> None:
        if self._shutting_down:
            self._notice()
        self.threads.point(cost)

    def pause(self, seconds: float) -> None:
        """Wait in simulation time; the end of the process, or a reset of time, ends the wait."""
        with suppress(ScriptStopped, TimeMovedBackwards):
            self.declare_ready()
            self.threads.sleep_until(self.now() + round(seconds * 1e9))
        self._notice()

    def rest(self, seconds: float) -> None:
        """Wait in wall time."""
        self.declare_ready()
        self.threads.rest(seconds)
        self._notice()

    @contextmanager
    def outside(self, what: str) -> Iterator[None]:
        """Let the other threads run while the calling one waits for external input; the run may then not repeat."""
        if self.turns is None:
            yield
            return
        if not self._unrepeatable_reported:
            self._unrepeatable_reported = True
            self._report_unrepeatable(f"the script reads {what}: this run may not be repeatable")
        with self.turns.outside(what):
            yield

    def spawn(self, target: Callable[[], None], name: str) -> threading.Thread:
        return self.threads.spawn(target, name)

    def lock(self) -> Any:
        return self.threads.lock()

    def on_shutdown(self, hook: Callable[[], None]) -> None:
        with self._hooks_lock:
            if not self._shutting_down:
                self._hooks.append(hook)
                return
        hook()

    def shut_down(self, reason: str) -> None:
        with self._hooks_lock:
            if self._ending:
                return
            self._ending = True
        while self._hooks:
            hook = self._hooks.pop(0)
            try:
                hook()
            except Exception:  # noqa: BLE001 - the other hooks still run
                report_exception("a hook of on_shutdown")
        self._shutting_down = self.hooks_done = True
        self.threads.stop()

    def end_waits(self) -> None:
        """End all waits, also in hooks that still run."""
        self.threads.stop()
        self.stop_awaiting_ticks()

    def stop_awaiting_ticks(self) -> None:
        """Stop waiting for ticks: the process is asked to end."""
        if isinstance(self._loop, LockstepLoop):
            self._loop.stop_awaiting_ticks()

    def log(self, level: int, text: str, where: Mapping[str, Any]) -> None:
        node = self.node
        if node is None or (publish := node.log.publish) is None:
            return
        line = LogLine(
            header=Header(stamp=Time.of(self.now())),
            level=level,
            name=node.identity.node,
            msg=text,
            file=str(where.get("file", "")),
            function=str(where.get("function", "")),
            line=int(where.get("line", 0)),
        )
        with self.lock_node:
            publish(line)
            if self._stepping is not None and ROSOUT.name in self.readers:
                rosout = next(each for each in node.publishers if each.name == ROSOUT.name)
                self._stepping.sent(rosout, encode(line))

    def declare_ready(self) -> None:
        """Declare the node ready at the script's first wait: its initial declarations are complete."""
        if (loop := self._loop) is not None:
            loop.declare_ready()

    def await_start(self) -> None:
        """Stay after the script's end until time has begun: the simulation waits to see each node of the fleet."""
        deadline = time.monotonic() + _LOCKSTEP_PATIENCE_S
        if isinstance(self._loop, RealTimeLoop) and self.simulated:
            self._loop.declare_ready()
            while not self.clock.started and time.monotonic() < deadline:
                time.sleep(0.05)

    def stop_loop(self) -> None:
        """Stop the node's thread; in lockstep, once the published messages are reported."""
        if self._loop is not None:
            self._ended, self._loop = self._loop, None
            self._ended.stop()

    def close(self) -> None:
        """Leave the network after the published messages were sent."""
        self.stop_loop()
        if self.node is not None:
            time.sleep(_LEAVE_S if self.lockstep else _SEND_S)
        self._resources.close()

    def follows_simulation(self) -> bool:
        """Return whether the script's own clock is simulation time: always in lockstep, else when it does not run at
        the speed of the wall clock.
        """
        return self.lockstep or (self.clock.started and self.clock.factor != 1.0)

    def spin(self) -> None:
        """Answer requests and follow the network, in the node's thread."""
        for server in self.servers:
            server.poll()
        changed = self.network.update()
        if changed:
            self._warn_types()
        linked = {name for name, each in self.followers.items() if each.output.linked}
        if not self.lockstep and (changed or linked != self._linked):
            self._linked = linked
            self.threads.wake()
            for follower in self.followers.values():
                follower.worker.notify()

    def publish(self, publisher: Publisher[Any], payload: bytes) -> None:
        """Publish a payload on one of the script's publications."""
        if len(payload) > LARGEST_MESSAGE:
            raise BadInput(f"a message of {len(payload)} bytes on {publisher.name}: the limit is {LARGEST_MESSAGE}")
        if self._stepping is None:
            publisher.publish_encoded(payload)
            return
        with self.lock_node:
            self._stepping.publish(publisher, payload)

    def origin(self, publisher: bytes) -> Origin:
        """Return the source of a publisher's samples."""
        return self.network.origin(publisher)

    def is_gone(self, publisher: bytes, name: str) -> bool:
        """Return whether a topic's publication has ended; never in lockstep, where tokens vanish at no defined tick."""
        return not self.lockstep and publisher not in self.network.publishers(name)

    def endpoint_nodes(self, kind: str, name: str) -> list[str]:
        """Return the nodes with an endpoint of this kind; the script's own endpoints are known at once."""
        found = set(self.network.endpoint_nodes(kind, name))
        if self.node is not None:
            own = self.readers if kind == "sub" else {each.name for each in self.outputs}
            found = found - {self.node.identity.node} | ({self.node.identity.node} if name in own else set())
        return sorted(found)

    def links(self, publisher: Publisher[Any]) -> bool:
        """Return whether a sample would reach a subscriber; members of lockstep have seen each other before time
        begins.
        """
        return self.lockstep or publisher.has_subscribers

    def close_output(self, output: TopicOutput, publisher: Publisher[Any] | None) -> None:
        """Close a publication; another of the same topic keeps it alive."""
        with self.lock_node:
            if output not in self.outputs:
                return
            self.outputs.remove(output)
            follower = self.followers.get(output.name)
            if follower is not None and follower.output is output:
                del self.followers[output.name]
                follower.worker.close()
            if (
                publisher is not None
                and self.node is not None
                and all(each.name != output.name for each in self.outputs)
            ):
                self.node.unregister(publisher)

    def close_input(self, given: TopicInput) -> None:
        """Close a subscription; the last one of a topic ends its reader."""
        with self.lock_node:
            reader = self.readers.get(given.name)
            if reader is None:
                return
            reader.remove(given)
            if not reader.inputs:
                del self.readers[given.name]
                reader.worker.close()
                if self.node is not None and reader.subscriber is not None:
                    self.node.unregister(reader.subscriber)

    def close_server(self, server: ServiceServer) -> None:
        """Close a service."""
        with self.lock_node:
            if server in self.servers:
                self.servers.remove(server)
                if server.queries is not None:
                    server.queries.close()
                    server.queries = None
                if self.node is not None:
                    self.node.withdraw_server(server.name, server.ros_type)
                if self._stepping is not None:
                    self._stepping.calls.withdraw(server.name)

    def _on_asked_to_end(self, reason: str) -> None:
        """End as asked by another process, as in ROS: by ``rosnode kill``, or because it takes the name."""
        assert self.node is not None
        if reason == REPLACED:
            reason = f"[{self.node.identity.node}] Reason: {reason}"
        sys.stdout.write(f"shutdown request: {reason}\n")
        sys.stdout.flush()
        threading.Thread(target=self.end_process, args=(reason,), name="asked to end", daemon=True).start()

    def _writer(self) -> str:
        return self.node.identity.node if self.node is not None else f"/_script_{self.transport.session[:12]}"

    def _report_unrepeatable(self, reason: str) -> None:
        """Report in the log and as a check that the run may not repeat, which is not a failure."""
        self._warn(reason)
        if self.node is not None:
            stated = Check(name="reads_input", value=1.0, min=0.0, max=1.0, reason=reason)
            with self.lock_node:
                self.node.advertise(CHECKS).publish(Checks(node=self.node.identity.node, checks=(stated,)))

    def _warn(self, text: str) -> None:
        if self.node is not None:
            self.node.log.warn(text)

    def _notice(self) -> None:
        """Record that the main thread has noticed the shutdown, and how often it has checked or waited since."""
        if self._shutting_down and threading.current_thread() is threading.main_thread():
            self.noticed = True
            if (now := time.monotonic()) - self._late_since > _LATE_S:
                self._late_since = now
                self.late_checks += 1

    def _announce(self, *types: str) -> None:
        """Announce the definitions of types that only the script's own packages have."""
        if self._announcer is not None:
            self._announcer.add(*types)

    def _bind_reader(self, reader: TopicReader, node: Node) -> None:
        self._announce(reader.ros_type)
        reader.bind(node, not self.lockstep)

    def _bind_output(self, output: TopicOutput, node: Node) -> None:
        self._announce(output.ros_type)
        for each in node.publishers:
            if each.name == output.name and output.ros_type != each.topic.record.ROS_TYPE:
                raise BadInput(
                    f"this node already publishes {each.topic.record.ROS_TYPE} on {output.name}, so it cannot publish "
                    f"{output.ros_type} there"
                )
        output.bind(node)

    def _bind_server(self, server: ServiceServer, node: Node) -> None:
        self._announce(f"{server.ros_type}Request", f"{server.ros_type}Response")
        node.declare_server(server.name, server.ros_type)
        server.queries = self.transport.serve(key_of(server.name), LARGEST_MESSAGE, server.refusals)
        if self._stepping is not None:
            self._stepping.calls.serve(server)

    def _warn_types(self) -> None:
        """Warn, once per topic, that another node uses it with another type, so that neither can decode the other."""
        own = {each.name: each.ros_type for each in self.outputs}
        own |= {each.name: each.ros_type for each in self.readers.values() if each.ros_type not in ("", "*")}
        for name, (ros_type, node) in self.network.other_types(own).items():
            if name not in self._warned:
                self._warned.add(name)
                self._warn(
                    f"{name} has the type {own[name]} here but {ros_type} in {node}: neither can decode the other's "
                    "messages"
                )
