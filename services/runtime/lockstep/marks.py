"""How far lockstep lets each publisher through."""

from __future__ import annotations

Numbers = dict[str, dict[bytes, int]]
"""The last sample numbers by key and publisher."""


class Marks:
    """How far each publisher of a lockstep member has been let through: its last admitted number, by key.

    ``died`` are the members that lockstep no longer waits for because they are gone, until someone takes note.
    """

    def __init__(self) -> None:
        self.members: set[bytes] = set()
        self.died: set[bytes] = set()
        self.reached: dict[str, dict[bytes, int]] = {}
        self.awaited: dict[str, dict[bytes, int]] = {}

    def advance(self, news: Numbers, known: Numbers | None = None) -> None:
        """Let everything through that was sent up to these numbers; what is in ``news`` is also waited for,
        until ``settle``.

        ``known`` was sent before its readers were certain to listen: it is let through where it came.
        """
        merge(self.reached, known or {})
        merge(self.reached, news)
        merge(self.awaited, news)

    def settle(self) -> None:
        """What was awaited has been taken."""
        self.awaited = {}


def merge(into: Numbers, news: Numbers) -> None:
    """Add ``news`` to ``into``."""
    for key, numbers in news.items():
        into.setdefault(key, {}).update(numbers)
