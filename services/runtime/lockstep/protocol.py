"""Lockstep: the simulation waits at each tick until every member that is due has finished its step.

The simulation sends each due member a Go with the time and the numbers of all samples sent up to the previous tick on
the keys that the member reads; the member waits for exactly these, steps, and answers Done with the numbers of what it
sent. So every member sees the same messages at the same tick, whatever the load or the network's timing, and a member
costs nothing at the ticks at which it is not due. One that has said how long it has nothing to do is not due until then
either, unless something is sent to it. ``member`` is the member's side, ``barrier`` the simulation's.

Sessions are public, so both sides prove that they received each other's messages. A join carries a random ``token`` of
the simulation for the member, the answer a random ``nonce`` of the member for the simulation; from then on each Go
repeats the nonce and each Done the token, and any other is refused. A program that only sends cannot know them. One
that also listens on these keys can: only an access list with certificates prevents that.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any

import msgspec
from msgspec import Meta

from messages.base import decoder
from messages.topics import Quality
from services.runtime.lockstep.watermarks import Numbers
from services.runtime.publisher import Publisher
from services.runtime.transport.api import ADMIN_SPACE
from services.runtime.transport.wire import MEMBER_BYTES

SIMULATION = "/sim"
"""The node that leads: the simulation, or the player of a bag in its place."""
ENCODING = "application/msgpack;elea/lockstep"
QUEUE_SIZE = 256
"""Size of the rings of lockstep's keys, above the number of members. What a flood pushes out is sent again."""
MAX_BYTES = 1 << 22
"""Bytes of a Go or a Done; a larger one is refused unread. That of 300 robots takes a twentieth."""
TOKEN_BYTES = 8

Session = Annotated[str, Meta(pattern=r"^[0-9a-f]{1,32}\Z")]
"""The id of a session; nothing else may become part of a key."""
_Instant = Annotated[int, Meta(ge=0, le=1 << 62)]
_Token = Annotated[bytes, Meta(max_length=TOKEN_BYTES)]


class StepGrant(msgspec.Struct, frozen=True, kw_only=True, array_like=True):
    """Leave to take one step. With ``roster`` it is a greeting: see these nodes first, answer, take no step.

    ``skipped`` has the last numbers from before the member read a key: it drops samples up to these.
    """

    simulation: Session
    tick: _Instant
    time: _Instant
    epoch: _Instant
    paused: bool = False
    roster: Annotated[tuple[str, ...], Meta(max_length=1 << 14)] = ()
    members: tuple[Annotated[bytes, Meta(min_length=MEMBER_BYTES, max_length=MEMBER_BYTES)], ...] = ()
    marks: Numbers = {}
    known: Numbers = {}
    token: _Token = b""
    nonce: _Token = b""
    skipped: Numbers = {}


class StepReport(msgspec.Struct, frozen=True, kw_only=True, array_like=True):
    """A step is done; ``known`` has the numbers of samples sent before the peers were certain to receive them.

    A member that is ``leaving`` takes no more steps; a ``tick`` is then its last one.
    A report that ``greets`` answers a join instead of a step, and has
    the ``period`` [ns] of the member's steps. ``reads`` are the keys that it has begun to read in this step: it gets
    what is sent on them from the next one on. ``latches`` are its new publishers of latched topics, whose last sample
    such a reader gets. ``left`` are the nodes of a process with several that take no more steps, while others do.
    Before ``idle_until`` [ns of simulation time] the member has nothing to do unless something is sent to it: until
    then, the simulation may leave out its steps.
    """

    session: Session
    tick: Annotated[int, Meta(ge=-1, le=1 << 62)]
    marks: Numbers = {}
    known: Numbers = {}
    leaving: bool = False
    greets: bool = False
    epoch: _Instant = 0
    token: _Token = b""
    nonce: _Token = b""
    period: _Instant = 0
    reads: Annotated[tuple[str, ...], Meta(max_length=1 << 14)] = ()
    latches: Annotated[tuple[Annotated[bytes, Meta(min_length=16, max_length=16)], ...], Meta(max_length=1 << 14)] = ()
    left: Annotated[tuple[str, ...], Meta(max_length=1 << 14)] = ()
    idle_until: _Instant = 0


decode_grant = decoder(StepGrant)
decode_report = decoder(StepReport)


def grant_key(session: str) -> str:
    """The key on which the member of this session receives Go."""
    return f"{ADMIN_SPACE}/{session}/go"


def report_key(session: str) -> str:
    """The key on which the simulation of this session receives Done."""
    return f"{ADMIN_SPACE}/{session}/done"


def sequence_numbers(outputs: Iterable[Publisher[Any]]) -> Numbers:
    """The last numbers of the outputs that sent anything since the previous call."""
    news: Numbers = {}
    for output in outputs:
        if output.sent != output.reported:
            output.reported = output.sent
            news.setdefault(output.key, {})[output.publisher] = output.sent
    return news


def last_reported(outputs: Iterable[Publisher[Any]]) -> tuple[Numbers, Numbers]:
    """The numbers that ``sequence_numbers`` has reported so far, of latched topics and of the others, to answer a join.

    Latched samples will reach every member, the others are only known. Repeated calls return the same: a join may be
    repeated, also by a simulation that has waited for this member before.
    """
    latched: Numbers = {}
    rest: Numbers = {}
    for output in outputs:
        if output.reported:
            into = latched if output.topic.quality is Quality.LATCHED else rest
            into.setdefault(output.key, {})[output.publisher] = output.reported
    return latched, rest
