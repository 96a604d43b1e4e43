"""The Python client on a running fleet."""

from __future__ import annotations

from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from messages.requests import GET_STATE
from messages.simulation import GetModelState
from messages.topics import BASE_STATUS, UPDATES
from services.runtime import CMD_VEL, GROUND_TRUTH, ODOM, SCAN, BadInput, CallFailed, NoAnswer, Twist, Vector3, connect
from services.runtime.client import Client
from services.runtime.transport.memory import MemoryBus, MemoryTransport
from tests.harness.background_fleet import BackgroundFleet
from tests.harness.message_recorder import WITHIN_S
from tests.harness.waiting import wait_until


@pytest.fixture
def client(running: BackgroundFleet, monkeypatch: pytest.MonkeyPatch) -> Client:
    monkeypatch.setenv("XDG_STATE_HOME", running.command_line.environment["XDG_STATE_HOME"])
    return connect()


def test_a_router_of_another_machine_is_taken_whatever_fleet_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ELEA_HOME", str(tmp_path))
    opened: list[str] = []

    def open_transport(router: str, domain: str) -> AbstractContextManager[MemoryTransport]:
        opened.append(router)
        return MemoryTransport(MemoryBus())

    monkeypatch.setattr("services.runtime.client.open_transport", open_transport)
    with connect("lab", 7450, router="tcp/192.0.2.1:7447") as remote:
        assert remote.folder is None
    assert opened == ["tcp/192.0.2.1:7447"]


def drive(client: Client) -> float:
    """Drive for a second; return the distance [m], 0 if the base stopped meanwhile: this process was held up."""
    truth, status = GROUND_TRUTH.of("tb3_0"), BASE_STATUS.of("tb3_0")
    before = client.latest(truth, WITHIN_S).pose.pose.position.x
    stops = client.latest(status, WITHIN_S).commands_timed_out
    began = client.time()
    client.publish(CMD_VEL.of("tb3_0"), Twist(linear=Vector3(x=0.1)), seconds=1.0)
    client.wait(0.5)
    end = client.time()
    assert end - began > 1.49
    while (after := client.next(truth)).header.stamp.ns < end * 1e9:
        pass
    while (base := client.next(status)).header.stamp.ns < end * 1e9:
        pass
    return after.pose.pose.position.x - before if base.commands_timed_out == stops + 1 else 0.0


def test_it_drives_and_reads(client: Client) -> None:
    with client:
        assert client.topics()["/tb3_0/odom"] == "nav_msgs/Odometry"
        driven = wait_until(lambda: drive(client), WITHIN_S, "a drive without a pause")
        # One second at 0.1 m/s, less the acceleration phase, plus the time until the last command has expired.
        assert 0.08 < driven < 0.16
        stamps: list[int] = []

        def ten() -> bool:
            stamps.extend(each.header.stamp.ns for each in client.messages(ODOM.of("tb3_0")))
            return len(stamps) >= 10

        wait_until(ten, WITHIN_S, "ten messages")
        assert stamps == sorted(stamps)


def test_it_asks_steps_and_sets(client: Client) -> None:
    with client:
        assert client.call(GET_STATE, GetModelState(name="tb3_1")).model == "waffle"
        paused = client.pause()
        assert client.step(40).tick == paused.tick + 40
        with pytest.raises(NoAnswer, match="simulation time is paused"):
            client.wait(1.0)
        client.resume()
        given = client.params("/tb3_0/base")["cmd_vel_timeout"]
        assert client.set_params("/tb3_0/base", {"cmd_vel_timeout": given + 0.1}, save=False)["cmd_vel_timeout"] > given
        with pytest.raises(CallFailed, match="cmd_vel_timeout"):
            client.set_params("/tb3_0/base", {"cmd_vel_timeout": -1.0})
        assert client.params("tb3_0/base")["cmd_vel_timeout"] == pytest.approx(given + 0.1)
        with pytest.raises(BadInput, match="did you mean '/tb3_0/base'"):
            client.params("/tb3_0/bas")


def test_what_does_not_come_is_told_with_its_cause(client: Client) -> None:
    with client:
        with pytest.raises(NoAnswer, match="/tb3_7/scan has no publisher"):
            client.latest(SCAN.of("tb3_7"), timeout=0.1)
        with pytest.raises(NoAnswer, match="/tb3_0/odom carries nav_msgs/Odometry, not sensor_msgs/LaserScan"):
            client.latest(SCAN.named("/tb3_0/odom"), timeout=0.1)
        with pytest.raises(BadInput, match=r"belongs to a node: use of\(\)"):
            client.latest(UPDATES)
    with pytest.raises(BadInput, match="unknown running fleet 'idel'; did you mean 'idle'"):
        connect("idel")
