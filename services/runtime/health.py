"""The heartbeat: sent by the loop itself, so that a hung loop has none."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from typing import Any, Literal

from messages.elea import Health
from services.runtime.inputs import Input
from services.runtime.outputs import Output

PERIOD_S = 1.0
"""Wall time between two heartbeats. With half of it, a machine with eight busy processes on two cores made healthy
loops look hung."""

State = Literal["starting", "waiting", "running", "paused", "stopping"]


class Heart:
    """Beats when ``beat`` is called and a period has passed, or somebody begins to listen."""

    def __init__(self, node: str) -> None:
        self.state: State = "starting"
        self.note = ""
        self.ticks = 0
        self._node = node
        self._beats = 0
        self._due = 0.0
        self._wanted = False

    def beat(self, output: Output[Health], inputs: Sequence[Input[Any]], outputs: Sequence[Output[Any]]) -> None:
        """Publish the node's health if it is time."""
        now, wanted = time.monotonic(), output.wanted
        if now < self._due and wanted <= self._wanted:
            self._wanted = wanted
            return
        self._wanted = wanted
        self._due = now + PERIOD_S
        self._beats += 1
        output.publish(
            Health(
                node=self._node,
                pid=os.getpid(),
                beat=self._beats,
                state=self.state,
                note=self.note,
                ticks=self.ticks,
                inputs=tuple(each.health() for each in inputs),
                outputs=tuple(each.health() for each in outputs),
            )
        )

    def hurry(self) -> None:
        """Let the next beat come at once: the state has changed."""
        self._due = 0.0
