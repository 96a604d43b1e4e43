"""Fault 4: the router is killed, and restarted."""

from __future__ import annotations

from deploy.supervisor.heartbeat_monitor import RECOVERY_S
from services.runtime.graph import snapshot
from services.runtime.heartbeat import PERIOD_S
from tests.faults.supervised_fleet import WITHIN_S, SupervisedFleet
from tests.harness.robot_recorder import FULL_SPEED
from tests.harness.waiting import wait_until


def declared(fleet: SupervisedFleet, name: str) -> set[tuple[str, str, str, str]]:
    """What a newcomer sees of the network: all but the router and the test's own nodes."""
    with fleet.node(name) as node:
        return {
            (each.kind, each.node, each.name, each.session)
            for each in snapshot(node.transport)
            if each.node not in ("/router", f"/{name}") and not each.node.startswith("/observer")
        }


def test_between_peers_data_goes_on(driving: SupervisedFleet) -> None:
    driving.wait_full_speed(*driving.recorder.robots)
    before, graph = driving.process("router"), declared(driving, "early")
    driving.recorder.poll()
    lost = {name: track.truth.lost for name, track in driving.recorder.robots.items()}
    timed_out = {name: track.base.commands_timed_out for name, track in driving.recorder.robots.items()}
    killed = driving.kill("router")
    driving.wait_restarted(before)
    driving.wait_simulated(RECOVERY_S + PERIOD_S)
    for name, track in driving.recorder.robots.items():
        during = [each for each in track.samples if each.sent > killed]
        assert min(each.speed for each in during) > FULL_SPEED
        assert track.truth.lost == lost[name]
        assert track.base.commands_timed_out == timed_out[name]
    wait_until(lambda: declared(driving, "late") == graph, WITHIN_S, "everybody declared at the new router")
    assert all(driving.process(name).pid == each.pid for name, each in driving.recorder.processes.items())
