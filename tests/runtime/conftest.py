"""An in-memory network and a clock by hand."""

from __future__ import annotations

import pytest

from services.runtime.memory_transport import MemoryBus
from tests.runtime.bench import HandClock


@pytest.fixture
def bus() -> MemoryBus:
    return MemoryBus()


@pytest.fixture
def clock(bus: MemoryBus) -> HandClock:
    return HandClock(bus)
