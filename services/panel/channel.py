"""What a page may follow: a channel has a version, and tells what has changed since one."""

from __future__ import annotations

from typing import Protocol

import msgspec


class Channel(Protocol):
    """One kind of news. The hub opens it when the first page wants it, and closes it after the last."""

    @property
    def period(self) -> float:
        """Wall time between two tellings at least [s]."""
        ...

    @property
    def streams(self) -> bool:
        """Whether each telling matters, or the newest alone."""
        ...

    @property
    def version(self) -> int:
        """Grows with every change."""
        ...

    def follow(self, wanted: bool) -> None:
        """Somebody wants it, or nobody does."""
        ...

    def turn(self, now: float) -> None:
        """Take in what has come; ``now`` is wall time [s]. Called while it is wanted."""
        ...

    def news(self, since: int) -> str | None:
        """What a page that knows the version ``since`` (-1 for nothing) has to hear, as JSON."""
        ...


def as_json(kind: str, **content: object) -> str:
    """A message to a page."""
    return msgspec.json.encode({"k": kind, **content}).decode()
