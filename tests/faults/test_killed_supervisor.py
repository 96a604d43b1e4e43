"""Fault 7: the supervisor is killed; no process of its fleet survives, and the next fleet starts at once."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults.fleet_files import FAMILY
from tests.faults.supervised_fleet import START_S, WITHIN_S, SupervisedFleet
from tests.harness.waiting import wait_until

NODES = ("router", "params", "sim", "grader", "parent", "tb3_0/waypoint")
FAMILY_SIZE = len(NODES) + 4
"""Number of processes: the nodes', a child of one of them, the supervisor, its reaper and its forking process."""


@pytest.mark.usefixtures("only_fleet")
def test_all_are_gone_and_up_works_again_on_the_same_port(tmp_path: Path) -> None:
    with SupervisedFleet(FAMILY, 1, tmp_path / "first") as fleet:
        fleet.wait_ready(*NODES, within=START_S)
        fleet.wait_full_speed("tb3_0")
        fleet.wait(lambda: len(fleet.note_descendants()) == FAMILY_SIZE, "the whole family")
        assert any("time.sleep(1000)" in " ".join(each.cmdline()) for each in fleet.descendants)
        assert fleet.supervisor.kill() == -9
        wait_until(lambda: fleet.survivors() == [], WITHIN_S, "everybody to be gone")

        with SupervisedFleet(FAMILY, 1, tmp_path / "second", fleet.port) as again:
            again.wait_ready(*NODES, within=START_S)
            again.wait_full_speed("tb3_0")
            again.wait(lambda: all(again.recorder.alive(f"/{name}") for name in NODES), "the tokens of all")
            assert {name: len(again.recorder.sessions[f"/{name}"]) for name in NODES} == dict.fromkeys(NODES, 1)
            assert all(each.restarts == 0 for each in again.recorder.processes.values())
            assert fleet.survivors() == []
