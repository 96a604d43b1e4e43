"""Fault 8, escalated: the fleet requires a process that can't start."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults.fleet_files import HOPELESS, UNFIT
from tests.faults.supervised_fleet import START_S, SupervisedFleet
from tests.harness.waiting import wait_until


@pytest.mark.usefixtures("only_fleet")
@pytest.mark.parametrize(
    ("description", "name", "said", "lives", "reason"),
    [
        (HOPELESS, "crash_at_once", "the lidar does not answer", 3, "exit status 1; restarted 2 times within 30 s"),
        (UNFIT, "bad_input", "the configuration is bad", 1, "exit status 2: the configuration is bad"),
    ],
)
def test_a_fleet_ends_with_what_it_cannot_do_without(
    tmp_path: Path, description: str, name: str, said: str, lives: int, reason: str
) -> None:
    with SupervisedFleet(description, 0, tmp_path, observed=False) as fleet:

        def ended() -> bool:
            fleet.note_descendants()
            return fleet.supervisor.status is not None

        wait_until(ended, START_S, "the fleet to end")
        assert fleet.supervisor.status == 1
        assert f"the fleet ended: {name} failed: {reason}" in fleet.supervisor.text
        own = [line for line in fleet.log(name).splitlines() if not line.startswith("---")]
        assert own.count(said) == lives
