"""What a page asks of other nodes: the request behind each word, with a deadline, while the loop goes on."""

from __future__ import annotations

import uuid
from typing import Any, NamedTuple

import msgspec

from messages.base import Message, encode
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
from services.panel.answers import answer
from services.panel.page import Page
from services.panel.words import Ask, Forget, History, Pause, Process, Reset, Resume, Set, Step, Undo
from services.runtime.calls import understand
from services.runtime.errors import BadInput, CallFailed
from services.runtime.identity import Identity
from services.runtime.network.transport import Pending, Transport

_ORDERS = {"start": SUPERVISOR_START, "stop": SUPERVISOR_STOP, "restart": SUPERVISOR_RESTART}

AT_ONCE = 8
"""Requests of a page that wait for their answers; more are refused."""


class _Asked(NamedTuple):
    """A question that is under way."""

    page: Page
    number: int
    request: Request[Any, Any]
    key: str
    pending: Pending
    deadline: float


class Asker:
    """Asks other nodes, and gives the answers to the pages that wanted them. Nothing here waits."""

    def __init__(self, transport: Transport, identity: Identity) -> None:
        self._transport, self._identity = transport, identity
        self._asked: list[_Asked] = []

    @property
    def busy(self) -> bool:
        """Whether any answer is outstanding."""
        return bool(self._asked)

    def ask(self, page: Page, said: Ask, deadline: float) -> None:
        """Ask for a page; the answer, or after ``deadline`` [s] the reason for none, reaches it by ``turn``."""
        waiting = sum(each.page is page for each in self._asked)
        if waiting >= AT_ONCE:
            raise BadInput(f"{waiting} requests wait for their answers already")
        request, message = self._request(said)
        key = self._identity.key(request.name)
        pending = self._transport.ask(key, encode(message), deadline)
        self._asked.append(_Asked(page, said.id, request, key, pending, deadline))

    def turn(self) -> None:
        """Hand on the answers that have come."""
        if not self._asked:
            return
        waiting = []
        for each in self._asked:
            replies = each.pending.take()
            if replies is None:
                waiting.append(each)
                continue
            try:
                reply = understand(each.request, each.key, replies, each.deadline, self._transport)
                answer(each.page, each.number, True, msgspec.to_builtins(reply))
            except CallFailed as error:
                answer(each.page, each.number, False, str(error))
        self._asked = waiting

    def _request(self, said: Ask) -> tuple[Request[Any, Any], Message]:
        who, number = self._identity.node, uuid.uuid4().hex
        match said:
            case Pause():
                return PAUSE, Empty()
            case Resume():
                return RESUME, Empty()
            case Step(count=count):
                return STEP, Steps(count=count)
            case Reset(time=time):
                return (RESET if time else RESET_WORLD), Empty()
            case Process(verb=verb, name=name):
                return _ORDERS[verb], Name(name=name)
            case Set():
                values = tuple(Assignment(name=name, value=value) for name, value in said.values.items())
                return PARAMS_SET, SetParameters(set=said.set, values=values, run=said.run, id=number, who=who)
            case Forget():
                return PARAMS_RESET, ResetParameters(set=said.set, names=said.names, id=number, who=who)
            case Undo():
                return PARAMS_UNDO, UndoParameters(set=said.set, id=number, who=who)
            case History():
                return PARAMS_HISTORY, HistoryOf(set=said.set, limit=said.limit)
            case _:
                raise BadInput(f"{type(said).__name__} is no request of another node")
