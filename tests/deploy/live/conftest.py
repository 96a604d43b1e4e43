"""An idle fleet for the tests of the topic commands, which run last in this folder so that it disturbs no others."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.harness.background_fleet import BackgroundFleet, background_fleet


@pytest.fixture(scope="package")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BackgroundFleet]:
    with background_fleet(tmp_path_factory.mktemp("idle")) as made:
        yield made
