"""ROS 1 programs that drive robots by odometry, laser, transforms and time."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import pytest

from tests.harness.cases import case
from tests.ros1.script_fleets import (
    NOTHING,
    Jobs,
    Runs,
    ScriptRun,
    assert_began,
    assert_said,
    assert_same,
    lockstep_runs,
    run_until_said,
    side_by_side,
)

SAID = {
    "drive": {
        "tf_out_and_back": ["home True facing True"],
        "pose_printer": [
            "frames odom base_footprint, yaw 0",
            "imu True, joints ['wheel_left_joint', 'wheel_right_joint']",
            "0.0 36 tuple",
        ],
        "odom_square": ["Square completed!", "sides 4, home within 0.5 m True, logged True"],
        "once/publish_once": ["legs done"],
        "back/out_and_back": ["out and back", "Stopping the robot..."],
        "wall/wall_follower": ["states [0, 1, 2], beside the wall True"],
        "patrol/patrol_client": [
            "at 0.6 0.0: state 3",
            "at 0.6 0.5: state 3",
            "moved True",
            "control_msgs/FollowJointTrajectoryAction",
        ],
    },
    "tasks": {
        "lights/start_stop": ["changes 6"],
        "square/timed_square": ["square done", "Stop Drawing Squares"],
        "point/goto_point": ["arrived within True"],
        "wander/turtlebot_scan": ["turned True, kept True"],
        "wander/range_ahead": ["range ahead: 1 of 360", "nearest ahead: 1 tuple"],
        "heading/pid_heading": ["tracked True with rows True"],
        "mover/move_client": ["Done!", "moved 40 steps", "took 4 s"],
        "keys/key_script": ["keys sent"],
    },
    "flood": {"formation": ["1", "2", "3"]},
}
"""Expected output of each fleet's programs."""
SILENT = {
    "drive": ["patrol/patrol_server"],
    "tasks": ["keys/key_driver", "mover/move_service"],
    "flood": ["repeat"],
}
LOCKSTEP_S = {"drive": 15, "tasks": 12.5, "flood": 9.5}
FLOODED = {"drive": "", "flood": "tb3_1"}
"""The fleets that also run in real time, and the robot of each whose program never waits."""
REPEATED = "tasks"
"""The fleet that runs in lockstep twice."""
DRIVEN_M = {
    "solo": (0.55, 0.75),
    "lights": (1.2, 1.3),
    "square": (0.9, 1.0),
    "RosAria": (1.5, 1.9),
    "once": (0.57, 0.63),
    "back": (0.75, 0.83),
    "point": (0.95, 1.25),
    "wander": (0.5, 2.4),
    "wall": (0.4, 2.8),
    "heading": (0.0, 0.05),
    "mover": (0.55, 0.62),
    "keys": (0.6, 1.4),
    "tb3_0": (1.2, 1.8),
    "tb3_1": (0.9, 1.8),
    "patrol": (0.9, 1.4),
}
"""Path lengths [m] that follow from each program's speeds and times, from ground truth. In real time a busy machine
lengthens paths that a program drives by the clock; in lockstep time waits for the program.
"""
REPEATING = "tb3_1"
"""The robot whose program repeats the speeds of another: in real time it misses those during which it waits for a
processor.
"""


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Runs]:
    folder = tmp_path_factory.mktemp("drive")
    real: Jobs = {
        f"{fleet} real": partial(
            *(run_until_said, fleet, folder / f"{fleet}0", NOTHING, "--factor", "2"), begun=SAID[fleet], flooded=flooded
        )
        for fleet, flooded in FLOODED.items()
    }
    with side_by_side(real | lockstep_runs(folder, LOCKSTEP_S, {REPEATED})) as runs:
        yield runs


@pytest.mark.timeout(420)
def test_programs_drive_their_way_in_real_time(runs: Runs) -> None:
    for fleet in FLOODED:
        with case(fleet):
            run = runs[f"{fleet} real"].result()
            assert_began(run, SAID[fleet])
            assert_drove(run, 0.5, repeated=0.1)


@pytest.mark.timeout(420)
def test_in_lockstep_each_program_drives_its_way_and_the_same_way_twice(runs: Runs) -> None:
    for fleet, said in SAID.items():
        with case(fleet):
            run = runs[f"{fleet} 1"].result()
            assert_said(run, said)
            assert_drove(run)
            for robot, found in run.report["robots"].items():
                assert found["path_length_m"] <= DRIVEN_M[robot][1]
    assert_same(runs[f"{REPEATED} 1"].result(), runs[f"{REPEATED} 2"].result(), [*SAID[REPEATED]], SILENT[REPEATED])


def assert_drove(run: ScriptRun, share: float = 1.0, repeated: float = 1.0) -> None:
    """Assert that each robot drove at least ``share`` of its shortest path, REPEATING ``repeated`` of it, without
    collisions.
    """
    for robot, found in run.report["robots"].items():
        with case(robot):
            assert found["path_length_m"] >= (repeated if robot == REPEATING else share) * DRIVEN_M[robot][0]
            assert found["collisions"] == 0
