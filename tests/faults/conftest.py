"""Fleets that several tests share, one at a time; a test that passes leaves its fleet sound."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from tests.faults import fleet_files
from tests.faults.supervised_fleet import START_S, SupervisedFleet


class FleetSlot:
    """Where one fleet drives; it gives way when a test asks for another."""

    def __init__(self, folders: pytest.TempPathFactory, session: pytest.Session) -> None:
        self._folders, self._session = folders, session
        self._failed = 0
        self._stack = ExitStack()
        self._fleet: SupervisedFleet | None = None
        self._name = ""

    def fleet(self, name: str, description: str, robots: int) -> SupervisedFleet:
        """The fleet of this name, as it is or newly started if a test has failed with it."""
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
    """Four robots at full speed, three of them by controllers that hang when told."""
    fleet = fleet_slot.fleet("driving", fleet_files.DRIVING, 4)
    fleet.wait_ready(within=START_S)
    fleet.wait_full_speed(*fleet.recorder.robots)
    return fleet


@pytest.fixture
def star(fleet_slot: FleetSlot) -> SupervisedFleet:
    """Everything through the router; a robot at full speed, and one that waits for commands of the test."""
    fleet = fleet_slot.fleet("star", fleet_files.STAR, 2)
    fleet.wait_ready(within=START_S)
    fleet.wait_full_speed("tb3_0")
    return fleet


@pytest.fixture
def broken(fleet_slot: FleetSlot) -> SupervisedFleet:
    """A robot, services that raise when told, and one that ends at once."""
    fleet = fleet_slot.fleet("broken", fleet_files.BROKEN, 1)
    fleet.wait_ready("tb3_0/waypoint", within=START_S)
    return fleet


@pytest.fixture
def only_fleet(fleet_slot: FleetSlot) -> None:
    """No other fleet runs beside the test's own."""
    fleet_slot.stop()
