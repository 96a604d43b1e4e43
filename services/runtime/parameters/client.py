"""The client of the parameter service: announces a node's sets, receives their values and retries its requests."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator
from typing import Any, Protocol, Self, TypeVar

from messages.base import Message, encode
from messages.names import key as key_of
from messages.parameters import Announcement, Assignment, ParameterDescription, ParameterValues, UndoParameters
from messages.requests import PARAMS_ANNOUNCE, PARAMS_UNDO, Request
from services.runtime.errors import CallFailed, NoAnswer, TryAgain
from services.runtime.graph import Entity, token_pattern
from services.runtime.lockstep.watermarks import Watermarks
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.requests import INTERNAL, call, check_single, decode_response, read_replies, refusal_reason
from services.runtime.transport.api import TIMEOUT, PendingReplies, Transport
from services.runtime.transport.wire import MEMBER_BYTES, NODE_BYTES, member_id, publisher_id

Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)

TRY_TIMEOUT_S = 2.0
"""Wall time [s] that one attempt waits for its answer."""
LAST_TRY_S = 1.0
"""Wall time [s] to wait for a server of the request if the network reports that there is none."""
_PAUSE_S = 0.1


class OutcomeUnknown(CallFailed):
    """The request was sent and not answered: it may have been carried out, or not."""


def call_idempotent(transport: Transport, request: Request[Q, R], message: Q, timeout: float = 5.0) -> R:
    """Call an idempotent request with an absolute name, repeating it with the same id until it is answered.

    Raises:
        CallFailed: It was refused, or has no server: it was certainly not carried out.
        OutcomeUnknown: No attempt within ``timeout`` [s] was answered, or its handler failed at each.
        SeveralServers: More than one process answered.
    """
    began, sent, key, failure = time.monotonic(), False, request.name[1:], ""
    pattern, payload = token_pattern("srv", "*", request.name), encode(message)
    unsure, absent_since = "", began
    while True:
        left = timeout - (time.monotonic() - began)
        if sent and left <= 0:
            raise OutcomeUnknown(
                f"{request.name} did not answer within {timeout:g} s: "
                f"it is unknown whether the request was carried out{failure}"
            )
        if not sent:
            try:
                servers = transport.all_tokens(pattern)
            except TryAgain as error:
                servers, unsure = transport.tokens(pattern, _PAUSE_S), f"nothing was sent to {request.name}: {error}"
                absent_since = time.monotonic()
            if not servers:
                now = time.monotonic()
                if unsure and now - began > timeout:
                    raise CallFailed(unsure)
                if now - absent_since > min(timeout, LAST_TRY_S):
                    raise CallFailed(
                        f"no server for {request.name}, nothing was sent: is the process that provides it running?"
                    )
                time.sleep(_PAUSE_S)
                continue
        sent = True
        replies = transport.query(key, payload, max(min(left, TRY_TIMEOUT_S), _PAUSE_S))
        check_single(request.name, replies, transport)
        for reply in replies:
            if reply.ok:
                return decode_response(request, request.name, reply.payload)
            if reply.payload != TIMEOUT:
                reason = refusal_reason(reply.payload)
                if not reason.startswith(INTERNAL):
                    raise CallFailed(reason)
                failure = f"; the last answer: {reason}"
        time.sleep(_PAUSE_S)


AUTHORITY = PARAMS_ANNOUNCE.name.rpartition("/")[0]
"""The node of the parameter service: ``/params``."""

DISCOVERY_S = 0.25
"""Wall time [s] that a starting node waits for a parameter service that is not visible at once."""
START_S = 2.0
"""Wall time [s] that a starting node waits for the answer of a visible parameter service."""
AWAIT_S = 10.0
"""Wall time [s] that a node waits for an expected parameter service: links may take a while to come up."""
ANSWER_S = 5.0
"""Wall time [s] that a running node waits for an answer, while its loop continues."""
RETRY_S = 3.0
"""Wall time [s] after which it repeats an announcement without a usable answer."""

_TOKENS = token_pattern("srv", AUTHORITY, PARAMS_ANNOUNCE.name)
_KEY = key_of(PARAMS_ANNOUNCE.name)


class ParameterSet(Protocol):
    """A parameter set that a node announces, and that receives its values."""

    set: str
    described: tuple[ParameterDescription, ...]
    fleet: dict[str, Any]
    command_line: dict[str, Any]
    error: str
    refused: bool

    @property
    def run_values(self) -> dict[str, Any]: ...
    def apply_initial(self, values: ParameterValues, source: bytes) -> None: ...
    def enqueue(self, values: ParameterValues, source: bytes) -> None: ...


class ParameterClient:
    """Announces a node's sets to the parameter service, now or when it appears. Only ``attach`` and ``expect`` block.

    ``watermarks`` are those of lockstep, if any. ``expected`` means that a parameter service runs or will start, so
    that the node waits for it. ``quiet`` logs nothing about a missing service.
    """

    @classmethod
    def of(cls, node: Node, quiet: bool = False) -> Self:
        """Return the node's client, created by the first call; the node's loop serves it from then on."""
        for known in node.extensions:
            if isinstance(known, cls):
                return known
        made = cls(node.transport, node.identity.node, node.log, quiet)
        node.extensions.append(made)
        return made

    def __init__(self, transport: Transport, node: str, log: Log, quiet: bool = False) -> None:
        self.watermarks: Watermarks | None = None
        self.expected = False
        self._transport, self._node, self._log, self._quiet = transport, node, log, quiet
        self._watch = transport.watch(_TOKENS)
        self._sessions: set[str] = set()
        self._sets: list[ParameterSet] = []
        self._asking: dict[ParameterSet, tuple[PendingReplies | None, float]] = {}
        self._undoing: list[tuple[PendingReplies, str]] = []
        self._leaving: list[PendingReplies] = []
        self._numbers = itertools.count(1)
        self._missed = False
        self._patience: Callable[[], bool] | None = None

    @property
    def available(self) -> bool:
        """Whether a parameter service is visible."""
        return bool(self._sessions)

    @property
    def unanswered(self) -> bool:
        """Whether a set announced to a visible parameter service has got neither values nor a refusal yet."""
        return self.available and any(not parameters.refused for parameters in self._asking)

    def expect(self, stopping: Callable[[], bool]) -> None:
        """Block until the parameter service is visible, AWAIT_S have passed since the first call, or the process is to
        stop. Within this time, ``attach`` repeats its announcement."""
        if self._patience is None:
            deadline = time.monotonic() + AWAIT_S
            self._patience = lambda: time.monotonic() < deadline and not stopping()
        while not self.available and self._patience():
            self._poll_tokens()
            time.sleep(0.01)

    def attach(self, parameters: ParameterSet, wait: bool = True) -> None:
        """Announce a set; with ``wait``, block until it is answered or START_S have passed.

        An expected service is called again until the time of ``expect`` is over: it may be visible before the link to
        it works.
        """
        if not self.available:
            self._poll_tokens()
            if wait and not self._quiet and self._transport.settle_s:
                self._check_presence()
        self._sets.append(parameters)
        if not self.available:
            self._note_absent("no parameter service is visible: using this node's own values until one appears")
        elif not wait or self._quiet:
            self._ask(parameters)
        else:
            self._announce(parameters)

    def detach(self, parameters: ParameterSet) -> None:
        """Remove a set, and notify the parameter service."""
        self._sets.remove(parameters)
        self._asking.pop(parameters, None)
        if self.available:
            leaving = Announcement(set=parameters.set, node=self._node, leaves=True)
            self._leaving.append(self._transport.query_async(_KEY, encode(leaving), ANSWER_S))

    def next_id(self) -> str:
        """Return a new request id, unique over all sets of this node."""
        return f"{self._transport.session}-{next(self._numbers)}"

    def spin_once(self) -> None:
        """Process parameter services that appeared or disappeared, and their answers."""
        while (event := self._watch.poll()) is not None:
            self._note(event.key, event.alive)
        if self._asking:
            self._retry()
        self._leaving = [each for each in self._leaving if each.poll() is None]
        if self._undoing:
            self._undoing = [each for each in self._undoing if not self._undone(*each)]

    def request_undo(self, parameters: ParameterSet, revision: int, reason: str) -> None:
        """Ask the parameter service to undo a change that this node rejects, so that all nodes have the same values."""
        who = f"{self._node}: {reason}"[:255]
        asked = UndoParameters(set=parameters.set, revision=revision, id=self.next_id(), who=who)
        key = key_of(PARAMS_UNDO.name)
        self._undoing.append((self._transport.query_async(key, encode(asked), ANSWER_S), parameters.set))

    def trusts(self, publisher: bytes, key: str) -> bool:
        """Return whether a publisher of ``key`` is the parameter service, by its token or as a lockstep member."""
        if any(publisher == publisher_id(AUTHORITY, session, key) for session in self._sessions):
            return True
        member, own = publisher[:MEMBER_BYTES], publisher_id(AUTHORITY, "", key)
        same = publisher[:NODE_BYTES] == own[:NODE_BYTES] and publisher[MEMBER_BYTES:] == own[MEMBER_BYTES:]
        return same and self.watermarks is not None and member in self.watermarks.members

    def _check_presence(self) -> None:
        """Wait up to DISCOVERY_S for a service: while links come up, it may be invisible for a moment."""
        deadline = time.monotonic() + DISCOVERY_S
        while not self.available and time.monotonic() < deadline:
            time.sleep(DISCOVERY_S / 5)
            self._poll_tokens()

    def _announce(self, parameters: ParameterSet) -> None:
        announced = announcement(self._node, parameters)
        while True:
            try:
                answer = call(self._transport, PARAMS_ANNOUNCE, _KEY, announced, START_S)
            except CallFailed as error:
                if isinstance(error, NoAnswer) and self._patience is not None and self._patience():
                    time.sleep(0.01)
                    continue
                self._fail(parameters, error)
            else:
                parameters.apply_initial(answer, self._source())
            return

    def _poll_tokens(self) -> None:
        """Query the tokens now; the watch may report them a moment later."""
        for key in self._transport.tokens(_TOKENS):
            self._note(key, True)

    def _note(self, key: str, alive: bool) -> None:
        entity = Entity.parse(key)
        if entity is None:
            return
        if alive and entity.session not in self._sessions:
            self._sessions.add(entity.session)
            for parameters in self._sets:
                self._ask(parameters)
            if self._missed and not self._quiet:
                self._log.info("the parameter service is visible: following it")
            self._missed = False
        elif not alive and entity.session in self._sessions:
            self._sessions.discard(entity.session)
            if not self._sessions:
                self._asking.clear()
                self._note_absent("the parameter service is gone: keeping the current values until it returns")

    def _note_absent(self, text: str) -> None:
        if not self._missed:
            self._missed = True
            if not self._quiet:
                self._log.info(text)

    def _ask(self, parameters: ParameterSet) -> None:
        payload = encode(announcement(self._node, parameters))
        self._asking[parameters] = self._transport.query_async(_KEY, payload, ANSWER_S), 0.0

    def _retry(self) -> None:
        for parameters, (pending, again) in list(self._asking.items()):
            if pending is None:
                if time.monotonic() >= again:
                    self._ask(parameters)
                continue
            replies = pending.poll()
            if replies is None:
                continue
            del self._asking[parameters]
            try:
                answer = read_replies(PARAMS_ANNOUNCE, _KEY, replies, ANSWER_S, self._transport)
            except CallFailed as error:
                self._fail(parameters, error)
            else:
                self._answered(parameters, answer)

    def _undone(self, pending: PendingReplies, name: str) -> bool:
        replies = pending.poll()
        if replies is None:
            return False
        try:
            read_replies(PARAMS_UNDO, key_of(PARAMS_UNDO.name), replies, ANSWER_S, self._transport)
        except CallFailed as error:
            self._log.error(f"the parameters {name} differ from those of the parameter service: {error}")
        return True

    def _answered(self, parameters: ParameterSet, answer: ParameterValues) -> None:
        source = self._source()
        # In lockstep the values apply from the tick at which they arrive as an update, the same for all members.
        if self.watermarks is None or source not in self.watermarks.members:
            parameters.enqueue(answer, source)

    def _fail(self, parameters: ParameterSet, error: CallFailed) -> None:
        parameters.refused = not isinstance(error, NoAnswer)
        if parameters.error != str(error):
            parameters.error = str(error)
            self._log.warn(f"using this node's own values of the parameters {parameters.set} for now: {error}")
        self._asking[parameters] = None, time.monotonic() + RETRY_S

    def _source(self) -> bytes:
        """Return the member id of the answering service; empty unless exactly one is visible."""
        return member_id(AUTHORITY, next(iter(self._sessions))) if len(self._sessions) == 1 else b""


def announcement(node: str, parameters: ParameterSet) -> Announcement:
    """Return the announcement of a node's set."""
    return Announcement(
        set=parameters.set,
        node=node,
        parameters=parameters.described,
        fleet=tuple(assignments(parameters.fleet)),
        command_line=tuple(assignments(parameters.command_line)),
        run=tuple(assignments(parameters.run_values)),
    )


def assignments(values: dict[str, Any]) -> Iterator[Assignment]:
    """Yield names and values as assignments of a message."""
    for name, value in values.items():
        yield Assignment(name=name, value=value)
