"""Fault 8, escalated: what cannot start is what the fleet cannot do without."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults.fleet import START_S, Fleet
from tests.faults.fleets import HOPELESS
from tests.waiting import until


@pytest.mark.usefixtures("alone")
def test_a_fleet_ends_with_what_it_cannot_do_without(tmp_path: Path) -> None:
    with Fleet(HOPELESS, 0, tmp_path) as fleet:

        def ended() -> bool:
            fleet.count()
            return fleet.supervisor.status is not None

        until(ended, START_S, "the fleet to end")
        assert fleet.supervisor.status == 1
        assert "the fleet ended: crash_at_once failed" in fleet.supervisor.text
        assert fleet.left() == []
