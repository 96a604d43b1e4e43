"""A member's side of lockstep."""

from __future__ import annotations

from collections.abc import Iterable

from messages.base import WrongPayload, encode
from messages.topics import Quality
from services.runtime.graph import Entity
from services.runtime.lockstep.marks import Marks, Numbers
from services.runtime.lockstep.protocol import CAPACITY, ENCODING, Done, Go, done_key, go_key, read_go
from services.runtime.network.transport import Inlet, Outlet, Token, Transport
from services.runtime.roster import missing

LINK_S = 10.0
"""Wall time that a member may take to see its fellows before it goes on without them."""


class Follower:
    """Takes Go, answers Done."""

    def __init__(self, transport: Transport, node: str, period_ns: int) -> None:
        self._transport, self._node, self._period_ns = transport, node, period_ns
        self.inlet: Inlet = transport.subscribe(go_key(transport.session), CAPACITY)
        self.marks = Marks()
        self._done: Outlet | None = None
        self._simulation = ""
        self._token: Token | None = None
        self._answered = ""
        self._answer = Done(session="", tick=0)

    def join(self) -> None:
        """Show readiness; every input is declared by now, so whoever sees this token reaches them."""
        entity = Entity(self._transport.session, "step", self._node, detail=str(self._period_ns))
        self._token = self._transport.token(entity.key)

    def take(self) -> Go | None:
        """The next Go, if one is there; what a stranger sent in its place is dropped."""
        if (sample := self.inlet.take()) is None:
            return None
        try:
            go = read_go(sample[0])
        except WrongPayload:
            return None
        if go.members:
            self.marks.members = set(go.members)
        self.marks.advance(go.marks, go.known)
        if go.simulation != self._simulation:
            self._simulation = go.simulation
            self._done = self._transport.publish(done_key(go.simulation), ENCODING, Quality.EVENT)
        return go

    def linked(self, roster: Iterable[str]) -> bool:
        """Whether all fellows are in sight; a put reaches whoever's token is seen."""
        return not missing(self._transport, roster)

    def finish(self, tick: int, marks: Numbers, known: Numbers) -> None:
        """Report the step as taken."""
        self._tell(Done(session=self._transport.session, tick=tick, marks=marks, known=known))

    def greet(self, tick: int, marks: Numbers, known: Numbers) -> None:
        """Answer a greeting. One that comes again, as the answer was lost, gets the same answer."""
        if self._answered != self._simulation:
            self._answered = self._simulation
            self._answer = Done(session=self._transport.session, tick=tick, marks=marks, known=known, greets=True)
        self._tell(self._answer)

    def leave(self) -> None:
        """Tell the simulation not to wait any more."""
        if self._done is not None and self._transport.open:
            self._tell(Done(session=self._transport.session, tick=-1, leaving=True))

    def _tell(self, done: Done) -> None:
        assert self._done is not None
        self._done.put(encode(done), attachment=b"")
