"""``doctor`` on a running fleet: the problems that it reports, the nodes that it names, and what it doesn't judge."""

from __future__ import annotations

from pathlib import Path

import pytest

from deploy.doctor import fleet as doctor_fleet
from deploy.doctor import machine
from deploy.doctor.fleet import FleetObservation, SampleCount, Sender, check_fleet, observe_fleet
from messages.elea import BaseStatus, FleetState, ProcessState
from messages.geometry import Twist
from messages.rosgraph import Clock
from messages.std import Time
from messages.topics import BASE_STATUS, CLOCK, CMD_VEL, FLEET_STATE
from services.runtime.graph import Entity, snapshot
from tests.harness.processes import Network
from tests.harness.waiting import wait_until

CMD = Entity("1", "pub", "/nav", "/tb3_0/cmd_vel", "geometry_msgs/Twist", "COMMAND")


def found(seen: FleetObservation) -> list[tuple[str, str]]:
    return [(each.name, each.state) for each in check_fleet([CMD], seen)]


def test_a_sound_fleet_is_called_sound() -> None:
    state = FleetState(fleet="lab", processes=(ProcessState(name="sim", state="ready"),))
    counts = {Sender("/nav", "/tb3_0/cmd_vel"): SampleCount(first=100, last=150, received=51)}
    seen = FleetObservation(2.0, 2.0, state, {"/tb3_0": BaseStatus(commands=200, stale_dropped=4)}, counts)
    assert found(seen) == [("fleet state", "ok"), ("rates", "ok")]


def test_each_fault_is_named_with_its_cause() -> None:
    processes = (
        ProcessState(name="sim", state="ready"),
        ProcessState(name="tb3_0/waypoint", state="failed", reason="5 times in 30 s"),
        ProcessState(name="tb3_1/waypoint", state="ready", restarts=3, reason="no heartbeat for 3 s"),
    )
    bases = {"/tb3_0": BaseStatus(commands=41, stale_dropped=159, refused=2, e_stopped=True)}
    counts = {
        Sender("/nav", "/tb3_0/cmd_vel"): SampleCount(first=1, last=5001, received=4000),
        Sender("a foreign program", "/tb3_0/odom"): SampleCount(received=201),
        Sender("/sim", "/clock"): SampleCount(first=1, last=101, received=101),
        Sender("/sim", "/tb3_0/scan"): SampleCount(first=1, last=15, received=15),
    }
    seen = FleetObservation(2.0, 2.0, FleetState(fleet="lab", processes=processes), bases, counts)
    told = list(check_fleet([CMD], seen))
    assert [(each.name, each.state) for each in told] == [
        ("process tb3_0/waypoint", "fail"),
        ("process tb3_1/waypoint", "warn"),
        ("base /tb3_0", "warn"),
        ("base /tb3_0", "warn"),
        ("base /tb3_0", "warn"),
        ("node /nav", "fail"),
        ("node a foreign program", "warn"),
    ]
    why = " | ".join(each.why for each in told)
    for words in ("5 times in 30 s", "159 of 200 commands from /nav", "/tb3_0/cmd_vel at 2500 Hz", "100 times"):
        assert words in why
    assert not any("overloaded" in each.do for each in told)
    assert all(each.do for each in told)


def test_no_rate_is_judged_while_time_stands_still() -> None:
    counts = {Sender("/nav", "/tb3_0/cmd_vel"): SampleCount(first=1, last=5001, received=4000)}
    assert found(FleetObservation(2.0, 0.0, counts=counts)) == []


def test_a_flood_is_counted_by_its_sender_over_the_network(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sequence numbers show how many messages were sent, however many the observer received.

    The observation ends with the state of the base, which it sends from the tenth tick on.
    """
    monkeypatch.setattr(doctor_fleet, "MIN_OBSERVATION_S", 0.0)
    state = FleetState(fleet="lab", processes=(ProcessState(name="sim", state="failed", reason="gone"),))
    with Network(tmp_path) as net, net.node("flooder") as node, net.node("eye") as eye:
        clock, flood = node.advertise(CLOCK), node.advertise(CMD_VEL, "/tb3_0/cmd_vel")
        base, fleet = node.advertise(BASE_STATUS, "/tb3_0/base_status"), node.advertise(FLEET_STATE)
        # So that the flooder knows of them before the observation begins.
        eye.subscribe(FLEET_STATE)
        eye.subscribe(BASE_STATUS, base.name)
        eye.subscribe(CMD_VEL, flood.name)
        arrived, outputs, tick = eye.subscribe(CLOCK), (clock, flood, base), 0

        def linked() -> bool:
            seen = {each.name for each in snapshot(eye.transport)}
            return all(each.has_subscribers and each.name in seen for each in outputs)

        wait_until(linked, 10.0, "the flooder")
        publications = [each for each in snapshot(eye.transport) if each.kind == "pub"]

        class Driven:
            """The observer's transport; each time it waits, the flooder sends 100 commands in one tick, and its clock
            arrives.
            """

            def __getattr__(self, name: str) -> object:
                return getattr(eye.transport, name)

            def wait(self, inlet: object) -> None:
                nonlocal tick
                tick += 1
                clock.publish(Clock(clock=Time.of(tick * 20_000_000), tick=tick * 4))
                fleet.publish(state)
                for _ in range(100):
                    flood.publish(Twist())
                if tick >= 10:
                    base.publish(BaseStatus(commands=1, stale_dropped=99))
                wait_until(lambda: (arrived.update(), arrived.messages)[1], 10.0, "the clock of this tick")
                eye.transport.wait(inlet)  # type: ignore[arg-type]

        seen = observe_fleet(Driven(), publications, 60.0)  # type: ignore[arg-type]
        told = {each.name: each for each in check_fleet(publications, seen)}
    assert told["node /flooder"].state == "fail"
    assert "/tb3_0/cmd_vel" in told["node /flooder"].why
    assert "99 of 100 commands from /flooder" in told["base /tb3_0"].why
    assert told["process sim"].state == "fail"


def test_a_base_that_tells_its_state_later_than_all_nodes_is_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A base publishes its status at 5 Hz of simulation time, which may run slowly."""
    monkeypatch.setattr(doctor_fleet, "MIN_OBSERVATION_S", 0.0)
    with Network(tmp_path) as net, net.node("sim") as node, net.node("eye") as eye:
        base = node.advertise(BASE_STATUS, "/tb3_0/base_status")
        wait_until(lambda: any(each.name == "/tb3_0/base_status" for each in snapshot(eye.transport)), 10.0, "the base")
        publications, waits = [each for each in snapshot(eye.transport) if each.kind == "pub"], 0

        class Driven:
            """The observer's transport; the base publishes its status only from the fourth wait on."""

            def __getattr__(self, name: str) -> object:
                return getattr(eye.transport, name)

            def wait(self, inlet: object) -> None:
                nonlocal waits
                waits += 1
                if waits > 3:
                    base.publish(BaseStatus(commands=41, stale_dropped=159))
                eye.transport.wait(inlet)  # type: ignore[arg-type]

        seen = observe_fleet(Driven(), publications, 60.0)  # type: ignore[arg-type]
        assert "159 of 200 commands" in next(check_fleet(publications, seen)).why
        assert seen.wall < 60.0


def test_the_disk_of_the_running_fleet_is_looked_at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert [each.state for each in doctor_fleet.disk("lab", str(tmp_path))] == ["ok"]
    assert [each.state for each in doctor_fleet.disk("lab", str(tmp_path / "gone"))] == ["fail"]
    monkeypatch.setattr(machine, "MIN_DISK_MIB", 1 << 40)
    [full] = doctor_fleet.disk("lab", str(tmp_path))
    assert (full.name, full.state) == ("disk of lab", "fail")
