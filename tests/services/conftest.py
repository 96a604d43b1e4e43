"""A network and a node on it for each test file that requests them."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from services.runtime.node import Node
from tests.harness.processes import Network


@pytest.fixture(scope="module")
def network(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Network]:
    with Network(tmp_path_factory.mktemp("network")) as made:
        yield made


@pytest.fixture(scope="module")
def node(network: Network) -> Iterator[Node]:
    with network.node() as made:
        yield made
