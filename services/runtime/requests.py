"""Requests: calls with a deadline, and servers that do bounded work per turn and reply at once or later."""

from __future__ import annotations

import time
import traceback
from collections import deque
from collections.abc import Callable, Collection, Sequence
from typing import Any, Generic, Protocol, TypeVar

from messages.base import Message, WrongPayload, decoder, encode
from messages.requests import Refusal, Request
from services.runtime.errors import CallFailed, EleaError, NoAnswer, SeveralServers, Stopped
from services.runtime.graph import Entity, token_pattern
from services.runtime.log import Log
from services.runtime.transport.api import TIMEOUT, Query, Reply, TokenWatch, Transport
from services.runtime.transport.request_queue import Refusals

Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)

DEADLINE_S = 5.0
"""Default wall time [s] that a call waits for its reply."""


_read_refusal = decoder(Refusal)


def call(transport: Transport, request: Request[Q, R], key: str, message: Q, timeout: float = DEADLINE_S) -> R:
    """Send a request and wait for the reply.

    Raises:
        NoAnswer: It has no server, or was not answered in time.
        SeveralServers: More than one process answered.
        CallFailed: It was refused.
    """
    return read_replies(request, key, transport.query(key, encode(message), timeout), timeout, transport)


def read_replies(request: Request[Q, R], key: str, replies: Sequence[Reply], timeout: float, transport: Transport) -> R:
    """Return the response in ``replies``; raises CallFailed like ``call``. Errors list the servers on ``transport``."""
    name = f"/{key}"
    if not replies:
        raise NoAnswer(f"no server for {name}: is the process that provides it running?")
    check_single(name, replies, transport)
    for reply in replies:
        if reply.ok:
            return decode_response(request, name, reply.payload)
    answer = next((each for each in replies if each.payload != TIMEOUT), None)
    if answer is None:
        raise NoAnswer(f"{name} did not answer within {timeout} s: it may be stuck, or have died")
    raise CallFailed(f"{name}: {refusal_reason(answer.payload)}")


def check_single(name: str, replies: Sequence[Reply], transport: Transport) -> None:
    """Raise SeveralServers, with their names, if more than one process answered the request ``name``.

    A dead process does not answer, so it does not count even while its token is still visible.
    """
    sessions = sorted({each.session for each in replies if each.session})
    if len(sessions) < 2:
        return
    nodes = {each.session: each.node for each in servers(transport, name)}
    processes = ", ".join(f"{nodes.get(each, 'a program without a name')} (session {each[:8]})" for each in sessions)
    raise SeveralServers(
        f"{len(sessions)} processes serve {name}: {processes}; each of them may have carried the request out. "
        "Stop all but one; ./elea doctor names them"
    )


def servers(transport: Transport, name: str = "*") -> list[Entity]:
    """Return the tokens of the nodes that serve the request ``name``, by default any request."""
    found = (Entity.parse(key) for key in transport.tokens(token_pattern("srv", "*", name)))
    return [each for each in found if each is not None]


def decode_response(request: Request[Q, R], name: str, payload: bytes) -> R:
    """Return the response in a reply of the request ``name``; raises CallFailed if it is not of the request's type."""
    try:
        return decoder(request.response_type)(payload)
    except WrongPayload as error:
        raise CallFailed(
            f"{name} answered with something other than a {request.response_type.__name__}: {error}"
        ) from None


def refusal_reason(payload: bytes) -> str:
    """Return the reason in the error reply of a request."""
    try:
        return _read_refusal(payload).reason
    except WrongPayload:
        return f"refused without a reason that can be read: {payload[:80]!r}"


MAX_PER_TURN = 16
"""Maximum requests that a node answers in one turn of its loop; heartbeats are sent between turns."""
MAX_TURN_S = 0.02
"""Wall time [s] after which a turn starts no further request."""
DUPLICATE_S = 2.0
"""Wall time [s] that a second server of a request must be visible before it is logged. The token of a killed process
disappears at once if its machine is up, and within the lease of a link (2 s) if it is not."""
INTERNAL = "internal error"
"""Prefix of the refusal when a handler fails, as opposed to a bad request."""
_LONGEST_TRACE = 4000
_LOG_S = 1.0


class DeferredReply(Generic[R]):
    """A reply that a handler returns in place of the response, to send the response later.

    The query stays open until ``answer`` is called. A caller whose deadline passes first does not get the reply, but
    the request is still carried out. Queries still open when the node closes are refused.
    """

    def __init__(self) -> None:
        self._answer: Callable[[Callable[[], R | DeferredReply[R]]], None] | None = None

    def bind(self, answer: Callable[[Callable[[], R | DeferredReply[R]]], None]) -> None:
        """Set what ``answer`` calls; done by the server once the handler has returned."""
        self._answer = answer

    def answer(self, response: Callable[[], R | DeferredReply[R]]) -> None:
        """Send the result of ``response``, or refuse the request with the error that it raises.

        If it returns another ``DeferredReply``, that one replaces this one.
        """
        assert self._answer is not None, "a reply is deferred by returning it from the handler"
        self._answer(response)


class RequestGate(Protocol):
    """Decides when to carry out requests that carry the id of their sender as an attachment."""

    def hold(self, sender: bytes, carry_out: Callable[[], None]) -> bool:
        """Hold a request for later; returns False to have it carried out at once."""
        ...

    def release(self) -> None:
        """Carry out the held requests that are due; called in each turn of the node's loop."""
        ...


class RequestHandler(Generic[Q, R]):
    """The server of one request of a node."""

    def __init__(
        self,
        request: Request[Q, R],
        key: str,
        handler: Callable[[Q], R | DeferredReply[R]],
        transport: Transport,
        log: Log,
        refusals: Refusals,
    ) -> None:
        self.request, self.name, self._key = request, f"/{key}", key
        self._handler, self._transport, self._log, self._refusals = handler, transport, log, refusals
        self._read = decoder(request.request_type)
        self._server = transport.serve(key, request.largest, refusals)
        self.waiting: Collection[object] = self._server.waiting
        self._open: dict[DeferredReply[R], Query] = {}

    def answer(self, gate: RequestGate | None = None) -> None:
        """Answer the oldest waiting request, if any, unless a ``gate`` holds it for later.

        A bad request is refused with the reason. If a handler fails, the caller gets an error, the traceback is logged
        and the process continues: one request must not end a simulation. A request to a wildcard reaches every server
        that it matches, and all of them refuse it.
        """
        if (query := self._server.recv()) is None:
            return
        if query.key != self._key:
            reason = f"sent to {query.key[:80]!r}: a request names one service, here {self.name}, without wildcards"
            query.refuse(self._refusals.add(reason))
            return

        def respond() -> None:
            self._respond(query, lambda: self._handler(self._read(query.payload)))

        if gate is None or not query.attachment or not gate.hold(query.attachment, respond):
            respond()

    def close(self) -> None:
        """Refuse the requests whose deferred replies were never sent."""

        def stopped() -> R:
            raise Stopped("the process ended before this was done")

        for reply in list(self._open):
            reply.answer(stopped)

    def end(self) -> None:
        """Stop serving the request."""
        self._server.close()

    def _respond(self, query: Query, response: Callable[[], R | DeferredReply[R]]) -> None:
        try:
            made = response()
            if isinstance(made, DeferredReply):
                self._defer(query, made)
                return
            reply = encode(made)
        except (EleaError, ValueError) as error:
            query.refuse(self._refusals.add(str(error)))
        except Exception as error:  # noqa: BLE001 - whatever a handler may raise is sent, logged and counted, here
            self._log.error(f"{self.name} failed:\n{traceback.format_exc()[-_LONGEST_TRACE:]}", every=_LOG_S)
            query.refuse(self._refusals.add(f"{INTERNAL}: {type(error).__name__}: {error}; see the log of its process"))
        else:
            query.reply(reply)

    def _defer(self, query: Query, reply: DeferredReply[R]) -> None:
        """Keep a query open until its deferred reply is sent, and wake the loop, which has to produce it."""
        self._open[reply] = query

        def answer(response: Callable[[], R | DeferredReply[R]]) -> None:
            if (held := self._open.pop(reply, None)) is not None:
                self._respond(held, response)

        reply.bind(answer)
        self._transport.wake()


class RequestServer:
    """Serves all requests of a node in round-robin order, so that a flood of one does not block the others.

    ``refusals`` counts the requests answered with an error; ``gate`` may hold some for later. A warning is logged if
    another process serves one of the same requests.
    """

    def __init__(self, transport: Transport, log: Log) -> None:
        self.served: list[RequestHandler[Any, Any]] = []
        self.refusals = Refusals()
        self.gate: RequestGate | None = None
        self._transport, self._log = transport, log
        self._order: deque[RequestHandler[Any, Any]] = deque()
        self._rivals: DuplicateServers | None = None

    def add(self, request: Request[Q, R], key: str, handler: Callable[[Q], R | DeferredReply[R]]) -> None:
        """Serve ``request`` on ``key`` from the next turn on."""
        made = RequestHandler(request, key, handler, self._transport, self._log, self.refusals)
        self.served.append(made)
        self._order.append(made)
        if self._rivals is None:
            self._rivals = DuplicateServers(self._transport, self._log)
        self._rivals.names.add(made.name)

    def close(self) -> None:
        """Refuse the queries that are still open."""
        for each in self.served:
            each.close()

    def spin_once(self) -> None:
        """Answer some of the waiting requests; if more may be waiting, wake the loop at once for its next turn."""
        if self._rivals is None:
            return
        self._rivals.update()
        if self._answer_some():
            self._transport.wake()
        if self.gate is not None:
            self.gate.release()

    def _answer_some(self) -> bool:
        """Answer the requests that fit into one turn; returns whether more may be waiting."""
        began = 0.0
        for _ in range(MAX_PER_TURN):
            if (served := self._due()) is None:
                return False
            began = began or time.monotonic()
            served.answer(self.gate)
            if time.monotonic() - began > MAX_TURN_S:
                break
        return True

    def _due(self) -> RequestHandler[Any, Any] | None:
        """Return the next handler in turn that has a waiting request, or None."""
        for place, each in enumerate(self._order):
            if each.waiting:
                self._order.rotate(-place - 1)
                return each
        return None


class DuplicateServers:
    """Watches the tokens of other processes that serve the same requests as this one."""

    def __init__(self, transport: Transport, log: Log) -> None:
        self.names: set[str] = set()
        self._session, self._log = transport.session, log
        self._watch: TokenWatch = transport.watch(token_pattern("srv"))
        self._seen: dict[tuple[str, str], dict[str, float]] = {}
        self._logged: set[tuple[str, str]] = set()

    def update(self) -> None:
        """Update from the servers' tokens, and log second servers visible for longer than DUPLICATE_S."""
        while (event := self._watch.poll()) is not None:
            entity = Entity.parse(event.key)
            if entity is not None and entity.session != self._session:
                self._note(entity, event.alive)
        if self._seen:
            self._warn(time.monotonic())

    def _note(self, entity: Entity, alive: bool) -> None:
        server = entity.node, entity.session
        if alive and entity.name in self.names:
            self._seen.setdefault(server, {})[entity.name] = time.monotonic()
        elif not alive and server in self._seen:
            self._seen[server].pop(entity.name, None)
            if not self._seen[server]:
                del self._seen[server]
                self._logged.discard(server)

    def _warn(self, now: float) -> None:
        for (node, session), names in self._seen.items():
            since = min(names.values())
            if (node, session) not in self._logged and now - since > DUPLICATE_S:
                self._logged.add((node, session))
                self._log.warn(
                    f"{node} (session {session[:8]}) serves {', '.join(sorted(names))} as this node does: "
                    "requests fail with an error that names both, until one of them is stopped"
                )
