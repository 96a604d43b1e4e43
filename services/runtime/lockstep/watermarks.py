"""Watermarks of lockstep: the last admitted sample of each publisher."""

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
    """The last admitted number of each publisher of a lockstep member, by key.

    ``died`` are the members dropped since the last time the caller cleared this set. ``epoch_changed`` means that
    simulation time was reset: all samples sent before have been reported. ``skipped`` are the numbers up to which
    samples were sent before this member read their keys.
    """

    def __init__(self) -> None:
        self.members: set[bytes] = set()
        self.lost_members: set[bytes] = set()
        self.epoch_changed = False
        self.admitted_upto: Numbers = {}
        self.required: Numbers = {}
        self.skipped: Numbers = {}

    def advance(self, news: Numbers, known: Numbers | None = None) -> None:
        """Admit all samples up to these numbers; those in ``news`` are also required, until ``clear_required``.

        ``known`` were sent before their subscribers were certain to receive them: they are admitted if they arrive.
        """
        if known:
            merge_numbers(self.admitted_upto, known)
        merge_numbers(self.admitted_upto, news)
        merge_numbers(self.required, news)

    def clear_required(self) -> None:
        """Forget the required numbers: they were received, or given up."""
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
