"""Answering: the requests that a node serves, a bounded number of them in each turn of its loop."""

from __future__ import annotations

import time
import traceback
from collections import deque
from collections.abc import Callable, Collection
from typing import Any, Generic, TypeVar

from messages.base import Message, decoder, encode
from messages.requests import Request
from services.runtime.errors import EleaError
from services.runtime.graph import Entity, pattern
from services.runtime.log import Log
from services.runtime.network.backlog import Refusals
from services.runtime.network.transport import Transport, Watch

Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)

AT_ONCE = 16
"""Requests that a node answers in one turn of its loop; the heartbeat comes between two turns."""
AT_ONCE_S = 0.02
"""Wall time after which a turn begins no further one."""
RIVAL_S = 2.0
"""Wall time that a second server of a request must be in sight before the log says so. The token of a process that was
killed goes at once where its machine lives, and within the lease of a link (2 s) where it does not."""
INTERNAL = "internal error"
"""How the refusal begins that says nothing of the request: its handler failed."""
_LONGEST_TRACE = 4000
_LOG_S = 1.0


class Served(Generic[Q, R]):
    """One request that a node answers."""

    def __init__(
        self,
        request: Request[Q, R],
        key: str,
        handler: Callable[[Q], R],
        transport: Transport,
        log: Log,
        refusals: Refusals,
    ) -> None:
        self.request, self.name, self._key = request, f"/{key}", key
        self._handler, self._log, self._refusals = handler, log, refusals
        self._read = decoder(request.asks)
        self._server = transport.serve(key, request.largest, refusals)
        self.waiting: Collection[object] = self._server.waiting

    def answer(self) -> None:
        """Answer the oldest request that waits, if one does.

        A bad one gets its reason. When a handler fails, the asker is told so, the log has the traceback, and the
        process goes on: one request must not end a simulation. What is asked of a wildcard reaches every request that
        it covers, and is meant for none of them.
        """
        if (query := self._server.take()) is None:
            return
        if query.key != self._key:
            query.refuse(self._refusals.add(f"asked of {query.key[:80]!r}, not of {self.name} alone"))
            return
        try:
            reply = encode(self._handler(self._read(query.payload)))
        except (EleaError, ValueError) as error:
            query.refuse(self._refusals.add(str(error)))
        except Exception as error:  # noqa: BLE001 - whatever a handler may raise is told, logged and counted, here
            self._log.error(f"{self.name} failed:\n{traceback.format_exc()[-_LONGEST_TRACE:]}", every=_LOG_S)
            query.refuse(self._refusals.add(f"{INTERNAL}: {type(error).__name__}: {error}; see the log of its process"))
        else:
            query.reply(reply)


class Serving:
    """All requests that a node answers, in turn, so that a flood of one does not keep the others out.

    ``refusals`` counts those that got an error for their answer. The log says when another process serves one of the
    same requests.
    """

    def __init__(self, transport: Transport, log: Log) -> None:
        self.served: list[Served[Any, Any]] = []
        self.refusals = Refusals()
        self._transport, self._log = transport, log
        self._order: deque[Served[Any, Any]] = deque()
        self._rivals: Rivals | None = None

    def add(self, request: Request[Q, R], key: str, handler: Callable[[Q], R]) -> None:
        """Answer ``request`` on ``key`` from the next turn on."""
        made = Served(request, key, handler, self._transport, self._log, self.refusals)
        self.served.append(made)
        self._order.append(made)
        if self._rivals is None:
            self._rivals = Rivals(self._transport, self._log)
        self._rivals.names.add(made.name)

    def turn(self) -> None:
        """Answer some of what waits; when more does, the loop is woken at once for its next turn."""
        if self._rivals is None:
            return
        self._rivals.turn()
        began = 0.0
        for _ in range(AT_ONCE):
            if (served := self._due()) is None:
                return
            began = began or time.monotonic()
            served.answer()
            if time.monotonic() - began > AT_ONCE_S:
                break
        self._transport.nudge()

    def _due(self) -> Served[Any, Any] | None:
        """The next one, after the last that was answered, of which a request waits."""
        for place, each in enumerate(self._order):
            if each.waiting:
                self._order.rotate(-place - 1)
                return each
        return None


class Rivals:
    """Other processes that serve the same requests as this one, as their tokens show."""

    def __init__(self, transport: Transport, log: Log) -> None:
        self.names: set[str] = set()
        self._session, self._log = transport.session, log
        self._watch: Watch = transport.watch(pattern("srv"))
        self._seen: dict[tuple[str, str], dict[str, float]] = {}
        self._said: set[tuple[str, str]] = set()

    def turn(self) -> None:
        """Notice who comes and goes, and say who has stayed."""
        while (event := self._watch.take()) is not None:
            entity = Entity.parse(event.key)
            if entity is not None and entity.session != self._session:
                self._note(entity, event.alive)
        if self._seen:
            self._tell(time.monotonic())

    def _note(self, entity: Entity, alive: bool) -> None:
        who = entity.node, entity.session
        if alive and entity.name in self.names:
            self._seen.setdefault(who, {})[entity.name] = time.monotonic()
        elif not alive and who in self._seen:
            self._seen[who].pop(entity.name, None)
            if not self._seen[who]:
                del self._seen[who]
                self._said.discard(who)

    def _tell(self, now: float) -> None:
        for (node, session), names in self._seen.items():
            since = min(names.values())
            if (node, session) not in self._said and now - since > RIVAL_S:
                self._said.add((node, session))
                self._log.warn(
                    f"{node} (session {session[:8]}) serves {', '.join(sorted(names))} as this node does: "
                    "who asks gets an error that names both, until one of the two is stopped"
                )
