"""An in-memory network and a manual clock."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from services.runtime.transport.api import Transport
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.runtime.transport.unix_sockets import router_endpoint
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import configuration
from tests.harness.memory_node import ManualClock
from tests.harness.ports import free_port


@pytest.fixture
def bus() -> MemoryBus:
    return MemoryBus()


@pytest.fixture
def clock(bus: MemoryBus) -> ManualClock:
    return ManualClock(bus)


@pytest.fixture(params=["memory", "zenoh"])
def connect(request: pytest.FixtureRequest) -> Iterator[Callable[[], Transport]]:
    with ExitStack() as stack:
        if request.param == "memory":
            bus = MemoryBus()
            yield lambda: MemoryTransport(bus)
            return
        router = router_endpoint(free_port())
        stack.enter_context(ZenohTransport(configuration("router", listen=(router,), reliable=True)))
        # Names are unique here: no node has to wait until it has discovered others of its name.
        yield lambda: ZenohTransport(configuration("direct", (router,), reliable=True), settle_s=0.0)
