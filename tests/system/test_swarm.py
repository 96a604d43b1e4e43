"""A small swarm in MuJoCo: all arrive without contact, and sharing processes changes nothing."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from deploy.fleet_file import FLEETS
from tests.harness.command_line import CommandLine


def test_nine_arrive_without_contact_and_the_same_whoever_shares_a_process(tmp_path: Path) -> None:
    swarm = (FLEETS / "swarm.toml").read_text()
    assert "share = 25" in swarm
    terminal, reports = CommandLine(tmp_path), list[dict[str, Any]]()
    for share in ("share = 25", "share = 4"):
        fleet = tmp_path / f"{share[8:]}.toml"
        fleet.write_text(swarm.replace("share = 25", share))
        ended = terminal.run_fleet(str(fleet), tmp_path / f"run{share[8:]}", "--json", "--robots", "9")
        assert ended.status == 0, ended.err + ended.out
        reports.append(json.loads(ended.out))
    one, other = reports
    assert one["run"]["ended"] == "goals"
    assert one["run"]["messages_lost"] == 0
    assert len(one["robots"]) == 9
    for figures in one["robots"].values():
        assert (figures["points_reached"], figures["collisions"]) == (1, 0)
        assert figures["min_distance_m"] > 0.2
    assert one["run"]["trajectory_hash"] == other["run"]["trajectory_hash"]
