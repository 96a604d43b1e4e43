"""Requests and replies: typed, with a deadline on every call and a reason in every refusal."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

from messages.base import Message, WrongPayload, decoder, encode
from messages.requests import Refusal, Request
from services.runtime.errors import CallFailed, EleaError, NoAnswer
from services.runtime.network.transport import Reply, Transport

Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)

DEADLINE_S = 5.0
"""Wall time that a call waits for its reply unless told otherwise."""


_read_refusal = decoder(Refusal)


def call(transport: Transport, request: Request[Q, R], key: str, message: Q, timeout: float = DEADLINE_S) -> R:
    """Ask and wait; raises NoAnswer when nobody serves or nobody answers in time, CallFailed when it is refused."""
    return understand(request, key, transport.query(key, encode(message), timeout), timeout)


def understand(request: Request[Q, R], key: str, replies: Sequence[Reply], timeout: float) -> R:
    """The answer in ``replies``; raises CallFailed as ``call`` does."""
    name = f"/{key}"
    if not replies:
        raise NoAnswer(f"nobody serves {name}: is the process that does running?")
    for reply in replies:
        if not reply.ok:
            continue
        try:
            return decoder(request.replies)(reply.payload)
        except WrongPayload as error:
            raise CallFailed(
                f"{name} answered with something else than a {request.replies.__name__}: {error}"
            ) from None
    if replies[0].payload == b"Timeout":
        raise NoAnswer(f"{name} did not answer within {timeout} s: it may be stuck, or have died")
    raise CallFailed(_reason(name, replies[0].payload))


def _reason(name: str, payload: bytes) -> str:
    try:
        return f"{name}: {_read_refusal(payload).reason}"
    except WrongPayload:
        return f"{name} refused without a reason that can be read: {payload[:80]!r}"


class Served(Generic[Q, R]):
    """One request that a node answers, in its own loop."""

    def __init__(self, request: Request[Q, R], key: str, handler: Callable[[Q], R], transport: Transport) -> None:
        self.request, self.name, self._key = request, f"/{key}", key
        self._handler = handler
        self._read = decoder(request.asks)
        self._server = transport.serve(key)

    def answer(self) -> None:
        """Answer what is waiting. A bad request gets its reason; an error of ours is answered, then raised.

        What is asked of a wildcard reaches every request that it covers, and is meant for none of them.
        """
        while (query := self._server.take()) is not None:
            if query.key != self._key:
                query.refuse(encode(Refusal(reason=f"asked of {query.key[:80]!r}, not of {self.name} alone")))
                continue
            try:
                reply = self._handler(self._read(query.payload))
            except (EleaError, ValueError) as error:
                query.refuse(encode(Refusal(reason=str(error))))
            except BaseException as error:
                query.refuse(encode(Refusal(reason=f"internal error: {error}")))
                raise
            else:
                query.reply(encode(reply))
