"""Fault 2: a controller's loop hangs, while its process and its token live on."""

from __future__ import annotations

import re

import psutil
import pytest

from deploy.supervisor.pulse import LIMIT_S
from tests.faults.fleet import Fleet
from tests.faults.track import LATEST_STOP_S


@pytest.mark.parametrize(("robot", "fault"), [("tb3_1", "deadlock"), ("tb3_2", "spin"), ("tb3_3", "gil")])
def test_the_robot_stops_and_the_watchdog_replaces_the_controller(driving: Fleet, robot: str, fault: str) -> None:
    name, track = f"{robot}/{fault}", driving.robot(robot)
    before = driving.process(name)
    driving.wait_full_speed(robot)
    driving.fail(name)
    told = track.commands[-1]
    driving.wait(lambda: track.stood(told), "a robot that stands")
    hung = max(each for each in track.commands if each < track.sights[-1].sent)
    assert psutil.Process(before.pid).is_running()
    assert driving.observer.alive(f"/{name}")
    print(f"stood after {track.seconds_to_stop(hung):.3f} s of simulation time")
    assert track.seconds_to_stop(hung) <= LATEST_STOP_S

    born = driving.wait_new_life(before)
    driving.wait_full_speed(robot)
    print(f"drove again after {(track.sights[-1].sent - hung) / 1e9:.2f} s")
    assert track.unbidden(hung, born) == []
    found = re.search(r"no heartbeat for ([\d.]+) s", driving.log(name))
    assert found, driving.log(name)
    assert float(found[1]) >= LIMIT_S
    assert not psutil.pid_exists(before.pid)
