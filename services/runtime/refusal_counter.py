"""What is counted of samples on a key that no input reads: those of lockstep, and the clock that paces a loop."""

from __future__ import annotations

from messages.elea import InputHealth

_REASON = 200
"""Characters of a reason that are kept."""


class RefusalCounter:
    """The counts of one such key, under ``name`` in the node's health; a beat lists it once something was refused."""

    lost = repeated = resynced = foreign = 0

    def __init__(self, name: str) -> None:
        self.name = name
        self.received = self.refused = 0
        self.reason = ""

    def reject(self, reason: str) -> None:
        """Count a sample as refused."""
        self.refused += 1
        self.reason = "".join(each if each.isprintable() else "?" for each in reason[:_REASON])

    def health(self) -> InputHealth:
        """The counts, as they are shown."""
        return InputHealth(topic=self.name, received=self.received, refused=self.refused, reason=self.reason)
