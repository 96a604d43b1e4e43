"""Fault 3: a controller freezes and later continues; in test_hung_controller.py it is replaced instead."""

from __future__ import annotations

import signal

from messages.requests import SUPERVISOR_START, SUPERVISOR_STOP, Name
from tests.faults.supervised_fleet import SupervisedFleet, send_signal
from tests.harness.processes import start_service
from tests.harness.robot_recorder import LATEST_STOP_S, STANDSTILL_SPEED

NAME = "tb3_0/waypoint"


def test_a_short_freeze_stops_the_robot_until_a_fresh_command(driving: SupervisedFleet) -> None:
    """Less than the three heartbeats after which a controller would be replaced."""
    robot, before = driving.robot("tb3_0"), driving.process(NAME)
    driving.wait_full_speed("tb3_0")
    frozen = driving.send_signal(NAME, signal.SIGSTOP)
    driving.wait(lambda: robot.first_stop_after(frozen), "a robot that stands")
    assert driving.recorder.alive(f"/{NAME}")
    continued = driving.send_signal(NAME, signal.SIGCONT)
    assert robot.seconds_to_stop(frozen) <= LATEST_STOP_S

    driving.wait_full_speed("tb3_0")
    fresh = robot.first_command_after(frozen)
    assert fresh is not None
    assert fresh > continued
    assert robot.uncommanded_motion(frozen, continued) == []
    assert driving.process(NAME) == before


def test_a_frost_longer_than_the_lease_without_a_supervisor(driving: SupervisedFleet) -> None:
    """Its links are closed meanwhile; when it goes on, it must join anew before it may drive."""
    robot, node = driving.robot("tb3_0"), driving.recorder.node
    node.call(SUPERVISOR_STOP, Name(name=NAME))
    driving.wait(lambda: driving.process(NAME).state == "stopped", "a controller that is stopped")
    driving.wait(lambda: robot.speed < STANDSTILL_SPEED, "a robot that nobody drives")
    goal = ("--param", "goals=[[1000, 0]]")
    arguments = ("--namespace", "/tb3_0", "--connect", driving.endpoint, *goal)
    with start_service("waypoint", *arguments, logs=driving.folder) as controller:
        driving.wait_full_speed("tb3_0")
        driving.wait(lambda: driving.recorder.alive(f"/{NAME}"), "the token of the new controller")
        frozen = send_signal(controller.pid, signal.SIGSTOP)
        driving.wait(lambda: not driving.recorder.alive(f"/{NAME}"), "the end of the lease of 2 s")
        driving.wait(lambda: robot.first_stop_after(frozen), "a robot that stands")
        continued = send_signal(controller.pid, signal.SIGCONT)
        assert robot.seconds_to_stop(frozen) <= LATEST_STOP_S

        driving.wait_full_speed("tb3_0")
        fresh = robot.first_command_after(frozen)
        assert fresh is not None
        assert fresh > continued
        assert robot.uncommanded_motion(frozen, continued) == []
    assert controller.status == 0, controller.text
    node.call(SUPERVISOR_START, Name(name=NAME))
    driving.wait_ready(NAME)
    driving.wait_full_speed("tb3_0")
