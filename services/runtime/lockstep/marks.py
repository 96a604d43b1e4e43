"""How far lockstep lets each publisher through."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from services.runtime.network.wire import MEMBER_BYTES

LARGEST_JUMP = 1 << 20
"""Samples that a publisher may send between two ticks; a number beyond that is forged."""

Publisher = Annotated[bytes, Meta(min_length=16, max_length=16)]
Numbers = dict[str, dict[Publisher, Annotated[int, Meta(ge=0, le=1 << 62)]]]
"""The last sample numbers by key and publisher."""


class Marks:
    """How far each publisher of a lockstep member has been let through: its last admitted number, by key.

    ``died`` are the members that lockstep no longer waits for because they are gone, until someone takes note.
    ``renewed`` tells that simulation time began anew: all that was sent before has been told by now.
    """

    def __init__(self) -> None:
        self.members: set[bytes] = set()
        self.died: set[bytes] = set()
        self.renewed = False
        self.reached: Numbers = {}
        self.awaited: Numbers = {}

    def advance(self, news: Numbers, known: Numbers | None = None) -> None:
        """Let everything through that was sent up to these numbers; what is in ``news`` is also waited for,
        until ``settle``.

        ``known`` was sent before its readers were certain to listen: it is let through where it came.
        """
        if known:
            merge(self.reached, known)
        merge(self.reached, news)
        merge(self.awaited, news)

    def settle(self) -> None:
        """What was awaited has been taken."""
        self.awaited = {}
        self.renewed = False

    def regroup(self, members: set[bytes]) -> None:
        """From now on these are the members; how far others had come is forgotten."""
        self.members = members
        for key, numbers in list(self.reached.items()):
            if kept := {each: number for each, number in numbers.items() if each[:MEMBER_BYTES] in members}:
                self.reached[key] = kept
            else:
                del self.reached[key]

    def implausible(self, news: Numbers) -> str:
        """Why these numbers cannot be; empty when they can."""
        for key, numbers in news.items():
            reached = self.reached.get(key, {})
            for publisher, number in numbers.items():
                if number - reached.get(publisher, number) > LARGEST_JUMP:
                    return f"number {number} on {key} after {reached[publisher]}"
        return ""


def merge(into: Numbers, news: Numbers) -> None:
    """Add ``news`` to ``into``; a number never falls."""
    for key, numbers in news.items():
        known = into.setdefault(key, {})
        for publisher, number in numbers.items():
            if number > known.get(publisher, -1):
                known[publisher] = number
