"""Lockstep: the simulation waits at each tick until every member that is due has finished its step.

The simulation sends each due member a Go with the time and the numbers of all samples sent up to the previous tick on
the keys that the member reads; the member waits for exactly these, steps, and answers Done with the numbers of what it
sent. So every member sees the same messages at the same tick, whatever the load or the network's timing, and a member
costs nothing at the ticks at which it is not due. ``follower`` is the member's side, ``barrier`` the simulation's.

Sessions are public, so both sides prove that they have heard each other. A greeting carries a ``token`` that the
simulation drew for the member, the answer a ``nonce`` that the member drew for the simulation; from then on each Go
repeats the nonce and each Done the token, and what carries another one is refused. Who only sends cannot know them. Who
also listens on these keys can: only an access list with certificates keeps him out.
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
"""Samples kept on the keys of lockstep; more than there are members. What a flood pushes out is sent again."""
MAX_BYTES = 1 << 22
"""Bytes of a Go or a Done; a larger one is refused unread. That of 300 robots takes a twentieth."""
TOKEN_BYTES = 8

Session = Annotated[str, Meta(pattern=r"^[0-9a-f]{1,32}\Z")]
"""The id of a session; nothing else may become part of a key."""
_Instant = Annotated[int, Meta(ge=0, le=1 << 62)]
_Token = Annotated[bytes, Meta(max_length=TOKEN_BYTES)]


class StepGrant(msgspec.Struct, frozen=True, kw_only=True, array_like=True):
    """Leave to take one step. With ``roster`` it is a greeting: see these nodes first, answer, take no step."""

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


class StepReport(msgspec.Struct, frozen=True, kw_only=True, array_like=True):
    """A step is taken; ``known`` holds what was sent before the fellows were certain to listen.

    One that is ``leaving`` takes no more steps; one that ``greets`` answers a greeting, stands for no step, and tells
    the ``period`` [ns] of the member's steps.
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


decode_grant = decoder(StepGrant)
decode_report = decoder(StepReport)


def grant_key(session: str) -> str:
    """Where the member of this session receives Go."""
    return f"{ADMIN_SPACE}/{session}/go"


def report_key(session: str) -> str:
    """Where the simulation of this session receives Done."""
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
    """What ``sequence_numbers`` has told of each output so far: of what is latched, and of the rest.

    It answers a greeting. What is latched will reach everybody, the rest is only known. It is the same however often
    it is asked for: a greeting may come again, also from a simulation that has waited for this member before.
    """
    latched: Numbers = {}
    rest: Numbers = {}
    for output in outputs:
        if output.reported:
            into = latched if output.topic.quality is Quality.LATCHED else rest
            into.setdefault(output.key, {})[output.publisher] = output.reported
    return latched, rest
