"""Fault 4: the router is killed, and comes back."""

from __future__ import annotations

from deploy.supervisor.pulse import LIMIT_S
from services.runtime.graph import snapshot
from tests.faults.fleet import SOON_S, Fleet
from tests.faults.track import FULL_SPEED
from tests.waiting import until


def declared(fleet: Fleet, name: str) -> set[tuple[str, str, str, str]]:
    """What a newcomer sees of the network: all but the router and the test's own nodes."""
    with fleet.node(name) as node:
        return {
            (each.kind, each.node, each.name, each.session)
            for each in snapshot(node.transport)
            if each.node not in ("/router", f"/{name}") and not each.node.startswith("/observer")
        }


def test_between_peers_data_goes_on(driving: Fleet) -> None:
    driving.wait_full_speed(*driving.observer.robots)
    before, graph = driving.process("router"), declared(driving, "early")
    driving.observer.look()
    lost = {name: track.truth.lost for name, track in driving.observer.robots.items()}
    timed_out = {name: track.base.commands_timed_out for name, track in driving.observer.robots.items()}
    killed = driving.kill("router")
    driving.wait_new_life(before)
    driving.wait_simulated(2 * LIMIT_S)
    for name, track in driving.observer.robots.items():
        during = [each for each in track.sights if each.sent > killed]
        assert min(each.speed for each in during) > FULL_SPEED
        assert track.truth.lost == lost[name]
        assert track.base.commands_timed_out == timed_out[name]
    until(lambda: declared(driving, "late") == graph, SOON_S, "everybody declared at the new router")
    assert all(driving.process(name).pid == each.pid for name, each in driving.observer.processes.items())
