"""Fault 1: a controller is killed at full speed."""

from __future__ import annotations

from tests.faults.supervised_fleet import SupervisedFleet
from tests.harness.robot_recorder import FULL_SPEED, LATEST_STOP_S


def test_the_robot_stops_and_its_controller_comes_back(driving: SupervisedFleet) -> None:
    robot, before = driving.robot("tb3_0"), driving.process("tb3_0/waypoint")
    driving.wait_full_speed("tb3_0")
    killed = driving.kill("tb3_0/waypoint")
    driving.wait(lambda: not driving.recorder.alive("/tb3_0/waypoint"), "its token to go")
    driving.wait(lambda: robot.first_stop_after(killed), "a robot that stands")
    assert robot.seconds_to_stop(killed) <= LATEST_STOP_S

    born = driving.wait_restarted(before)
    driving.wait_full_speed("tb3_0")
    assert robot.uncommanded_motion(killed, born) == []
    assert "killed by signal 9" in driving.log("tb3_0/waypoint")
    for bystander in ("tb3_1", "tb3_2", "tb3_3"):
        sights = driving.robot(bystander).samples
        assert all(each.speed > FULL_SPEED for each in sights if each.sent > killed)
