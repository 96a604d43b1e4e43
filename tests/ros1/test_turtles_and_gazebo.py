"""Programs of ROS 1 on turtlesim, with Gazebo's services and topics, and an arm's law whose gains are reconfigured."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tests.ros1.script_fleets import assert_said, assert_same, run_scripts

TURTLES = {
    "mover": [
        "from 5.54 5.54",
        "moved 2.0, turned 1.6",
        "slots ['x', 'y', 'theta', 'linear_velocity', 'angular_velocity']",
    ],
    "spiral": [
        "cleaner",
        "wide True",
        "at 1.0 2.0 0.5",
        "then 2.0 2.0 0.0",
        "no second one",
        "red 69",
    ],
    "follower": ["came nearer: True"],
}
GAZEBO = {
    "model_state": [
        "ball True at 3.0",
        "set True, now 1.5",
        "nobody: False",
        "by topic 1.9",
    ],
    "goal_box": ["there True", "deleted True", "there True", "deleted True", "gone True"],
    "true_odom": ["published True, links burger"],
    "arm_exercise": ["step reached 30", "swings from -20 to 20"],
}
RESETS = {
    "environment": [
        "episode 0: 360 rays, drove True, done False",
        "episode 1: 360 rays, drove True, done False",
    ],
}


def test_turtles_follow_programs_in_real_time(tmp_path: Path) -> None:
    assert_said(run_scripts("turtles", tmp_path, "real"), TURTLES)


def test_turtles_follow_programs_in_lockstep_twice(tmp_path: Path) -> None:
    first = run_scripts("turtles", tmp_path / "first", "lockstep", "--duration", "12")
    assert_said(first, TURTLES)
    assert_same(first, run_scripts("turtles", tmp_path / "second", "lockstep", "--duration", "12"), list(TURTLES))


@pytest.mark.timeout(420)
def test_gazebos_names_work_in_real_time(tmp_path: Path) -> None:
    with ThreadPoolExecutor(2) as pool:
        run, resets = pool.map(lambda fleet: run_scripts(fleet, tmp_path / fleet, "real"), ("gazebo", "resets"))
    assert_said(run, {name: lines for name, lines in GAZEBO.items() if name != "arm_exercise"})
    # Where the arm is follows from the delays of the machine; in lockstep from the program alone.
    said = [each.partition(" ")[0] for each in run.lines("arm_exercise")]
    assert [each for each in said if each in ("step", "swings")] == ["step", "swings"]
    assert_said(resets, RESETS)


@pytest.mark.timeout(420)
def test_gazebos_names_work_in_lockstep_twice(tmp_path: Path) -> None:
    for fleet, said, seconds in (("gazebo", GAZEBO, "13"), ("resets", RESETS, "5")):
        first = run_scripts(fleet, tmp_path / f"{fleet}1", "lockstep", "--duration", seconds)
        assert_said(first, said)
        second = run_scripts(fleet, tmp_path / f"{fleet}2", "lockstep", "--duration", seconds)
        assert_said(second, said)
        assert_same(first, second, list(said))
        if (arm := first.report["robots"].get("arm")) is not None:
            assert arm == second.report["robots"]["arm"]
            assert arm["step_final_deg"] == pytest.approx(29.7, abs=0.2), "measured by the reference's topic"
            assert 0.1 < arm["step_rise_s"] < 0.2
            assert 0.0 < arm["tracking_rms_deg"] < 1.0
            assert 10.0 < arm["effort_rms_nm"] < arm["effort_max_nm"] <= 200.0
