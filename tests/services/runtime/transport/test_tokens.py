"""Liveliness tokens on every transport: their changes are reported, and large numbers are seen completely."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from services.runtime.errors import TryAgain
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import configuration
from tests.harness.processes import Network
from tests.harness.stopping import stop_process
from tests.harness.waiting import wait_until
from tests.services.runtime.transport.conftest import Connect


def test_tokens_come_and_go(connect: Connect) -> None:
    watcher, other = connect(), connect()
    early = other.declare_token("@elea/x/early")
    wait_until(lambda: watcher.tokens("@elea/*/*") == ["@elea/x/early"])
    watch = watcher.watch("@elea/*/*")
    events: list[tuple[str, bool]] = []

    def seen(count: int) -> Callable[[], bool]:
        def probe() -> bool:
            while (event := watch.poll()) is not None:
                events.append((event.key, event.alive))
            return len(events) >= count

        return probe

    wait_until(seen(1))
    late = other.declare_token("@elea/x/late")
    wait_until(seen(2))
    watch.refresh()  # known tokens aren't reported again
    early.close()
    wait_until(seen(3))
    other.close()
    wait_until(seen(4))
    assert events == [
        ("@elea/x/early", True),
        ("@elea/x/late", True),
        ("@elea/x/early", False),
        ("@elea/x/late", False),
    ]
    assert late is not None


def test_a_crowd_of_tokens_is_seen_whole_by_everyone(connect: Connect) -> None:
    """Eight connections with 70 tokens each, seen by a ninth: more than Zenoh's own reply queue holds."""
    crowd = [connect() for _ in range(8)]
    kept = [each.declare_token(f"@elea/{number}/{token}") for number, each in enumerate(crowd) for token in range(70)]
    newcomer = connect()
    mine = newcomer.declare_token("@elea/newcomer/0")
    for each in (*crowd, newcomer):
        wait_until(lambda each=each: len(each.tokens("@elea/*/*")) == len(kept) + 1, what="all tokens")
    for each in (*crowd, newcomer):
        assert [len(each.tokens("@elea/*/*", 60.0)) for _ in range(10)] == [len(kept) + 1] * 10
    assert len(newcomer.tokens("@elea/3/*", 60.0)) == 70
    crowd[3].close()
    wait_until(lambda: not newcomer.tokens("@elea/3/*"), what="the end of them")
    mine.close()
    wait_until(lambda: not crowd[0].tokens("@elea/newcomer/*"), what="the end of one")


def test_a_network_that_does_not_answer_is_told_from_one_without_tokens(tmp_path: Path) -> None:
    with (
        Network(tmp_path) as network,
        ZenohTransport(configuration("star", (network.endpoint,), reliable=True)) as transport,
    ):
        assert transport.all_tokens("@elea/*/*", 60.0) == []
        stop_process(network.router.pid)
        try:
            assert transport.tokens("@elea/*/*", 0.1) == []
            with pytest.raises(TryAgain, match=r"did not list its nodes within 0\.1 s"):
                transport.all_tokens("@elea/*/*", 0.1)
        finally:
            os.kill(network.router.pid, signal.SIGCONT)

        def answers() -> bool:
            with suppress(TryAgain):  # the link may have been closed meanwhile: the lease of the router is 2 s
                return transport.all_tokens("@elea/*/*", 20.0) == []
            return False

        wait_until(answers, 20.0, "an answer without tokens")
