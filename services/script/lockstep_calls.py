"""Calls between scripts in lockstep: requests and replies are event topics, which arrive at the same tick in every run.

A query would race with the ticks. A request on ``NAME/_request`` reaches its server at the next tick, the reply on
``NAME/_reply`` its caller at the one after.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import msgspec

from messages.base import DECODE_ERRORS, encode, raw_decoder
from messages.records import unknown_record
from messages.topics import Quality, Topic
from services.runtime.node import Node
from services.runtime.publisher import Publisher
from services.runtime.transport.api import Reply
from services.runtime.transport.zenoh_config import LARGEST_MESSAGE
from services.script.services import ServiceServer
from services.script.topics import ForeignSubscriber


class CallRequest(msgspec.Struct, frozen=True):
    """A call: its caller, the caller's number for it, and the request."""

    caller: str
    number: int
    payload: bytes


class CallReply(msgspec.Struct, frozen=True):
    """The reply to a call; if it is refused, the payload is a Refusal."""

    caller: str
    number: int
    ok: bool
    payload: bytes


read_request = raw_decoder(CallRequest)
_read_reply = raw_decoder(CallReply)


class Publish(Protocol):
    """Publishes a payload of the node."""

    def __call__(self, publisher: Publisher[Any], payload: bytes) -> None: ...


def call_topic(name: str, part: str) -> Topic[Any]:
    """Return the topic of a service's requests (``request``) or replies (``reply``)."""
    record = unknown_record(f"elea_msgs/Call{part.capitalize()}")
    return Topic(f"{name}/_{part}", record, 0, Quality.EVENT, "", LARGEST_MESSAGE)


class LockstepCalls:
    """The calls that one script makes and answers. ``admit`` belongs to the node's thread; all need the node locked."""

    def __init__(self, node: Node, publish: Publish) -> None:
        self._node, self._publish = node, publish
        self._served: dict[str, tuple[ServiceServer, ForeignSubscriber]] = {}
        self._called: dict[str, ForeignSubscriber] = {}
        self._number = 0
        self._answers: dict[int, Reply] = {}
        self._open: set[int] = set()

    def serve(self, server: ServiceServer) -> None:
        """Subscribe to other scripts' requests for a service."""
        subscriber = ForeignSubscriber(call_topic(server.name, "request"), self._node.transport)
        self._node.attach(subscriber)
        self._node.advertise(call_topic(server.name, "reply"))
        self._served[server.name] = server, subscriber

    def withdraw(self, name: str) -> None:
        """Unsubscribe from requests for a service; the publication of its replies stays, for one of this tick."""
        if (found := self._served.pop(name, None)) is not None:
            self._node.unregister(found[1])

    def ask(self, name: str, payload: bytes) -> int:
        """Publish a request; return its number."""
        if name not in self._called:
            self._called[name] = subscriber = ForeignSubscriber(call_topic(name, "reply"), self._node.transport)
            self._node.attach(subscriber)
        self._number += 1
        self._open.add(self._number)
        request = CallRequest(self._node.identity.node, self._number, payload)
        self._publish(self._node.advertise(call_topic(name, "request")), encode(request))
        return self._number

    def answer(self, number: int) -> Reply | None:
        """Return the reply to a request; None until it has arrived."""
        return self._answers.get(number)

    def forget(self, number: int) -> None:
        """Discard a request whose caller no longer waits."""
        self._open.discard(number)
        self._answers.pop(number, None)

    def admit(self) -> None:
        """Pass on the requests and replies of this tick."""
        for server, requests in list(self._served.values()):
            for payload, _ in requests.messages:
                self._take_request(server, requests, payload)
            requests.messages = []
        for replies in list(self._called.values()):
            for payload, _ in replies.messages:
                self._take_reply(replies, payload)
            replies.messages = []

    def _take_request(self, server: ServiceServer, requests: ForeignSubscriber, payload: bytes) -> None:
        try:
            request = read_request(payload)
        except DECODE_ERRORS as error:
            requests.reject(str(error))
            return
        server.put(request.payload, self._answer_with(server, request, True), self._answer_with(server, request, False))

    def _answer_with(self, server: ServiceServer, request: CallRequest, ok: bool) -> Callable[[bytes], None]:
        def answer(payload: bytes) -> None:
            reply = CallReply(request.caller, request.number, ok, payload)
            if server.name in self._served:
                self._publish(self._node.advertise(call_topic(server.name, "reply")), encode(reply))

        return answer

    def _take_reply(self, replies: ForeignSubscriber, payload: bytes) -> None:
        try:
            reply = _read_reply(payload)
        except DECODE_ERRORS as error:
            replies.reject(str(error))
            return
        if reply.caller == self._node.identity.node and reply.number in self._open:
            self._answers[reply.number] = Reply(reply.ok, reply.payload)
