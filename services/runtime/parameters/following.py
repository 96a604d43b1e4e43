"""The parameter service as a node sees it: whether it is there, what it answers, and who may speak in its name."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from messages.base import encode
from messages.names import key as key_of
from messages.parameters import Announcement, Assignment, ParameterValues, UndoParameters
from messages.requests import PARAMS_ANNOUNCE, PARAMS_UNDO
from services.runtime.calls import call, understand
from services.runtime.errors import CallFailed, NoAnswer
from services.runtime.graph import Entity, pattern
from services.runtime.lockstep.marks import Marks
from services.runtime.log import Log
from services.runtime.network.transport import Pending, Transport
from services.runtime.network.wire import MEMBER_BYTES, NODE_BYTES, member_id, publisher_id

if TYPE_CHECKING:
    from services.runtime.parameters.followed import Followed

AUTHORITY = PARAMS_ANNOUNCE.name.rpartition("/")[0]
"""The node of the parameter service: ``/params``."""

SIGHT_S = 0.25
"""Wall time that a starting node looks for a parameter service which it does not see at once."""
START_S = 2.0
"""Wall time that a starting node waits for the parameter service's answer, when that is there."""
AWAIT_S = 10.0
"""Wall time that a node waits for a parameter service that it is told to expect: links may take a while to come up."""
ANSWER_S = 5.0
"""The same later, when it goes on meanwhile."""
RETRY_S = 3.0
"""Wall time after which it asks again when it got no answer, or none that it can use."""

_TOKENS = pattern("srv", AUTHORITY, PARAMS_ANNOUNCE.name)
_KEY = key_of(PARAMS_ANNOUNCE.name)


class Following:
    """Announces a node's sets to the parameter service, now or when it comes. Nothing here blocks but ``begin``.

    ``marks`` are those of lockstep, when there is any. ``quiet`` says nothing of a service that is not there.
    """

    def __init__(self, transport: Transport, node: str, log: Log, quiet: bool = False) -> None:
        self.marks: Marks | None = None
        self._transport, self._node, self._log, self._quiet = transport, node, log, quiet
        self._watch = transport.watch(_TOKENS)
        self._sessions: set[str] = set()
        self._sets: list[Followed[Any]] = []
        self._asking: dict[Followed[Any], tuple[Pending | None, float]] = {}
        self._undoing: list[tuple[Pending, str]] = []
        self._leaving: list[Pending] = []
        self._numbers = itertools.count(1)
        self._missed = False
        self._patience: Callable[[], bool] | None = None

    @property
    def there(self) -> bool:
        """Whether a parameter service is there."""
        return bool(self._sessions)

    @property
    def unanswered(self) -> bool:
        """Whether a set was announced to a parameter service that is there, and not answered yet: neither with values
        nor with a refusal."""
        return self.there and any(not followed.refused for followed in self._asking)

    def expect(self, stopping: Callable[[], bool]) -> None:
        """Block until the parameter service is there, AWAIT_S have passed since this was first called, or the process
        is to stop. ``begin`` then insists on an answer as long."""
        if self._patience is None:
            deadline = time.monotonic() + AWAIT_S
            self._patience = lambda: time.monotonic() < deadline and not stopping()
        while not self.there and self._patience():
            self._look()
            time.sleep(0.01)

    def begin(self, followed: Followed[Any], wait: bool = True) -> None:
        """Announce a set; with ``wait``, block until the answer or START_S have passed.

        A service that is expected is asked again while the time of ``expect`` lasts: it may be seen before the link to
        it carries a question.
        """
        if not self.there:
            self._look()
            if wait and not self._quiet and self._transport.settle_s:
                self._look_again()
        self._sets.append(followed)
        if not self.there:
            self._miss("no parameter service is there: running on its own values; it is followed when it comes")
        elif not wait or self._quiet:
            self._ask(followed)
        else:
            self._introduce(followed)

    def end(self, followed: Followed[Any]) -> None:
        """Follow a set no more, and say so."""
        self._sets.remove(followed)
        self._asking.pop(followed, None)
        if self.there:
            leaving = Announcement(set=followed.set, node=self._node, leaves=True)
            self._leaving.append(self._transport.ask(_KEY, encode(leaving), ANSWER_S))

    def next_id(self) -> str:
        """An id for a request, another one each time: no two sets of this node may share one."""
        return f"{self._transport.session}-{next(self._numbers)}"

    def turn(self) -> None:
        """Notice a parameter service that comes or goes, and take its answers."""
        while (event := self._watch.take()) is not None:
            self._note(event.key, event.alive)
        if self._asking:
            self._pursue()
        self._leaving = [each for each in self._leaving if each.take() is None]
        if self._undoing:
            self._undoing = [each for each in self._undoing if not self._undone(*each)]

    def take_back(self, followed: Followed[Any], revision: int, reason: str) -> None:
        """Let the parameter service undo the change that a node cannot follow, so that all agree on what counts."""
        who = f"{self._node}: {reason}"[:255]
        asked = UndoParameters(set=followed.set, revision=revision, id=self.next_id(), who=who)
        key = key_of(PARAMS_UNDO.name)
        self._undoing.append((self._transport.ask(key, encode(asked), ANSWER_S), followed.set))

    def trusts(self, publisher: bytes, key: str) -> bool:
        """Whether a publisher of ``key`` is the parameter service: it holds the token, or lockstep has it as member."""
        if any(publisher == publisher_id(AUTHORITY, session, key) for session in self._sessions):
            return True
        member, own = publisher[:MEMBER_BYTES], publisher_id(AUTHORITY, "", key)
        same = publisher[:NODE_BYTES] == own[:NODE_BYTES] and publisher[MEMBER_BYTES:] == own[MEMBER_BYTES:]
        return same and self.marks is not None and member in self.marks.members

    def _look_again(self) -> None:
        """While links come up, a service that is there may be out of sight for a moment."""
        deadline = time.monotonic() + SIGHT_S
        while not self.there and time.monotonic() < deadline:
            time.sleep(SIGHT_S / 5)
            self._look()

    def _introduce(self, followed: Followed[Any]) -> None:
        announced = announcement(self._node, followed)
        while True:
            try:
                answer = call(self._transport, PARAMS_ANNOUNCE, _KEY, announced, START_S)
            except CallFailed as error:
                if isinstance(error, NoAnswer) and self._patience is not None and self._patience():
                    time.sleep(0.01)
                    continue
                self._fail(followed, error)
            else:
                followed.told(answer, self._source())
            return

    def _look(self) -> None:
        """Ask the network who is there now; the watch may tell a moment later."""
        for key in self._transport.tokens(_TOKENS):
            self._note(key, True)

    def _note(self, key: str, alive: bool) -> None:
        entity = Entity.parse(key)
        if entity is None:
            return
        if alive and entity.session not in self._sessions:
            self._sessions.add(entity.session)
            for followed in self._sets:
                self._ask(followed)
            if self._missed and not self._quiet:
                self._log.info("the parameter service is there: following it")
            self._missed = False
        elif not alive and entity.session in self._sessions:
            self._sessions.discard(entity.session)
            if not self._sessions:
                self._asking.clear()
                self._miss("the parameter service is gone: the present values stay; it is followed when it comes back")

    def _miss(self, text: str) -> None:
        if not self._missed:
            self._missed = True
            if not self._quiet:
                self._log.info(text)

    def _ask(self, followed: Followed[Any]) -> None:
        payload = encode(announcement(self._node, followed))
        self._asking[followed] = self._transport.ask(_KEY, payload, ANSWER_S), 0.0

    def _pursue(self) -> None:
        for followed, (pending, again) in list(self._asking.items()):
            if pending is None:
                if time.monotonic() >= again:
                    self._ask(followed)
                continue
            replies = pending.take()
            if replies is None:
                continue
            del self._asking[followed]
            try:
                answer = understand(PARAMS_ANNOUNCE, _KEY, replies, ANSWER_S, self._transport)
            except CallFailed as error:
                self._fail(followed, error)
            else:
                self._answered(followed, answer)

    def _undone(self, pending: Pending, name: str) -> bool:
        replies = pending.take()
        if replies is None:
            return False
        try:
            understand(PARAMS_UNDO, key_of(PARAMS_UNDO.name), replies, ANSWER_S, self._transport)
        except CallFailed as error:
            self._log.error(f"the parameters {name} are not what the parameter service says: {error}")
        return True

    def _answered(self, followed: Followed[Any], answer: ParameterValues) -> None:
        source = self._source()
        # In lockstep it counts from the tick at which it comes as an update, the same for everybody.
        if self.marks is None or source not in self.marks.members:
            followed.hear(answer, source)

    def _fail(self, followed: Followed[Any], error: CallFailed) -> None:
        followed.refused = not isinstance(error, NoAnswer)
        if followed.trouble != str(error):
            followed.trouble = str(error)
            self._log.warn(f"the parameters {followed.set} are this node's own for now: {error}")
        self._asking[followed] = None, time.monotonic() + RETRY_S

    def _source(self) -> bytes:
        """Who answers, as far as it is known."""
        return member_id(AUTHORITY, next(iter(self._sessions))) if len(self._sessions) == 1 else b""


def announcement(node: str, followed: Followed[Any]) -> Announcement:
    """What a node says of a set that it follows."""
    return Announcement(
        set=followed.set,
        node=node,
        parameters=followed.described,
        fleet=tuple(assignments(followed.fleet)),
        command_line=tuple(assignments(followed.command_line)),
        run=tuple(assignments(followed.run_values)),
    )


def assignments(values: dict[str, Any]) -> Iterator[Assignment]:
    """Names and values as they travel."""
    for name, value in values.items():
        yield Assignment(name=name, value=value)
