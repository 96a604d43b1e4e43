"""Script requests to a service of this project that steps with the scripts in lockstep.

A query would race with the ticks. Such a service therefore receives the requests of scripts on topics, as scripts do
among themselves, and announces its endpoints to them. Queries, e.g. from the command line, are answered as usual.

In real time requests wait for the next tick, as those of turtlesim do for its next update, so that a program that makes
a call and then uses data from its callbacks has received the messages published before.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any, TypeVar

from messages.base import DECODE_ERRORS, Message, decoder, encode
from messages.requests import Refusal, Request
from services.runtime.context import Context
from services.runtime.errors import EleaError
from services.runtime.requests import DeferredReply
from services.script.lockstep_calls import CallReply, call_topic, read_request
from services.script.lockstep_network import ENDPOINTS, Endpoint, encode_announcement
from services.script.topics import ForeignSubscriber

Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)

HELD_S = 0.05
"""Wall time [s] after which a request is answered without a tick: simulation time may stand still."""


class SteppingServices:
    """The requests of a service, received as queries and, in lockstep, on topics; call ``update`` at each tick."""

    def __init__(self, ctx: Context[Any]) -> None:
        self._ctx, self._node = ctx, ctx.node
        self._served: dict[str, tuple[str, ForeignSubscriber | None, Callable[[bytes], bytes]]] = {}
        self._hidden: set[str] = set()
        """Services that are currently hidden: those of a removed turtle."""
        self._announced: tuple[Endpoint, ...] | None = None
        self._held: deque[tuple[float, Callable[[], None]]] = deque()
        """In real time, the arrival times [s] of waiting requests, and the functions that answer them."""

    def serve(self, request: Request[Q, R], handler: Callable[[Q], R], name: str) -> None:
        """Serve a request under a name; ``handler`` raises BadInput to refuse it. A hidden one becomes
        visible again.
        """
        absolute = self._node.identity.resolve(name)
        self._hidden.discard(absolute)
        if absolute in self._served:
            self._node.declare_server(absolute, request.request_type.ROS_TYPE)
            return
        if self._ctx.lockstep:
            self._node.serve(request, handler, name)
        else:
            self._node.serve(request, lambda asked: self._hold(handler, asked), name)
        read = decoder(request.request_type)
        requests = (
            ForeignSubscriber(call_topic(absolute, "request"), self._node.transport) if self._ctx.lockstep else None
        )
        self._served[absolute] = request.request_type.ROS_TYPE, requests, lambda payload: encode(handler(read(payload)))
        if requests is not None:
            self._node.attach(requests)
            self._node.advertise(call_topic(absolute, "reply"))

    def hide(self, request: Request[Q, R], name: str) -> None:
        """Hide a request; the handler refuses those that still arrive."""
        absolute = self._node.identity.resolve(name)
        self._hidden.add(absolute)
        self._node.withdraw_server(absolute, request.request_type.ROS_TYPE)

    def update(self) -> None:
        """Answer the requests of this tick, in lockstep in the order of the services."""
        if not self._ctx.lockstep:
            while self._held:
                self._held.popleft()[1]()
            return
        for name, (_, requests, answer) in list(self._served.items()):
            if requests is None:
                continue
            for payload, _ in requests.messages:
                self._answer(name, requests, answer, payload)
        self._announce()

    def answer_late(self) -> None:
        """Answer requests that have waited for a tick for too long; called between ticks."""
        while self._held and time.monotonic() - self._held[0][0] > HELD_S:
            self._held.popleft()[1]()

    def _hold(self, handler: Callable[[Q], R], asked: Q) -> DeferredReply[R]:
        reply: DeferredReply[R] = DeferredReply()
        self._held.append((time.monotonic(), lambda: reply.answer(lambda: handler(asked))))
        return reply

    def _answer(self, name: str, requests: ForeignSubscriber, answer: Callable[[bytes], bytes], payload: bytes) -> None:
        try:
            asked = read_request(payload)
        except DECODE_ERRORS as error:
            requests.reject(str(error))
            return
        try:
            reply = CallReply(asked.caller, asked.number, True, answer(asked.payload))
        except (EleaError, ValueError) as error:
            reply = CallReply(asked.caller, asked.number, False, encode(Refusal(reason=str(error))))
        self._node.advertise(call_topic(name, "reply")).publish_encoded(encode(reply))

    def _announce(self) -> None:
        """Announce this node's publications, subscriptions and services to the scripts, if they have changed."""
        node = self._node
        ends = [Endpoint("pub", each.name, each.topic.record.ROS_TYPE) for each in node.publishers]
        ends += [Endpoint("sub", each.name, each.topic.record.ROS_TYPE) for each in node.subscribers]
        ends += [Endpoint("srv", name, kind) for name, (kind, *_) in self._served.items() if name not in self._hidden]
        announced = tuple(each for each in ends if "/_" not in each.name)
        if announced != self._announced:
            self._announced = announced
            node.advertise(ENDPOINTS).publish_encoded(
                encode_announcement(node.identity.node, node.transport.session, announced)
            )
