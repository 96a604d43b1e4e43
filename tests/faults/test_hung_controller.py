"""Faults 2 and 3: a controller's loop hangs, or the controller is frozen and may resume later."""

from __future__ import annotations

import re
import signal
import time
from contextlib import suppress

import psutil

from deploy.supervisor.heartbeat_monitor import HEARTBEAT_TIMEOUT_S
from messages.elea import ProcessState
from messages.requests import SUPERVISOR_START, SUPERVISOR_STOP, Name
from tests.faults.supervised_fleet import WITHIN_S, SupervisedFleet, send_signal
from tests.harness.cases import case
from tests.harness.processes import start_service
from tests.harness.robot_recorder import LATEST_STOP_S, STANDSTILL_SPEED

FROZEN = "tb3_0/waypoint"
CONTROLLERS = {
    "tb3_0": FROZEN,
    "tb3_1": "tb3_1/deadlock",
    "tb3_2": "tb3_2/spin",
    "tb3_3": "tb3_3/gil",
}
"""Controllers by robot; the first is frozen, the others hang as their names say."""
SHORT_NS = 1_500_000_000
"""Longest short freeze [ns]: shorter than the lease of a link, and than three heartbeats less the age of the last."""
TRIES = 5
"""Freezes within which one must be short, on a machine on which this test may stand still for longer."""


def test_the_robots_stop_and_the_watchdog_replaces_the_controllers(driving: SupervisedFleet) -> None:
    driving.wait_full_speed(*CONTROLLERS)
    before = {robot: driving.process(name) for robot, name in CONTROLLERS.items()}
    begun = {}
    for robot, name in CONTROLLERS.items():
        if robot == "tb3_0":
            begun[robot] = driving.send_signal(name, signal.SIGSTOP)
        else:
            driving.trigger_fault(name)
            begun[robot] = driving.robot(robot).command_instants[-1]
    hung = {}
    for robot, name in CONTROLLERS.items():
        track = driving.robot(robot)
        driving.wait(lambda t=track, since=begun[robot]: t.first_stop_after(since), f"{robot} to stand")  # type: ignore[misc]
        stood = track.first_stop_after(begun[robot])
        assert stood is not None
        hung[robot] = max(each for each in track.command_instants if each < stood.sent)
        with case(name):
            assert track.seconds_to_stop(hung[robot]) <= LATEST_STOP_S

    born = {robot: driving.wait_restarted(each) for robot, each in before.items()}
    driving.wait_full_speed(*CONTROLLERS)
    for robot, name in CONTROLLERS.items():
        with case(name):
            assert driving.robot(robot).uncommanded_motion(hung[robot], born[robot]) == []
            # It was alive until then: it was killed for its silence.
            found = re.search(r"no heartbeat for ([\d.]+) s", driving.log(name))
            assert found, driving.log(name)
            assert float(found[1]) >= HEARTBEAT_TIMEOUT_S
            assert not psutil.pid_exists(before[robot].pid)


def test_a_short_freeze_stops_the_robot_until_a_fresh_command(driving: SupervisedFleet) -> None:
    """The freeze is shorter than the three heartbeats after which a controller would be replaced."""
    robot = driving.robot("tb3_0")
    before, frozen, continued = _freeze_shortly(driving)
    assert robot.seconds_to_stop(frozen) <= LATEST_STOP_S

    driving.wait_full_speed("tb3_0")
    fresh = robot.first_command_after(frozen)
    assert fresh is not None
    assert fresh > continued
    assert robot.uncommanded_motion(frozen, continued) == []
    assert driving.process(FROZEN) == before


def _freeze_shortly(driving: SupervisedFleet) -> tuple[ProcessState, int, int]:
    """Freeze the controller until its robot stands; return its process, and when [ns] it was frozen and continued.

    A freeze that was long because the test itself stood still is repeated; the controller may have been replaced.
    """
    robot = driving.robot("tb3_0")
    for _ in range(TRIES):
        driving.wait_ready(FROZEN)
        driving.wait_full_speed("tb3_0")
        before = driving.process(FROZEN)
        frozen = send_signal(before.pid, signal.SIGSTOP)
        driving.wait(lambda since=frozen: robot.first_stop_after(since), "a robot that stands")  # type: ignore[misc]
        alive = driving.recorder.alive(f"/{FROZEN}")
        with suppress(psutil.NoSuchProcess):
            continued = send_signal(before.pid, signal.SIGCONT)
            if continued - frozen < SHORT_NS:
                assert alive
                return before, frozen, continued
        over = time.time_ns()
        driving.wait(lambda since=over: robot.first_command_after(since), "a command after it")  # type: ignore[misc]
    raise AssertionError(f"none of {TRIES} freezes was short")


def test_a_frost_longer_than_the_lease_without_a_supervisor(driving: SupervisedFleet) -> None:
    """Its links are closed meanwhile; when it resumes, it must rejoin before it may drive."""
    robot, node = driving.robot("tb3_0"), driving.recorder.node
    node.call(SUPERVISOR_STOP, Name(name=FROZEN), WITHIN_S)
    driving.wait(lambda: driving.process(FROZEN).state == "stopped", "a controller that is stopped")
    driving.wait(lambda: robot.speed < STANDSTILL_SPEED, "a robot that nobody drives")
    goal = ("--param", "goals=[[1000, 0]]")
    arguments = ("--namespace", "/tb3_0", "--connect", driving.endpoint, *goal)
    with start_service("waypoint", *arguments, logs=driving.folder) as controller:
        driving.wait_full_speed("tb3_0")
        driving.wait(lambda: driving.recorder.alive(f"/{FROZEN}"), "the token of the new controller")
        frozen = send_signal(controller.pid, signal.SIGSTOP)
        driving.wait(lambda: not driving.recorder.alive(f"/{FROZEN}"), "the end of the lease of 2 s")
        driving.wait(lambda: robot.first_stop_after(frozen), "a robot that stands")
        continued = send_signal(controller.pid, signal.SIGCONT)
        assert robot.seconds_to_stop(frozen) <= LATEST_STOP_S

        driving.wait_full_speed("tb3_0")
        fresh = robot.first_command_after(frozen)
        assert fresh is not None
        assert fresh > continued
        assert robot.uncommanded_motion(frozen, continued) == []
    assert controller.status == 0, controller.text
    node.call(SUPERVISOR_START, Name(name=FROZEN), WITHIN_S)
    driving.wait_ready(FROZEN)
    driving.wait_full_speed("tb3_0")
