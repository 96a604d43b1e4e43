"""Lockstep: the simulation waits at each tick until every member that is due has finished its step.

The simulation sends each due member a Go with the time and the numbers of all samples sent up to the previous tick on
the keys that the member reads; the member waits for exactly these, steps, and answers Done with the numbers of the
samples that it sent. So every member sees the same messages at the same tick, whatever the load or the network's
timing, and a member costs nothing at ticks at which it is not due. A member that has reported until when it is idle is
not due until then, unless something is sent to it. ``member`` is the member's side, ``barrier`` the simulation's.

Session ids are public, so both sides prove that they received each other's messages. A join carries a random ``token``
of the simulation for the member, the answer a random ``nonce`` of the member for the simulation; from then on each Go
repeats the nonce and each Done the token, and all others are refused. A program that only sends cannot know them. One
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
"""The leading node: the simulation, or the player of a bag in its place."""
ENCODING = "application/msgpack;elea/lockstep"
QUEUE_SIZE = 256
"""Size of the rings of lockstep's keys, above the number of members. Messages that a flood pushes out are resent."""
MAX_BYTES = 1 << 22
"""Maximum bytes of a Go or a Done; a larger one is refused undecoded. That of 300 robots takes a twentieth."""
TOKEN_BYTES = 8

Session = Annotated[str, Meta(pattern=r"^[0-9a-f]{1,32}\Z")]
"""A session id; nothing else may become part of a key."""
_Instant = Annotated[int, Meta(ge=0, le=1 << 62)]
_Token = Annotated[bytes, Meta(max_length=TOKEN_BYTES)]


class StepGrant(msgspec.Struct, frozen=True, kw_only=True, array_like=True):
    """Go: permission to take one step. With ``roster`` it is a join: answer once these nodes are visible; no step.

    ``skipped`` has the last numbers sent before the member subscribed to a key: it drops samples up to these.
    ``readers`` are the sessions that have subscribed to a key since the member's last step: it waits until it knows
    these subscriptions, so that what it sends in this step reaches them.
    """

    simulation: Session
    tick: _Instant
    time: _Instant
    epoch: _Instant
    paused: bool = False
    roster: Annotated[tuple[str, ...], Meta(max_length=1 << 14)] = ()
    members: tuple[Annotated[bytes, Meta(min_length=MEMBER_BYTES, max_length=MEMBER_BYTES)], ...] = ()
    sequence_numbers: Numbers = {}
    announced: Numbers = {}
    token: _Token = b""
    nonce: _Token = b""
    skipped: Numbers = {}
    readers: Annotated[dict[str, tuple[Session, ...]], Meta(max_length=1 << 14)] = {}


class StepReport(msgspec.Struct, frozen=True, kw_only=True, array_like=True):
    """Done: a step is finished.

    ``announced`` has the numbers of samples sent before the peers were sure to receive them. A member that is
    ``leaving`` takes no further steps; ``tick`` is then its last one, or negative. With ``answers_join`` it answers a
    join instead of a step, and has the ``period`` [ns] of the member's steps. ``reads`` are the keys to which the
    member has subscribed in this step: it receives the samples sent from the next step on. ``latches`` are its new
    publishers of latched topics, whose last sample such a subscriber receives. ``left`` are nodes that take no further
    steps, while others of their process do. Before ``idle_until`` [ns of simulation time] the member has nothing to do
    unless something is sent to it: the simulation may skip its steps until then.
    """

    session: Annotated[str, Meta(max_length=32)]
    """Only ever looked up among the members; matching the pattern of ``Session`` takes a third of the decoding."""
    tick: Annotated[int, Meta(ge=-1, le=1 << 62)]
    sequence_numbers: Numbers = {}
    announced: Numbers = {}
    leaving: bool = False
    answers_join: bool = False
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
    """Return the key on which the member of this session receives Go."""
    return f"{ADMIN_SPACE}/{session}/go"


def report_key(session: str) -> str:
    """Return the key on which the simulation of this session receives Done."""
    return f"{ADMIN_SPACE}/{session}/done"


def sequence_numbers(outputs: Iterable[Publisher[Any]]) -> Numbers:
    """Return the last numbers of the publishers that sent anything since the previous call."""
    news: Numbers = {}
    for output in outputs:
        if output.sent != output.reported:
            output.reported = output.sent
            news.setdefault(output.key, {})[output.publisher] = output.sent
    return news


def last_reported(outputs: Iterable[Publisher[Any]]) -> tuple[Numbers, Numbers]:
    """Return the numbers reported so far by ``sequence_numbers``, of latched and of other topics, to answer a join.

    Latched samples will reach every member, the others may not. Repeated calls return the same: a join may be repeated,
    also by a simulation that has waited for this member before.
    """
    latched: Numbers = {}
    rest: Numbers = {}
    for output in outputs:
        if output.reported:
            into = latched if output.topic.quality is Quality.LATCHED else rest
            into.setdefault(output.key, {})[output.publisher] = output.reported
    return latched, rest
