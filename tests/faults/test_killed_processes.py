"""Faults 1, 4 and 6: a controller at full speed, the router and the simulation are killed and restarted."""

from __future__ import annotations

import psutil

from deploy.supervisor.heartbeat_monitor import RECOVERY_S
from messages.std import String
from services.runtime.graph import snapshot
from services.runtime.heartbeat import PERIOD_S
from services.runtime.subscriber import Subscriber
from tests.faults.services.timekeeper import TICKS
from tests.faults.supervised_fleet import WITHIN_S, SupervisedFleet
from tests.harness.robot_recorder import LATEST_STOP_S, WHEELS
from tests.harness.waiting import wait_until

LANDING = 0.01
"""Speed [m/s] allowed while a newly spawned robot settles on its wheels."""


def test_without_its_controller_the_robot_stops_until_it_comes_back(driving: SupervisedFleet) -> None:
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
        assert driving.robot(bystander).slowed(killed) == []


def test_without_the_router_data_goes_on_between_peers(driving: SupervisedFleet) -> None:
    driving.wait_full_speed(*driving.recorder.robots)
    before, graph = driving.process("router"), declared(driving, "early")
    driving.recorder.poll()
    lost = {name: track.truth.lost for name, track in driving.recorder.robots.items()}
    timed_out = {name: track.base.commands_timed_out for name, track in driving.recorder.robots.items()}
    killed = driving.kill("router")
    driving.wait_restarted(before)
    driving.wait_simulated(RECOVERY_S + PERIOD_S)
    for name, track in driving.recorder.robots.items():
        assert track.slowed(killed) == []
        assert track.truth.lost == lost[name]
        assert track.base.commands_timed_out <= timed_out[name] + len(track.pauses(killed))
    wait_until(lambda: declared(driving, "late") == graph, WITHIN_S, "everybody declared at the new router")
    assert all(driving.process(name).pid == each.pid for name, each in driving.recorder.processes.items())


def test_without_the_simulation_controllers_wait_and_follow_the_new_one(driving: SupervisedFleet) -> None:
    robot, ticks = driving.robot("tb3_0"), driving.recorder.node.subscribe(TICKS, "/ticks")
    driving.wait(lambda: _admitted(ticks), "a tick")
    told = [message.data.split() for message, _ in ticks.messages]
    others = {name: each for name, each in driving.recorder.processes.items() if name != "sim"}
    before, old = driving.process("sim"), driving.robot("tb3_0").samples[-1].time
    killed = driving.kill("sim")
    controllers = [f"/{name}" for name in others if name.startswith("tb3_") or name == "timekeeper"]

    def idle_since() -> list[int]:
        found = [driving.recorder.first_beat(each, "waiting", killed) for each in controllers]
        return [each for each in found if each is not None]

    driving.wait(lambda: len(idle_since()) == len(controllers), "idle controllers")
    idle = max(idle_since())

    born = driving.wait_restarted(before)
    driving.wait(lambda: robot.samples[-1].time < old, "a robot of the new simulation")
    began = next(each for each in robot.samples if each.sent > killed and each.time < old)
    driving.wait_full_speed(*driving.recorder.robots)
    assert [each for each in robot.command_instants if idle < each < born] == []
    assert began.x < 0.01 + WHEELS.max_linear * began.time / 1e9, "the world is as it was at the start"
    fresh = robot.first_command_after(born)
    assert fresh is not None
    assert all(each.stale_dropped == 0 for sent, each in robot.statuses if born < sent < fresh), "of another life"
    # The observer, which joins the new simulation too, may miss the first commands and can't judge them.
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


def declared(fleet: SupervisedFleet, name: str) -> set[tuple[str, str, str, str]]:
    """Return the entities that a new node discovers, without the router's and the test's own."""
    with fleet.node(name) as node:
        return {
            (each.kind, each.node, each.name, each.session)
            for each in snapshot(node.transport)
            if each.node not in ("/router", f"/{name}") and not each.node.startswith("/observer")
        }


def _admitted(ticks: Subscriber[String]) -> bool:
    """Whether any message has arrived."""
    ticks.update()
    return bool(ticks.messages)
