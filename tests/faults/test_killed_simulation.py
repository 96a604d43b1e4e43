"""Fault 6: the simulation is killed; simulation time stops, and starts again from zero."""

from __future__ import annotations

import psutil

from messages.std import String
from services.runtime.subscriber import Subscriber
from tests.faults.services.timekeeper import TICKS
from tests.faults.supervised_fleet import SupervisedFleet

LANDING = 0.01
"""m/s; a robot that was just put into the world settles on its wheels."""


def test_controllers_wait_without_time_and_follow_the_new_one(driving: SupervisedFleet) -> None:
    robot, ticks = driving.robot("tb3_0"), driving.recorder.node.subscribe(TICKS, "/ticks")
    driving.wait(lambda: _admitted(ticks), "a tick")
    told = [message.data.split() for message, _ in ticks.messages]
    others = {name: each for name, each in driving.recorder.processes.items() if name != "sim"}
    before, old = driving.process("sim"), driving.robot("tb3_0").samples[-1].time
    killed = driving.kill("sim")
    controllers = [f"/{name}" for name in others if name.startswith("tb3_") or name == "timekeeper"]
    driving.wait(lambda: all(driving.recorder.state(each) == "waiting" for each in controllers), "idle controllers")
    idle = max(driving.recorder.health[each][0] for each in controllers)

    born = driving.wait_restarted(before)
    driving.wait(lambda: robot.samples[-1].time < old, "a robot of the new simulation")
    began = next(each for each in robot.samples if each.sent > killed and each.time < old)
    driving.wait_full_speed(*driving.recorder.robots)
    assert [each for each in robot.command_instants if idle < each < born] == []
    assert began.x < 0.1, "the world is as it was at the start"
    assert robot.base.stale_dropped == 0
    fresh = robot.first_command_after(born)
    assert fresh is not None
    # Where the observer has missed the first commands, as it joins the new simulation itself, it cannot judge.
    heard = next(each for each in robot.command_samples if each.sent >= fresh)
    unmoved = [each for each in robot.samples if began.sent <= each.sent < fresh]
    assert not heard.consecutive or [each for each in unmoved if each.speed > LANDING] == []
    driving.wait(lambda: all(driving.recorder.state(each) == "running" for each in controllers), "controllers at work")

    ticks.update()
    told += [message.data.split() for message, _ in ticks.messages]
    times = [int(time) for time, *_ in told]
    assert all(float(dt) >= 0.0 for _, dt, *_ in told)
    back = [number for number in range(1, len(times)) if times[number] < times[number - 1]]
    assert [number for number, each in enumerate(told) if each[3] == "1"] == back
    assert len(back) == 1
    assert float(told[back[0]][1]) == 0.0
    for name, each in others.items():
        assert driving.process(name).pid == each.pid, f"{name} did not survive"
        assert psutil.pid_exists(each.pid)


def _admitted(ticks: Subscriber[String]) -> bool:
    """Whether anything has come."""
    ticks.update()
    return bool(ticks.messages)
