"""A ROS 1 program's action client with a controller's action server."""

from __future__ import annotations

from pathlib import Path

from tests.ros1.script_fleets import assert_said, run_scripts


def test_a_trajectory_controller_is_moved_by_its_action(tmp_path: Path) -> None:
    run = run_scripts("arm", tmp_path, "lockstep")
    wanted = [
        "server True",
        "reached 3, code 0",
        "cancelled 2, feedback True",
        "joints ['bear_link']",
        "rejected 5: unknown joint 'elbow' (the controller's: bear_link)",
        "replaced 3 by 2",
    ]
    assert_said(run, {"arm/move_arm": wanted})
