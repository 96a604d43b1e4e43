"""Fault 2: a controller's loop hangs, while its process and its token live on."""

from __future__ import annotations

import re

import psutil
import pytest

from deploy.supervisor.heartbeat_monitor import HEARTBEAT_TIMEOUT_S
from tests.faults.supervised_fleet import SupervisedFleet
from tests.harness.robot_recorder import LATEST_STOP_S


@pytest.mark.parametrize(("robot", "fault"), [("tb3_1", "deadlock"), ("tb3_2", "spin"), ("tb3_3", "gil")])
def test_the_robot_stops_and_the_watchdog_replaces_the_controller(
    driving: SupervisedFleet, robot: str, fault: str
) -> None:
    name, track = f"{robot}/{fault}", driving.robot(robot)
    before = driving.process(name)
    driving.wait_full_speed(robot)
    driving.trigger_fault(name)
    told = track.command_instants[-1]
    driving.wait(lambda: track.first_stop_after(told), "a robot that stands")
    hung = max(each for each in track.command_instants if each < track.samples[-1].sent)
    assert psutil.Process(before.pid).is_running()
    assert driving.recorder.alive(f"/{name}")
    assert track.seconds_to_stop(hung) <= LATEST_STOP_S

    born = driving.wait_restarted(before)
    driving.wait_full_speed(robot)
    assert track.uncommanded_motion(hung, born) == []
    found = re.search(r"no heartbeat for ([\d.]+) s", driving.log(name))
    assert found, driving.log(name)
    assert float(found[1]) >= HEARTBEAT_TIMEOUT_S
    assert not psutil.pid_exists(before.pid)
