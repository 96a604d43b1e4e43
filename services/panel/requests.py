"""Requests of pages to other nodes: one per client message, with a deadline, without blocking the loop."""

from __future__ import annotations

import uuid
from typing import Any, NamedTuple

import msgspec

from messages.base import Message, encode
from messages.names import Identity
from messages.parameters import Assignment, HistoryOf, ResetParameters, SetParameters, UndoParameters
from messages.requests import (
    PARAMS_HISTORY,
    PARAMS_RESET,
    PARAMS_SET,
    PARAMS_UNDO,
    PAUSE,
    RESET,
    RESET_WORLD,
    RESUME,
    STEP,
    SUPERVISOR_RESTART,
    SUPERVISOR_START,
    SUPERVISOR_STOP,
    Name,
    Request,
)
from messages.simulation import Steps
from messages.std import Empty
from services.panel.pages import Page, send_reply
from services.panel.protocol import ClientRequest, History, Pause, Process, Reset, Resume, Set, Step, Undo, Unset
from services.runtime.errors import BadInput, CallFailed
from services.runtime.requests import read_replies
from services.runtime.transport.api import PendingReplies, Transport

_SUPERVISOR_REQUESTS = {"start": SUPERVISOR_START, "stop": SUPERVISOR_STOP, "restart": SUPERVISOR_RESTART}

MAX_PENDING_REQUESTS = 8
"""Maximum pending requests of a page; further ones are refused."""


class _PendingRequest(NamedTuple):
    """A request waiting for its reply."""

    page: Page
    number: int
    request: Request[Any, Any]
    key: str
    pending: PendingReplies
    deadline: float


class RequestClient:
    """Calls other nodes and sends the replies to the pages that requested them, without blocking."""

    def __init__(self, transport: Transport, identity: Identity) -> None:
        self._transport, self._identity = transport, identity
        self._pending: list[_PendingRequest] = []

    @property
    def busy(self) -> bool:
        """Whether any reply is pending."""
        return bool(self._pending)

    def send(self, page: Page, asked: ClientRequest, deadline: float) -> None:
        """Send a page's request; ``poll`` delivers the reply, or an error after ``deadline`` [s]. Raises BadInput."""
        waiting = sum(each.page is page for each in self._pending)
        if waiting >= MAX_PENDING_REQUESTS:
            raise BadInput(f"{waiting} requests are already waiting for an answer")
        request, message = self._request(asked)
        key = self._identity.key(request.name)
        pending = self._transport.query_async(key, encode(message), deadline)
        self._pending.append(_PendingRequest(page, asked.id, request, key, pending, deadline))

    def poll(self) -> None:
        """Deliver the replies that have arrived."""
        if not self._pending:
            return
        waiting = []
        for each in self._pending:
            replies = each.pending.poll()
            if replies is None:
                waiting.append(each)
                continue
            try:
                reply = read_replies(each.request, each.key, replies, each.deadline, self._transport)
                send_reply(each.page, each.number, True, msgspec.to_builtins(reply))
            except CallFailed as error:
                send_reply(each.page, each.number, False, str(error))
        self._pending = waiting

    def _request(self, asked: ClientRequest) -> tuple[Request[Any, Any], Message]:
        who, number = self._identity.node, uuid.uuid4().hex
        match asked:
            case Pause():
                return PAUSE, Empty()
            case Resume():
                return RESUME, Empty()
            case Step(count=count):
                return STEP, Steps(count=count)
            case Reset(time=time):
                return (RESET if time else RESET_WORLD), Empty()
            case Process(verb=verb, name=name):
                return _SUPERVISOR_REQUESTS[verb], Name(name=name)
            case Set():
                values = tuple(Assignment(name=name, value=value) for name, value in asked.values.items())
                return PARAMS_SET, SetParameters(set=asked.set, values=values, run=asked.run, id=number, who=who)
            case Unset():
                return PARAMS_RESET, ResetParameters(set=asked.set, names=asked.names, id=number, who=who)
            case Undo():
                return PARAMS_UNDO, UndoParameters(set=asked.set, id=number, who=who)
            case History():
                return PARAMS_HISTORY, HistoryOf(set=asked.set, limit=asked.limit)
            case _:
                raise BadInput(f"{type(asked).__name__} is not a request of another node")
