"""A bus without a network: the children of these tests append their heartbeats to a file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import msgspec

from deploy.supervisor.supervisor import ActionHandler, ProcessAction
from messages.elea import FleetState, Health
from services.runtime.errors import BadInput


class FakeBus:
    """Reads heartbeats from ``folder``/beats, one JSON object per line; ``mute`` names nodes whose heartbeats are lost.

    ``answers_router``: whether the router answers, so that the network works otherwise.
    """

    def __init__(self, folder: Path) -> None:
        self._path, self._offset = folder / "beats", 0
        self.published: list[FleetState] = []
        self.requests: list[tuple[ProcessAction, str]] = []
        self.answers: list[str] = []
        self.mute: set[str] = set()
        self.flooded = self.answers_router = False
        self.delay_s = 0.0

    def heartbeats(self) -> Sequence[Health]:
        if not self._path.exists():
            return []
        with self._path.open("rb") as file:
            file.seek(self._offset)
            *lines, rest = file.read().split(b"\n")
            self._offset = file.tell() - len(rest)
        beats = [msgspec.json.decode(line, type=Health) for line in lines]
        return [each for each in beats if each.node not in self.mute]

    def router_answers(self) -> bool:
        return self.answers_router

    def publish(self, state: FleetState) -> None:
        self.published.append(state)

    def answer_requests(self, handle_action: ActionHandler) -> bool:
        while self.requests:
            try:
                self.answers.append(handle_action(*self.requests.pop(0)))
            except BadInput as error:
                self.answers.append(f"refused: {error}")
        return False
