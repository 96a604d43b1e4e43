"""How far lockstep lets each publisher through."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from services.runtime.transport.wire import MEMBER_BYTES

MAX_JUMP = 1 << 20
"""Samples that a publisher may send between two ticks; a number beyond that is forged."""

Publisher = Annotated[bytes, Meta(min_length=16, max_length=16)]
Numbers = dict[str, dict[Publisher, Annotated[int, Meta(ge=0, le=1 << 62)]]]
"""The last sample numbers by key and publisher."""


class Watermarks:
    """How far each publisher of a lockstep member has been let through: its last admitted number, by key.

    ``died`` are the members that lockstep no longer waits for because they are gone, until someone takes note.
    ``renewed`` tells that simulation time began anew: all that was sent before has been told by now.
    """

    def __init__(self) -> None:
        self.members: set[bytes] = set()
        self.lost_members: set[bytes] = set()
        self.epoch_changed = False
        self.admitted_upto: Numbers = {}
        self.required: Numbers = {}

    def advance(self, news: Numbers, known: Numbers | None = None) -> None:
        """Let everything through that was sent up to these numbers; what is in ``news`` is also waited for,
        until ``settle``.

        ``known`` was sent before its readers were certain to listen: it is let through where it came.
        """
        if known:
            merge_numbers(self.admitted_upto, known)
        merge_numbers(self.admitted_upto, news)
        merge_numbers(self.required, news)

    def clear_required(self) -> None:
        """What was awaited has been taken."""
        self.required = {}
        self.epoch_changed = False

    def regroup(self, members: set[bytes]) -> None:
        """From now on these are the members; how far others had come is forgotten."""
        self.members = members
        for key, numbers in list(self.admitted_upto.items()):
            if kept := {each: number for each, number in numbers.items() if each[:MEMBER_BYTES] in members}:
                self.admitted_upto[key] = kept
            else:
                del self.admitted_upto[key]

    def implausible(self, news: Numbers) -> str:
        """Why these numbers cannot be; empty when they can."""
        for key, numbers in news.items():
            reached = self.admitted_upto.get(key, {})
            for publisher, number in numbers.items():
                if number - reached.get(publisher, number) > MAX_JUMP:
                    return f"number {number} on {key} after {reached[publisher]}"
        return ""


def merge_numbers(into: Numbers, news: Numbers) -> None:
    """Add ``news`` to ``into``; a number never falls."""
    for key, numbers in news.items():
        known = into.setdefault(key, {})
        for publisher, number in numbers.items():
            if number > known.get(publisher, -1):
                known[publisher] = number
