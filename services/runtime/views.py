"""How a loop sees its inputs: the newest message, or every one, as they stood at the start of the tick."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from messages.base import Message, counted
from messages.std import Header
from messages.topics import Quality
from services.runtime.inputs import CAPACITY, Input
from services.runtime.network.wire import Origin

M = TypeVar("M", bound=Message)


class Latest(Generic[M]):
    """The newest message of a topic, as it stood at the start of the tick."""

    def __init__(self, source: Input[M], now: Callable[[], int]) -> None:
        self._source, self._now = source, now
        self.latched = source.topic.quality is Quality.LATCHED
        self.value: M | None = None
        self.origin: Origin | None = None
        self._stamp = 0

    def refresh(self) -> None:
        """Follow the input's last batch."""
        if self._source.batch:
            self.value, self.origin = self._source.batch[-1]
            header = getattr(self.value, "header", None)
            self._stamp = header.stamp.ns if isinstance(header, Header) else self._now()

    def clear(self) -> None:
        """Forget the value."""
        self.value = self.origin = None

    @property
    def age(self) -> float:
        """Seconds of simulation time since the message's stamp (its arrival, when it has none); inf without one."""
        return (self._now() - self._stamp) / 1e9 if self.value is not None else float("inf")

    def fresh(self, seconds: float) -> M | None:
        """The value, unless it is older than ``seconds`` of simulation time."""
        return self.value if self.value is not None and self.age <= seconds else None


class Stream(Generic[M]):
    """Every message of a topic, in order."""

    def __init__(self, source: Input[M]) -> None:
        self._source = source
        self.latched = source.topic.quality is Quality.LATCHED
        self._taken: list[M] = []

    def refresh(self) -> None:
        """Add the input's last batch to what was not taken yet."""
        self._taken += [message for message, _ in self._source.batch]
        excess = len(self._taken) - CAPACITY
        if excess > 0:
            self._source.lost = counted(self._source.lost, excess)
            del self._taken[:excess]

    def clear(self) -> None:
        """Forget what was not taken."""
        self._taken = []

    def take(self) -> list[M]:
        """What came since the last call, oldest first."""
        taken, self._taken = self._taken, []
        return taken
