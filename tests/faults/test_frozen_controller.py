"""Fault 3: a controller freezes, and goes on later."""

from __future__ import annotations

import signal

from messages.requests import SUPERVISOR_START, SUPERVISOR_STOP, Name
from tests.faults.fleet import Fleet, send
from tests.faults.track import LATEST_STOP_S
from tests.processes import start_service

NAME = "tb3_0/waypoint"


def test_a_short_freeze_stops_the_robot_until_a_fresh_command(driving: Fleet) -> None:
    """Less than the three heartbeats after which a controller would be replaced."""
    robot, before = driving.robot("tb3_0"), driving.process(NAME)
    driving.wait_full_speed("tb3_0")
    frozen = driving.send(NAME, signal.SIGSTOP)
    driving.wait(lambda: robot.stood(frozen), "a robot that stands")
    assert driving.observer.alive(f"/{NAME}")
    continued = driving.send(NAME, signal.SIGCONT)
    print(f"stood after {robot.seconds_to_stop(frozen):.3f} s of simulation time")
    assert robot.seconds_to_stop(frozen) <= LATEST_STOP_S

    driving.wait_full_speed("tb3_0")
    fresh = robot.fresh_command(frozen)
    assert fresh is not None
    assert fresh > continued
    assert robot.unbidden(frozen, continued) == []
    assert driving.process(NAME) == before


def test_a_frozen_controller_is_replaced_and_its_thaw_comes_too_late(driving: Fleet) -> None:
    robot, before = driving.robot("tb3_0"), driving.process(NAME)
    driving.wait_full_speed("tb3_0")
    frozen = driving.send(NAME, signal.SIGSTOP)
    born = driving.wait_new_life(before)
    driving.wait_full_speed("tb3_0")
    assert robot.seconds_to_stop(frozen) <= LATEST_STOP_S
    assert robot.unbidden(frozen, born) == []
    assert "no heartbeat for" in driving.log(NAME)


def test_three_seconds_of_frost_without_a_supervisor(driving: Fleet) -> None:
    """Its links are closed meanwhile; when it goes on, it must join anew before it may drive."""
    robot, node = driving.robot("tb3_0"), driving.observer.node
    node.call(SUPERVISOR_STOP, Name(name=NAME))
    driving.wait(lambda: driving.process(NAME).state == "stopped", "a controller that is stopped")
    goal = ("--param", "goals=[[1000, 0]]")
    arguments = ("--namespace", "/tb3_0", "--connect", driving.endpoint, *goal)
    with start_service("waypoint", *arguments, logs=driving.folder) as controller:
        driving.wait_full_speed("tb3_0")
        frozen = send(controller.pid, signal.SIGSTOP)
        driving.wait_simulated(3.0)
        assert not driving.observer.alive(f"/{NAME}"), "the lease of 2 s is over"
        stale = robot.base.stale_dropped
        continued = send(controller.pid, signal.SIGCONT)
        print(f"stood after {robot.seconds_to_stop(frozen):.3f} s of simulation time")
        assert robot.seconds_to_stop(frozen) <= LATEST_STOP_S

        driving.wait_full_speed("tb3_0")
        fresh = robot.fresh_command(frozen)
        assert fresh is not None
        assert fresh > continued
        assert robot.unbidden(frozen, continued) == []
        print(
            f"drove again {(robot.sights[-1].sent - continued) / 1e9:.2f} s after the thaw, "
            f"{robot.base.stale_dropped - stale} stale commands"
        )
    assert controller.status == 0, controller.text
    node.call(SUPERVISOR_START, Name(name=NAME))
    driving.wait_ready(NAME)
    driving.wait_full_speed("tb3_0")
