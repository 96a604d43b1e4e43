"""Asking again until there is an answer, for requests that carry an id and are carried out once under it."""

from __future__ import annotations

import time
from typing import TypeVar

from messages.base import Message, WrongPayload, decoder, encode
from messages.requests import Refusal, Request
from services.runtime.calls import check_single
from services.runtime.errors import CallFailed
from services.runtime.graph import pattern
from services.runtime.network.transport import TIMEOUT, Transport
from services.runtime.serving import INTERNAL

Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)

TRY_S = 2.0
"""Wall time that one attempt waits for its answer."""
PATIENCE_S = 1.0
"""Wall time to wait for somebody who serves the request at all."""
_PAUSE_S = 0.1
_read_refusal = decoder(Refusal)


class Uncertain(CallFailed):
    """The request was sent and no answer came: it may have been carried out, or not."""


def insist(transport: Transport, request: Request[Q, R], message: Q, timeout: float = 5.0) -> R:
    """The reply to a request with an absolute name, asked again with the same id for as long as none comes.

    Raises CallFailed when it was refused, or when nobody serves it, so that it was certainly not carried out;
    Uncertain when all attempts within ``timeout`` [s] remained without an answer, or its handler failed at each;
    SeveralServers when more than one process answered.
    """
    began, sent, key, failure = time.monotonic(), False, request.name[1:], ""
    payload = encode(message)
    while True:
        left = timeout - (time.monotonic() - began)
        if sent and left <= 0:
            raise Uncertain(
                f"{request.name} did not answer within {timeout:g} s: "
                f"it is unknown whether the request was carried out{failure}"
            )
        if not sent and not transport.tokens(pattern("srv", "*", request.name)):
            if time.monotonic() - began > min(timeout, PATIENCE_S):
                raise CallFailed(f"nobody serves {request.name}, nothing was asked: is the process that does running?")
            time.sleep(_PAUSE_S)
            continue
        sent = True
        replies = transport.query(key, payload, max(min(left, TRY_S), _PAUSE_S))
        check_single(request.name, replies, transport)
        for reply in replies:
            if reply.ok:
                return _read(request, reply.payload)
            if (reason := _reason(reply.payload)) is not None:
                if not reason.startswith(INTERNAL):
                    raise CallFailed(reason)
                failure = f"; the last answer: {reason}"
        time.sleep(_PAUSE_S)


def _read(request: Request[Q, R], payload: bytes) -> R:
    try:
        return decoder(request.replies)(payload)
    except WrongPayload as error:
        raise CallFailed(
            f"{request.name} answered with something else than a {request.replies.__name__}: {error}"
        ) from None


def _reason(payload: bytes) -> str | None:
    """Why it was refused; None when nobody answered in time."""
    if payload == TIMEOUT:
        return None
    try:
        return _read_refusal(payload).reason
    except WrongPayload:
        return f"refused without a reason that can be read: {payload[:80]!r}"
