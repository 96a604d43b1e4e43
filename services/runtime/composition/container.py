"""A component container: the loops of several nodes in one thread, each in a greenlet that yields where it waits."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from greenlet import greenlet

from messages.names import Identity
from services.runtime.composition.lockstep_group import LockstepGroup
from services.runtime.composition.node_transport import NodeTransport, SharedConnection
from services.runtime.context import MakePacer
from services.runtime.discovery import ReachabilityCheck
from services.runtime.errors import EleaError, Stopped
from services.runtime.graph import Entity
from services.runtime.log import Log
from services.runtime.name_claim import claim_names
from services.runtime.node import Node
from services.runtime.transport.api import ADMIN_SPACE, RawSubscriber, Token, Transport, idle_subscriber

Loop = Callable[[Node, MakePacer | None], None]
"""The loop of a node, called with the node, once on the network, and a factory of its pacer (None: the default)."""


class NodeFailed(EleaError):
    """The loop of a node raised an error; its container has ended all others."""

    def __init__(self, node: str, error: BaseException) -> None:
        super().__init__(f"{node}: {error}")
        self.node, self.error = node, error


class Container:
    """Nodes that share a process, a connection and a thread.

    At each event on the network, all waiting loops are resumed in turn, in the order in which the nodes were added, to
    check for work of their own. A loop that waits for a reply lets the others continue; one that computes, or blocks
    in a call of its own, blocks all.
    """

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self._shared = SharedConnection(transport)
        self._components: list[_Component] = []
        self._group: LockstepGroup | None = None
        self._alarms: dict[str, RawSubscriber] = {}
        """By key, subscriptions that wake the thread for a waiting node while the thread waits on another key."""

    @property
    def nodes(self) -> tuple[str, ...]:
        """The names of the nodes."""
        return tuple(each.node.identity.node for each in self._components)

    def add(self, identity: Identity, kind: str, log: Log, loop: Loop, steps: bool = False) -> None:
        """Add a node of a service's ``kind``, before ``run``; with ``steps`` it takes part in lockstep."""
        self._components.append(_Component(self._shared, identity, kind, log, loop, steps))

    def stop(self) -> None:
        """Ask all loops to end; may be called from any thread or a signal handler."""
        for each in self._components:
            each.node.stopping = True
        self._transport.wake()

    def run(self) -> None:
        """Run all loops until they end. If one fails, the others are asked to end before NodeFailed is raised.

        Raises:
            TryAgain: Another process holds one of the names.
            NodeFailed: A loop raised an error.
        """
        nodes = [each.node for each in self._components]
        session = self._transport.session
        claims = claim_names(
            self._transport, [Entity(session, "node", node.identity.node, node.kind) for node in nodes]
        )
        if stepping := [each.node for each in self._components if each.steps]:
            self._group = LockstepGroup(self._transport, stepping)
        for component, token in zip(self._components, claims, strict=True):
            component.start(token, self._group)
        reachability, idle = ReachabilityCheck(self._transport, nodes[0].log), idle_subscriber(self._transport)
        running, failed = list(self._components), list[_Component]()
        while True:
            for component in tuple(running):
                if component.resume():
                    continue
                running.remove(component)
                component.close(self._group)
                if component.error is not None:
                    failed.append(component)
                    self.stop()
            if not running:
                break
            self._wait(running, idle)
            reachability.update()
        if failed:
            error = failed[0].error
            assert error is not None
            raise NodeFailed(failed[0].node.identity.node, error) from error

    def _wait(self, running: list[_Component], idle: RawSubscriber) -> None:
        """Block until there may be work for one of the nodes.

        The thread waits on one subscription: that of lockstep, or the one that the first node waits for. A sample on
        any other awaited key wakes it.
        """
        chosen, pattern = None if self._group is None else self._group.raw, ""
        for component in running:
            raw, key = self._shared.source(component.awaited)
            if raw is None or key.startswith(ADMIN_SPACE):
                continue  # it waits for a reply, for lockstep, or only for a wake-up
            if chosen is None:
                chosen, pattern = raw, key
            elif key != pattern and key not in self._alarms:
                self._alarms[key] = self._transport.subscribe(key, 1, notify=self._transport.wake)
        self._transport.wait(chosen or idle)
        if chosen is None:
            idle.recv()
        if self._group is not None:
            self._group.poll()


class _Component:
    """One node of a container: its loop in a greenlet, and the subscription that it waits for, if any (``awaited``)."""

    def __init__(
        self, shared: SharedConnection, identity: Identity, kind: str, log: Log, loop: Loop, steps: bool
    ) -> None:
        self.node = Node(NodeTransport(shared, self._give_way), identity, kind, log, sole=False)
        self.steps = steps
        self.awaited: RawSubscriber | None = None
        self.error: BaseException | None = None
        self._loop = loop
        self._claim: Token | None = None
        self._greenlet: greenlet | None = None

    def start(self, claim: Token, group: LockstepGroup | None) -> None:
        """Prepare the loop; ``resume`` begins it. Called in the greenlet that calls ``resume``."""
        self._claim = claim
        if group is None or not self.steps:
            self._greenlet = greenlet(partial(self._run, None))
        else:
            self.node.send_buffer, self.node.command_buffer = group.send_buffer, group.command_buffer
            self._greenlet = greenlet(partial(self._run, group.pacer))

    def resume(self) -> bool:
        """Run the loop until it waits; returns False once it has ended."""
        assert self._greenlet is not None
        self._greenlet.switch()
        return not self._greenlet.dead

    def close(self, group: LockstepGroup | None) -> None:
        """Remove the node from the network after its loop has ended."""
        if group is not None and self.steps:
            group.leave(self.node)
        if self._claim is not None:
            self._claim.close()
        self.node.leave()

    def _run(self, make_pacer: MakePacer | None) -> None:
        try:
            with self.node:
                self._loop(self.node, make_pacer)
        except Stopped:
            pass
        except BaseException as error:  # noqa: BLE001 whatever it is, the container raises it in its own loop
            self.error = error

    def _give_way(self, subscriber: RawSubscriber | None) -> None:
        """Switch to the other loops until there may be work for this one; called by the loop."""
        assert self._greenlet is not None
        self.awaited = subscriber
        self._greenlet.parent.switch()
        if subscriber is None:  # for a reply
            if self.node.stopping:
                raise Stopped("the process was asked to end while it waited for an answer")
            self.node.publish_heartbeat()
