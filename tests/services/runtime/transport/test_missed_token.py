"""A token that Zenoh never reported to its watcher is found by polling, and its end is reported as usual."""

from __future__ import annotations

from typing import Any

import zenoh

from services.runtime.transport.api import TokenEvent
from services.runtime.transport.zenoh import ZenohTokenWatch


class Change:
    """A sample as Zenoh passes it to a liveliness subscriber."""

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
