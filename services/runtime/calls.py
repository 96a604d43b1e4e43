"""Asking: typed requests with a deadline on every call, a reason in every refusal, and one server for each request."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from messages.base import Message, WrongPayload, decoder, encode
from messages.requests import Refusal, Request
from services.runtime.errors import CallFailed, NoAnswer, SeveralServers
from services.runtime.graph import Entity, pattern
from services.runtime.network.transport import TIMEOUT, Reply, Transport

Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)

DEADLINE_S = 5.0
"""Wall time that a call waits for its reply unless told otherwise."""


_read_refusal = decoder(Refusal)


def call(transport: Transport, request: Request[Q, R], key: str, message: Q, timeout: float = DEADLINE_S) -> R:
    """Ask and wait.

    Raises NoAnswer when nobody serves or nobody answers in time, SeveralServers when more than one process answers, and
    CallFailed when it is refused.
    """
    return understand(request, key, transport.query(key, encode(message), timeout), timeout, transport)


def understand(request: Request[Q, R], key: str, replies: Sequence[Reply], timeout: float, transport: Transport) -> R:
    """The answer in ``replies``; raises CallFailed as ``call`` does. ``transport`` tells whose they are."""
    name = f"/{key}"
    if not replies:
        raise NoAnswer(f"nobody serves {name}: is the process that does running?")
    check_single(name, replies, transport)
    for reply in replies:
        if not reply.ok:
            continue
        try:
            return decoder(request.replies)(reply.payload)
        except WrongPayload as error:
            raise CallFailed(
                f"{name} answered with something else than a {request.replies.__name__}: {error}"
            ) from None
    said = next((each for each in replies if each.payload != TIMEOUT), None)
    if said is None:
        raise NoAnswer(f"{name} did not answer within {timeout} s: it may be stuck, or have died")
    raise CallFailed(_reason(name, said.payload))


def check_single(name: str, replies: Sequence[Reply], transport: Transport) -> None:
    """Raise SeveralServers, with their names, when more than one process answered the request ``name``.

    A process that has died, and whose token is still in sight, answers nothing: it is none of them.
    """
    sessions = sorted({each.session for each in replies if each.session})
    if len(sessions) < 2:
        return
    nodes = {each.session: each.node for each in servers(transport, name)}
    said = ", ".join(f"{nodes.get(each, 'a program without a name')} (session {each[:8]})" for each in sessions)
    raise SeveralServers(
        f"{len(sessions)} processes serve {name}: {said}; each of them may have carried the request out. "
        "Stop all but one; ./elea doctor names them"
    )


def servers(transport: Transport, name: str = "*") -> list[Entity]:
    """Who shows by a token that it serves the request ``name``, or any at all."""
    found = (Entity.parse(key) for key in transport.tokens(pattern("srv", "*", name)))
    return [each for each in found if each is not None]


def _reason(name: str, payload: bytes) -> str:
    try:
        return f"{name}: {_read_refusal(payload).reason}"
    except WrongPayload:
        return f"{name} refused without a reason that can be read: {payload[:80]!r}"
