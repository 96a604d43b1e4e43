"""Fleets that several tests share, one at a time; a test that passes leaves its fleet intact."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from tests.faults import fleet_files
from tests.faults.supervised_fleet import START_S, SupervisedFleet


class FleetSlot:
    """Holds the running fleet; replaces it when a test requests another."""

    def __init__(self, folders: pytest.TempPathFactory, session: pytest.Session) -> None:
        self._folders, self._session = folders, session
        self._failed = 0
        self._stack = ExitStack()
        self._fleet: SupervisedFleet | None = None
        self._name = ""

    def fleet(self, name: str, description: str, robots: int) -> SupervisedFleet:
        """Return the fleet of this name, restarted if a test has failed since its last use."""
        failed, self._failed = self._failed, self._session.testsfailed
        if self._fleet is None or self._name != name or failed != self._failed:
            self.stop()
            folder = self._folders.mktemp(name)
            self._fleet, self._name = self._stack.enter_context(SupervisedFleet(description, robots, folder)), name
        return self._fleet

    def stop(self) -> None:
        """End the fleet."""
        self._fleet = None
        self._stack.close()


@pytest.fixture(scope="package")
def fleet_slot(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Iterator[FleetSlot]:
    fleet_slot = FleetSlot(tmp_path_factory, request.session)
    yield fleet_slot
    fleet_slot.stop()


@pytest.fixture
def driving(fleet_slot: FleetSlot) -> SupervisedFleet:
    """Four robots at full speed, three of them with controllers that hang on request."""
    fleet = fleet_slot.fleet("driving", fleet_files.DRIVING, 4)
    fleet.wait_ready(within=START_S)
    fleet.wait_full_speed(*fleet.recorder.robots)
    return fleet


@pytest.fixture
def star(fleet_slot: FleetSlot) -> SupervisedFleet:
    """A fleet with all traffic through the router: a robot at full speed, and one that the test commands."""
    fleet = fleet_slot.fleet("star", fleet_files.STAR, 2)
    fleet.wait_ready(within=START_S)
    fleet.wait_full_speed("tb3_0")
    return fleet


@pytest.fixture
def broken(fleet_slot: FleetSlot) -> SupervisedFleet:
    """A robot, services that raise on request, and one that exits at once."""
    fleet = fleet_slot.fleet("broken", fleet_files.BROKEN, 1)
    fleet.wait_ready("tb3_0/waypoint", within=START_S)
    return fleet


@pytest.fixture
def only_fleet(fleet_slot: FleetSlot) -> None:
    """Stop the shared fleet, so that only the test's own runs."""
    fleet_slot.stop()
