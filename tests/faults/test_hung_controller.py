"""Faults 2 and 3: a controller's loop hangs, or it is frozen, while its process and its token live on."""

from __future__ import annotations

import re
import signal

import psutil

from deploy.supervisor.heartbeat_monitor import HEARTBEAT_TIMEOUT_S
from tests.faults.supervised_fleet import SupervisedFleet
from tests.harness.cases import case
from tests.harness.robot_recorder import LATEST_STOP_S

CONTROLLERS = {
    "tb3_0": "tb3_0/waypoint",
    "tb3_1": "tb3_1/deadlock",
    "tb3_2": "tb3_2/spin",
    "tb3_3": "tb3_3/gil",
}
"""By robot; the first is frozen, the others hang in the way that their names tell."""


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
        hung[robot] = max(each for each in track.command_instants if each < track.samples[-1].sent)
        with case(name):
            assert psutil.Process(before[robot].pid).is_running()
            assert driving.recorder.alive(f"/{name}")
            assert track.seconds_to_stop(hung[robot]) <= LATEST_STOP_S

    born = {robot: driving.wait_restarted(each) for robot, each in before.items()}
    driving.wait_full_speed(*CONTROLLERS)
    for robot, name in CONTROLLERS.items():
        with case(name):
            assert driving.robot(robot).uncommanded_motion(hung[robot], born[robot]) == []
            found = re.search(r"no heartbeat for ([\d.]+) s", driving.log(name))
            assert found, driving.log(name)
            assert float(found[1]) >= HEARTBEAT_TIMEOUT_S
            assert not psutil.pid_exists(before[robot].pid)
