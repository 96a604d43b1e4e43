"""Lockstep: the simulation waits at each tick until every member that is due has finished its step.

The simulation sends each due member a Go with the time and the numbers of all samples sent up to the previous tick on
the keys that the member reads; the member waits for exactly these, steps, and answers Done with the numbers of what it
sent. So every member sees the same messages at the same tick, whatever the load or the network's timing, and a member
costs nothing at the ticks at which it is not due. ``follower`` is the member's side, ``barrier`` the simulation's.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import msgspec

from messages.base import decoder
from messages.topics import Quality
from services.runtime.lockstep.marks import Numbers
from services.runtime.network.transport import KERNEL
from services.runtime.outputs import Output

ENCODING = "application/msgpack;elea/lockstep"
CAPACITY = 256
"""Samples kept on the keys of lockstep; more than there are members."""


class Go(msgspec.Struct, frozen=True, kw_only=True, array_like=True):
    """Leave to take one step. With ``roster`` it is a greeting: see these nodes first, answer, take no step."""

    simulation: str
    tick: int
    time: int
    epoch: int
    paused: bool = False
    roster: tuple[str, ...] = ()
    members: tuple[bytes, ...] = ()
    marks: Numbers = {}
    known: Numbers = {}


class Done(msgspec.Struct, frozen=True, kw_only=True, array_like=True):
    """A step is taken; ``known`` holds what was sent before the fellows were certain to listen.

    One that is ``leaving`` takes no more steps; one that ``greets`` answers a greeting, and stands for no step.
    """

    session: str
    tick: int
    marks: Numbers = {}
    known: Numbers = {}
    leaving: bool = False
    greets: bool = False


read_go = decoder(Go)
read_done = decoder(Done)


def go_key(session: str) -> str:
    """Where the member of this session receives Go."""
    return f"{KERNEL}/{session}/go"


def done_key(session: str) -> str:
    """Where the simulation of this session receives Done."""
    return f"{KERNEL}/{session}/done"


def numbers(outputs: Iterable[Output[Any]]) -> Numbers:
    """The last numbers of the outputs that sent anything since the previous call."""
    news: Numbers = {}
    for output in outputs:
        if output.sent != output.marked:
            output.marked = output.sent
            news.setdefault(output.key, {})[output.publisher] = output.sent
    return news


def greeting_numbers(outputs: Iterable[Output[Any]]) -> tuple[Numbers, Numbers]:
    """As ``numbers`` before the first step: what is latched will reach everybody, the rest is only known."""
    each = list(outputs)
    return (
        numbers(o for o in each if o.topic.quality is Quality.LATCHED),
        numbers(o for o in each if o.topic.quality is not Quality.LATCHED),
    )
