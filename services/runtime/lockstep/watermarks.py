"""Watermarks of lockstep: the last admitted sample of each publisher."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from services.runtime.transport.wire import MEMBER_BYTES

MAX_JUMP = 1 << 20
"""Maximum samples of a publisher between two ticks; a number beyond that is forged."""

Publisher = Annotated[bytes, Meta(min_length=16, max_length=16)]
Numbers = dict[str, dict[Publisher, Annotated[int, Meta(ge=0, le=1 << 62)]]]
"""The last sample numbers by key and publisher."""


class Watermarks:
    """The last admitted number of each publisher of a lockstep member, by key.

    ``lost_members`` are the members dropped since the caller last cleared this set. ``epoch_changed`` means that
    simulation time was reset: all samples sent before have been reported. ``skipped`` has the last numbers sent before
    this member subscribed to their keys.
    """

    def __init__(self) -> None:
        self.members: set[bytes] = set()
        self.lost_members: set[bytes] = set()
        self.epoch_changed = False
        self.admitted_upto: Numbers = {}
        self.required: Numbers = {}
        self.skipped: Numbers = {}

    def advance(self, news: Numbers, announced: Numbers | None = None) -> None:
        """Admit all samples up to these numbers; those in ``news`` are also required, until ``clear_required``.

        ``announced`` were sent before the subscribers were sure to receive them: they are admitted if they arrive.
        """
        if announced:
            merge_numbers(self.admitted_upto, announced)
        merge_numbers(self.admitted_upto, news)
        merge_numbers(self.required, news)

    def clear_required(self) -> None:
        """Clear the required numbers, which were received or given up, and ``epoch_changed``."""
        self.required = {}
        self.epoch_changed = False

    def regroup(self, members: set[bytes]) -> None:
        """Set the members; drops the admitted numbers of all others."""
        self.members = members
        for key, numbers in list(self.admitted_upto.items()):
            if kept := {each: number for each, number in numbers.items() if each[:MEMBER_BYTES] in members}:
                self.admitted_upto[key] = kept
            else:
                del self.admitted_upto[key]

    def implausible(self, news: Numbers) -> str:
        """Return why these numbers are implausible; empty if they are not."""
        for key, numbers in news.items():
            reached = self.admitted_upto.get(key, {})
            for publisher, number in numbers.items():
                if number - reached.get(publisher, number) > MAX_JUMP:
                    return f"number {number} on {key} after {reached[publisher]}"
        return ""


def merge_numbers(into: Numbers, news: Numbers) -> None:
    """Merge ``news`` into ``into``, keeping the higher number of each publisher."""
    for key, numbers in news.items():
        known = into.setdefault(key, {})
        for publisher, number in numbers.items():
            if number > known.get(publisher, -1):
                known[publisher] = number
