"""A script's publication while several threads, or a shutdown hook in the middle of a publish, use it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import pytest

from services.script.topics import TopicOutput

WITHIN_S = 60.0


class FakeThreads:
    def point(self, cost: float) -> None:
        pass


class FakeNode:
    def advertise(self, topic: object) -> object:
        return self


class FakeBus:
    """Notes what is sent and closed; ``meanwhile`` is called in the middle of the first publish."""

    def __init__(self) -> None:
        self.threads = FakeThreads()
        self.events: list[object] = []
        self.meanwhile: Callable[[], object] | None = None

    def publish(self, publisher: object, payload: bytes) -> None:
        if (meanwhile := self.meanwhile) is not None:
            self.meanwhile = None
            meanwhile()
        self.events.append(payload)

    def close_output(self, output: object, publisher: object) -> None:
        self.events.append("closed")


@pytest.fixture
def bus() -> FakeBus:
    return FakeBus()


@pytest.fixture
def output(bus: FakeBus) -> TopicOutput:
    made = TopicOutput("/cmd_vel", "geometry_msgs/Twist", False, bus)  # type: ignore[arg-type]
    made.bind(FakeNode())  # type: ignore[arg-type]
    return made


def run(work: Callable[..., object], *arguments: Any) -> threading.Thread:
    thread = threading.Thread(target=work, args=arguments, daemon=True)
    thread.start()
    return thread


def test_a_shutdown_hook_that_a_signal_runs_in_the_middle_of_a_publish_publishes(
    bus: FakeBus, output: TopicOutput
) -> None:
    bus.meanwhile = lambda: output.publish(b"stop")
    thread = run(output.publish, b"go")
    thread.join(WITHIN_S)
    assert not thread.is_alive()
    assert bus.events == [b"stop", b"go"]


def test_a_publication_closes_after_a_publish_of_another_thread(bus: FakeBus, output: TopicOutput) -> None:
    sending, go_on = threading.Event(), threading.Event()
    bus.meanwhile = lambda: (sending.set(), go_on.wait(WITHIN_S))
    publishing = run(output.publish, b"go")
    assert sending.wait(WITHIN_S)
    closing = run(output.close)
    closing.join(0.05)
    go_on.set()
    for thread in (publishing, closing):
        thread.join(WITHIN_S)
        assert not thread.is_alive()
    output.publish(b"too late")
    assert bus.events == [b"go", "closed"]
