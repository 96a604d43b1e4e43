"""An in-memory network and a clock by hand."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from services.runtime.network.memory_transport import MemoryBus, MemoryTransport
from services.runtime.network.sockets import router_endpoint
from services.runtime.network.transport import Transport
from services.runtime.network.zenoh_config import configuration
from services.runtime.network.zenoh_transport import ZenohTransport
from tests.ports import free_port
from tests.runtime.bench import HandClock


@pytest.fixture
def bus() -> MemoryBus:
    return MemoryBus()


@pytest.fixture
def clock(bus: MemoryBus) -> HandClock:
    return HandClock(bus)


@pytest.fixture(params=["memory", "zenoh"])
def connect(request: pytest.FixtureRequest) -> Iterator[Callable[[], Transport]]:
    with ExitStack() as stack:
        if request.param == "memory":
            bus = MemoryBus()
            yield lambda: MemoryTransport(bus)
            return
        router = router_endpoint(free_port())
        stack.enter_context(ZenohTransport(configuration("router", listen=(router,))))
        yield lambda: ZenohTransport(configuration("direct", (router,), reliable=True))
