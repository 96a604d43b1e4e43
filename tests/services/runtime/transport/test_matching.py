"""Whether a publication has subscribers is known, also if one comes or leaves while the publication is declared."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
import zenoh

from services.runtime.transport.zenoh import ZenohPublisher, open_session
from services.runtime.transport.zenoh_config import configuration
from tests.harness.ports import free_port
from tests.harness.waiting import wait_until


class ChangingPublisher:
    """A publisher of Zenoh; ``change`` runs between Zenoh's answer to the first question for its status and its return.

    A thread that waits for a processor, or for Python's lock, receives the answer just as late.
    """

    def __init__(self, publisher: zenoh.Publisher, change: Callable[[], None]) -> None:
        self.put, self.declare_matching_listener = publisher.put, publisher.declare_matching_listener
        self._publisher, self._change = publisher, change

    @property
    def matching_status(self) -> zenoh.MatchingStatus:
        answer = self._publisher.matching_status
        self._change()
        return answer


@pytest.mark.parametrize("comes", [True, False])
def test_a_change_counts_that_is_reported_before_the_first_status_arrives(comes: bool) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with (
        open_session(configuration("router", listen=(endpoint,), reliable=True)),
        open_session(configuration("direct", (endpoint,), reliable=True)) as reader,
        open_session(configuration("direct", (endpoint,), reliable=True)) as writer,
    ):
        subscribers: list[zenoh.Subscriber[Any]] = [] if comes else [reader.declare_subscriber("a")]
        publisher = writer.declare_publisher("a")
        wait_until(lambda: publisher.matching_status.matching is not comes)
        reports: list[None] = []

        def change() -> None:
            earlier = len(reports)
            if comes:
                subscribers.append(reader.declare_subscriber("a"))
            else:
                subscribers.pop().undeclare()  # type: ignore[no-untyped-call]
            wait_until(lambda: len(reports) > earlier, 20.0, "a report of the change")

        made = ZenohPublisher(ChangingPublisher(publisher, change), lambda: reports.append(None))
        assert made.has_subscribers is comes
