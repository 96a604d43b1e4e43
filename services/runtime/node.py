"""A node on the network: its name, its inputs and outputs, what it serves, its tokens and its heartbeat."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import islice
from typing import Any, Self, TypeVar

from messages.base import Message
from messages.elea import Health
from messages.requests import Request
from messages.rosgraph import Log as LogLine
from messages.topics import HEALTH, ROSOUT, Topic
from services.runtime.calls import DEADLINE_S, call
from services.runtime.counts import Counts
from services.runtime.errors import Stopped, TryAgain
from services.runtime.graph import Entity, Kind, pattern, ping_key
from services.runtime.health import Heart
from services.runtime.identity import Identity
from services.runtime.inputs import PATIENCE_S, Input, Patience
from services.runtime.lockstep.marks import Marks
from services.runtime.log import Log
from services.runtime.network.transport import Inlet, Token, Transport
from services.runtime.outbox import Outbox
from services.runtime.outputs import Output
from services.runtime.parameters.following import Following
from services.runtime.reach import Reach
from services.runtime.register import present
from services.runtime.serving import Serving

M = TypeVar("M", bound=Message)
Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)

TAKEOVER_S = 1.5
"""Wall time in which the token of a predecessor that was killed must have gone."""
MOST_NUMBERS = 4096
"""Publications that ended, whose numbers are kept in case they begin again; the oldest are forgotten."""
CLOCK_PATIENCE_S = 2.0
"""Wall time without a first clock after which a node says so."""

_PINGS = 16
"""Pings answered in one turn."""


class Node:
    """Everything of a node but its time. Used by one thread, the loop's."""

    def __init__(self, transport: Transport, identity: Identity, kind: str, log: Log) -> None:
        self.transport, self.identity, self.kind, self.log = transport, identity, kind, log
        self.heart = Heart(identity.node, log)
        self.outbox = Outbox()
        self.inputs: list[Input[Any]] = []
        self.outputs: list[Output[Any]] = []
        self.counts: list[Counts] = []
        """Of keys that no input reads; the health lists those that refused something."""
        self.serving = Serving(transport, log)
        self.served = self.serving.served
        self.following: Following | None = None
        self.expects_params = False
        self.clock_patience_s = CLOCK_PATIENCE_S
        self.stopping = self.calling = False
        self._tokens: dict[tuple[Kind, str], Token] = {}
        self._numbers: dict[str, int] = {}
        self._reach = Reach(transport, log)

    def __enter__(self) -> Self:
        self._claim()
        self._health: Output[Health] = Output(
            HEALTH, HEALTH.name, self.identity.key(HEALTH.name), self.identity.node, self.transport, self.outbox
        )
        self._declare("pub", HEALTH.name, Health.ROS_TYPE, HEALTH.quality.name)
        self._rosout: Output[LogLine] = self.write(ROSOUT)
        self.log.publish = self._rosout.publish
        self._pings = self.transport.serve(ping_key(self.transport.session, self.identity.node))
        return self

    def __exit__(self, *exception: object) -> None:
        self.log.publish = None

    def read(self, topic: Topic[M], name: str | None = None, raw: bool = False) -> Input[M]:
        """Subscribe to a topic, under another name if one is given; one subscription serves all its readers.

        A ``raw`` input gives the payloads themselves.
        """
        absolute = self.identity.resolve(name or topic.name)
        for known in self.inputs:
            if known.name == absolute and known.topic.record is topic.record:
                return known
        made = Input(topic, absolute, self.identity.key(name or topic.name), self.transport, raw)
        self.inputs.append(made)
        self._declare("sub", absolute, topic.record.ROS_TYPE, topic.quality.name)
        return made

    def write(self, topic: Topic[M], name: str | None = None) -> Output[M]:
        """Publish on a topic, under another name if one is given.

        One that was forgotten and begins again goes on with its numbers: its readers would drop the old ones.
        """
        absolute = self.identity.resolve(name or topic.name)
        for known in self.outputs:
            if known.name == absolute:
                return known
        made = Output(
            topic, absolute, self.identity.key(name or topic.name), self.identity.node, self.transport, self.outbox
        )
        made.sent = made.marked = self._numbers.pop(absolute, 0)
        self.outputs.append(made)
        self._declare("pub", absolute, topic.record.ROS_TYPE, topic.quality.name)
        return made

    def forget(self, *ends: Input[Any] | Output[Any]) -> None:
        """End subscriptions and publications, as when a robot leaves the world."""
        self.outbox.release()
        for end in ends:
            if isinstance(end, Input):
                self.inputs.remove(end)
                self._tokens.pop(("sub", end.name)).close()
            else:
                self.outputs.remove(end)
                self._tokens.pop(("pub", end.name)).close()
                self._numbers[end.name] = end.sent
                if len(self._numbers) > MOST_NUMBERS:
                    del self._numbers[next(iter(self._numbers))]
            end.close()

    def serve(self, request: Request[Q, R], handler: Callable[[Q], R], name: str | None = None) -> None:
        """Answer a request in this node's loop; the handler raises BadInput to refuse with a reason."""
        absolute = self.identity.resolve(name or request.name)
        self.serving.add(request, self.identity.key(name or request.name), handler)
        self._declare("srv", absolute, request.asks.ROS_TYPE, "-")

    def call(self, request: Request[Q, R], message: Q, timeout: float = DEADLINE_S, name: str | None = None) -> R:
        """Ask another node; raises CallFailed. The caller's loop stands still until the reply or the deadline, or until
        the process is asked to end (Stopped).
        """
        self.outbox.release()
        self.calling = True
        try:
            return call(self.transport, request, self.identity.key(name or request.name), message, timeout)
        finally:
            self.calling = False

    def show_step(self, period_ns: int) -> None:
        """Show that the node's ticks may begin: its inputs are declared."""
        entity = Entity(self.transport.session, "step", self.identity.node, detail=str(period_ns))
        self._tokens["step", self.identity.node] = self.transport.token(entity.key)

    def show_ready(self) -> None:
        """Show, once, that the node is at work: for those that take no ticks."""
        if ("ready", self.identity.node) not in self._tokens and ("step", self.identity.node) not in self._tokens:
            entity = Entity(self.transport.session, "ready", self.identity.node)
            self._tokens["ready", self.identity.node] = self.transport.token(entity.key)

    def turn(self) -> None:
        """What every loop does again and again: end when asked, answer requests, beat."""
        if self.stopping:
            raise Stopped("the process was asked to end")
        self.serving.turn()
        for query in islice(iter(self._pings.take, None), _PINGS):
            query.reply(b"")
        if self.following is not None:
            self.following.turn()
        self._reach.turn()
        self._beat()

    def wait(self, inlet: Inlet) -> None:
        """Turn, then block until the inlet, a nudge or a tenth of a second; what was held back leaves first."""
        self.turn()
        self.outbox.release()
        self.transport.wait(inlet)

    def admit(self, marks: Marks | None = None) -> None:
        """Take the snapshot of all inputs. With ``marks``, PATIENCE_S is all that the tick waits for what they name."""
        if marks is None:
            for each in self.inputs:
                each.admit()
            return
        patience = Patience(self._beat_in_burst)
        for each in self.inputs:
            each.admit(marks, patience)
        marks.settle()
        if patience.missed:
            missed = ", ".join(patience.missed)
            self.log.warn(f"announced, and not here within {PATIENCE_S:g} s, so it counts as lost: {missed}", every=5.0)

    def _beat(self) -> None:
        refusing = [each for each in self.counts if each.refused]
        inputs: list[Input[Any] | Counts] = [*self.inputs, *refusing]
        self.heart.beat(self._health, inputs, self.outputs, self.serving.refusals)

    def _beat_in_burst(self) -> None:
        """Beat while a tick waits for samples: its burst has begun, and what is put into it would leave too late."""
        held = self.outbox.held is not None
        self.outbox.release()
        self._beat()
        if held:
            self.outbox.hold()

    def _claim(self) -> None:
        """Take the node's name; raises TryAgain when another process holds it and does not go."""
        mine = Entity(self.transport.session, "node", self.identity.node, self.kind)
        self._tokens["node", self.identity.node] = self.transport.token(mine.key)
        settle = self.transport.settle_s
        if self._sees_everybody():
            if not self._sessions("node") - {mine.session}:
                return
            settle *= 2  # the other may come at the same moment, and take as long to see everybody
        started = seen = time.monotonic()
        while True:
            rivals = self._rivals(mine.session)
            now = time.monotonic()
            # While links come up, a token that is there may be out of sight for a moment.
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
        """Wait until everybody is in sight of whom the router knows; False when that cannot be told, or takes long."""
        deadline = time.monotonic() + self.transport.settle_s
        while (expected := present(self.transport)) is not None and time.monotonic() < deadline:
            if expected <= set(self.transport.tokens(pattern("node"))):
                return True
            time.sleep(0.01)
        return False

    def _rivals(self, mine: str) -> list[str]:
        """Sessions with a better claim to the name: those at work under it, else those that ask at the same moment."""
        at_work = self._sessions("pub") - {mine}
        return sorted(at_work) or sorted(each for each in self._sessions("node") if each < mine)

    def _sessions(self, kind: Kind) -> set[str]:
        found = (Entity.parse(key) for key in self.transport.tokens(pattern(kind, self.identity.node)))
        return {each.session for each in found if each}

    def _declare(self, kind: Kind, name: str, record: str, detail: str) -> None:
        entity = Entity(self.transport.session, kind, self.identity.node, name, record, detail)
        self._tokens[kind, name] = self.transport.token(entity.key)
