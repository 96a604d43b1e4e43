"""ROS 1 programs on turtlesim and with Gazebo's services and topics, and an arm controller with reconfigured gains."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import pytest

from tests.ros1.script_fleets import (
    NOTHING,
    Jobs,
    Runs,
    assert_began,
    assert_said,
    assert_same,
    lockstep_runs,
    run_until_said,
    side_by_side,
)

SAID = {
    "gazebo": {
        "model_state": [
            "ball True at 3.0",
            "set True, now 1.5",
            "nobody: False",
            "by topic 1.9",
        ],
        "goal_box": ["there True", "deleted True", "there True", "deleted True", "gone True"],
        "true_odom": ["published True, links burger"],
        "arm_exercise": ["step reached 30", "swings from -20 to 20"],
    },
    "turtles": {
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
    },
    "resets": {
        "environment": [
            "episode 0: 360 rays, drove True, done False",
            "episode 1: 360 rays, drove True, done False",
        ],
    },
}
"""Expected output of each fleet's programs."""
BEGUN = {
    "gazebo": {"arm_exercise": SAID["gazebo"]["arm_exercise"][:1]},
    "turtles": {"mover": SAID["turtles"]["mover"]},
}
"""Output compared by first words in real time, where the motion of an arm or a turtle also depends on the machine's
delays; in lockstep only on the program. One step shows that the arm moves.
"""
REAL = {
    fleet: {name: lines for name, lines in said.items() if name not in BEGUN.get(fleet, {})}
    for fleet, said in SAID.items()
}
LOCKSTEP_S = {"gazebo": 9.5, "turtles": 6, "resets": 4}


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Runs]:
    folder = tmp_path_factory.mktemp("gazebo")
    real: Jobs = {
        f"{fleet} real": partial(run_until_said, fleet, folder / f"{fleet}0", said, begun=BEGUN.get(fleet, NOTHING))
        for fleet, said in REAL.items()
    }
    with side_by_side(real | lockstep_runs(folder, LOCKSTEP_S, LOCKSTEP_S)) as runs:
        yield runs


@pytest.mark.timeout(420)
def test_turtles_follow_programs_in_real_time(runs: Runs) -> None:
    run = runs["turtles real"].result()
    assert_said(run, REAL["turtles"])
    assert_began(run, BEGUN["turtles"])


@pytest.mark.timeout(420)
def test_gazebos_names_work_in_real_time(runs: Runs) -> None:
    run = runs["gazebo real"].result()
    assert_said(run, REAL["gazebo"])
    assert_began(run, BEGUN["gazebo"])
    assert_said(runs["resets real"].result(), REAL["resets"])


@pytest.mark.timeout(420)
def test_turtles_follow_programs_in_lockstep_twice(runs: Runs) -> None:
    first = runs["turtles 1"].result()
    assert_said(first, SAID["turtles"])
    assert_same(first, runs["turtles 2"].result(), list(SAID["turtles"]))


@pytest.mark.timeout(420)
def test_gazebos_names_work_in_lockstep_twice(runs: Runs) -> None:
    for fleet in ("gazebo", "resets"):
        first, second = (runs[f"{fleet} {number}"].result() for number in (1, 2))
        assert_said(first, SAID[fleet])
        assert_said(second, SAID[fleet])
        assert_same(first, second, list(SAID[fleet]))
        if (arm := first.report["robots"].get("arm")) is not None:
            assert arm == second.report["robots"]["arm"]
            assert arm["step_final_deg"] == pytest.approx(29.7, abs=0.2), "measured by the reference's topic"
            assert 0.1 < arm["step_rise_s"] < 0.2
            assert 0.0 < arm["tracking_rms_deg"] < 1.0
            assert 10.0 < arm["effort_rms_nm"] < arm["effort_max_nm"] <= 200.0
