"""A token of which Zenoh never told its watcher is found by looking, and its end is told like any other's."""

from __future__ import annotations

from typing import Any

import zenoh

from services.runtime.transport.api import TokenEvent
from services.runtime.transport.zenoh import ZenohTokenWatch


class Change:
    """What Zenoh hands to a watcher."""

    def __init__(self, key: str, kind: Any) -> None:
        self.key_expr, self.kind = key, kind


def test_it_is_found_and_its_end_is_told() -> None:
    there = ["a", "b"]
    watch = ZenohTokenWatch(lambda: there)
    watch.items.append(Change("a", zenoh.SampleKind.PUT))
    assert watch.poll() == TokenEvent("a", True)
    assert watch.poll() is None, "b was missed"
    watch.refresh()
    watch.items.append(Change("b", zenoh.SampleKind.PUT))
    watch.items.append(Change("b", zenoh.SampleKind.DELETE))
    assert list(iter(watch.poll, None)) == [TokenEvent("b", True), TokenEvent("b", False)]
