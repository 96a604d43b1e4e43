"""A fake parameter service whose replies and updates the test determines."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any, Self

from messages.parameters import Announcement, Origin, Parameter, ParameterValues, SetParameters, UndoParameters
from messages.requests import PARAMS_ANNOUNCE, PARAMS_SET, PARAMS_UNDO
from messages.topics import UPDATES
from services.runtime.transport.memory import MemoryBus
from tests.harness.memory_node import memory_node


def parameter_values(name: str, values: dict[str, Any], revision: int = 1, origin: Origin = "saved") -> ParameterValues:
    """Return effective values as the parameter service publishes them."""
    made = tuple(Parameter(name=each, value=value, origin=origin) for each, value in values.items())
    return ParameterValues(set=name, revision=revision, values=made)


class FakeParameterService:
    """The node ``/params`` in a thread of its own; ``answer`` computes the reply to an announcement."""

    def __init__(self, bus: MemoryBus, answer: Callable[[Announcement], ParameterValues] | None = None) -> None:
        self.announcements: list[Announcement] = []
        self.set_requests: list[SetParameters] = []
        self.undo_requests: list[UndoParameters] = []
        self._answer = answer or (lambda asked: parameter_values(asked.set, {}, 0))
        self._revision = 1
        self._node = memory_node(bus, "params")
        self._jobs: list[Callable[[], object]] = []
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> Self:
        self._node.__enter__()
        self._node.serve(PARAMS_ANNOUNCE, self._announce)
        self._node.serve(PARAMS_SET, self._set)
        self._node.serve(PARAMS_UNDO, self._undo)
        self._thread.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._ended.set()
        self._thread.join(60)
        self._node.transport.close()

    def publish(self, name: str, values: dict[str, Any], origin: Origin = "saved") -> None:
        """Publish a set's values, as after a change; return once they are sent."""
        self._revision += 1
        news = parameter_values(name, values, self._revision, origin)
        done = threading.Event()

        def job() -> None:
            self._node.advertise(UPDATES, f"{name}/parameter_updates").publish(news)
            done.set()

        self._jobs.append(job)
        assert done.wait(60)

    def _announce(self, asked: Announcement) -> ParameterValues:
        self.announcements.append(asked)
        return self._answer(asked)

    def _set(self, asked: SetParameters) -> ParameterValues:
        self.set_requests.append(asked)
        self._revision += 1
        return parameter_values(asked.set, {each.name: each.value for each in asked.values}, self._revision, "run")

    def _undo(self, asked: UndoParameters) -> ParameterValues:
        self.undo_requests.append(asked)
        return parameter_values(asked.set, {}, self._revision)

    def _run(self) -> None:
        while not self._ended.is_set():
            self._node.spin_once()
            while self._jobs:
                self._jobs.pop(0)()
            time.sleep(0.001)
