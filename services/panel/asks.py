"""What a page asks of other nodes: the request behind each word, called with a deadline."""

from __future__ import annotations

import uuid
from typing import Any

import msgspec

from messages.base import Message
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
    Steps,
)
from messages.std import Empty
from services.panel.words import Ask, Forget, History, Pause, Process, Reset, Resume, Set, Step, Undo
from services.runtime.calls import call
from services.runtime.errors import BadInput
from services.runtime.identity import Identity
from services.runtime.transport import Transport

_ORDERS = {"start": SUPERVISOR_START, "stop": SUPERVISOR_STOP, "restart": SUPERVISOR_RESTART}


class Asker:
    """Calls other nodes, from any thread; the loop that beats waits for none of it."""

    def __init__(self, transport: Transport, identity: Identity, deadline: float) -> None:
        self._transport, self._identity, self._deadline = transport, identity, deadline

    def carry_out(self, said: Ask) -> object:
        """The answer as JSON takes it; raises CallFailed with the reason, after the deadline at the latest."""
        request, message = self._request(said)
        key = self._identity.key(request.name)
        return msgspec.to_builtins(call(self._transport, request, key, message, self._deadline))

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
