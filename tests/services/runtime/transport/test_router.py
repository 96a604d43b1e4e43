"""A router in a process of its own: how it forwards messages, and what clients that leave cannot do to it."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path

import pytest
import zenoh

from services.runtime.transport.zenoh import open_session
from services.runtime.transport.zenoh_config import configuration
from tests.harness.processes import Network
from tests.harness.waiting import wait_until

WITHIN_S = 60.0
KEYS = [f"flood/{number}" for number in range(8)]
CLIENTS = 4
TIMES = 60
"""How often each comes and leaves. Routers whose rule for batches named the keys ``**`` ended after 100 to 1000 times
beside busy processes."""


@pytest.fixture
def network(tmp_path: Path) -> Iterator[Network]:
    with Network(tmp_path) as made:
        yield made


def client(network: Network) -> zenoh.Session:
    return open_session(configuration("star", (network.endpoint,)))


def test_all_messages_are_forwarded_in_batches(network: Network) -> None:
    """Also those that their publisher sends one by one."""
    with client(network) as one, client(network) as two:
        subscriber = two.declare_subscriber("command")
        publisher = one.declare_publisher("command", express=True)
        received: list[zenoh.Sample] = []

        def arrived() -> bool:
            publisher.put(b"x")
            received.extend(iter(subscriber.try_recv, None))
            return bool(received)

        wait_until(arrived, WITHIN_S, "a command")
        assert not any(each.express for each in received)


def test_clients_that_leave_while_messages_flow_to_them_do_not_end_it(network: Network) -> None:
    """They publish on the messages' keys themselves, so that each link has a number for each key."""
    done = threading.Event()

    def flood() -> None:
        with client(network) as session:
            publishers = [session.declare_publisher(key) for key in KEYS]
            while not done.wait(0.0002):
                for each in publishers * 10:
                    each.put(bytes(40))

    def come_and_leave() -> int:
        """Return how often it worked."""
        for count in range(TIMES):
            arrived = threading.Event()
            try:
                session = client(network)
            except zenoh.ZError:
                return count
            with session:
                publishers = [session.declare_publisher(key) for key in KEYS]
                subscribers = [session.declare_subscriber(key, lambda _, a=arrived: a.set()) for key in KEYS]
                assert arrived.wait(WITHIN_S), f"no message for {len(publishers)} of {len(subscribers)} keys"
        return TIMES

    with ThreadPoolExecutor(CLIENTS + 1) as threads:
        flooding = threads.submit(flood)
        coming = [threads.submit(come_and_leave) for _ in range(CLIENTS)]
        wait(coming)
        done.set()
    flooding.result()
    counts = [each.result() for each in coming]
    assert network.router.status is None, network.router.text
    assert counts == [TIMES] * CLIENTS
