"""Runs the same tests on every transport: in memory, over Zenoh directly, and over Zenoh through the router.

The links have the leases of lockstep: with those of 2 s, a process that stands still for longer loses messages.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from services.runtime.transport.api import Transport
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from services.runtime.transport.unix_sockets import router_endpoint
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import Role, configuration
from tests.harness.ports import free_port

Connect = Callable[[], Transport]


@pytest.fixture(params=["memory", "direct", "star"])
def connect(request: pytest.FixtureRequest) -> Iterator[Connect]:
    """A function that opens another connection to the same network."""
    with ExitStack() as stack:
        if request.param == "memory":
            bus = MemoryBus()
            yield lambda: stack.enter_context(MemoryTransport(bus))
            return
        router = router_endpoint(free_port())
        stack.enter_context(ZenohTransport(configuration("router", listen=(router,), reliable=True)))
        role: Role = request.param
        yield lambda: stack.enter_context(ZenohTransport(configuration(role, (router,), reliable=True)))
