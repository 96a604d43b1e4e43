"""The Python client on a running fleet."""

from __future__ import annotations

import pytest

from messages.requests import GET_STATE
from messages.simulation import GetModelState
from messages.topics import UPDATES
from services.runtime import CMD_VEL, GROUND_TRUTH, ODOM, SCAN, BadInput, CallFailed, NoAnswer, Twist, Vector3, connect
from services.runtime.client import Client
from tests.harness.background_fleet import BackgroundFleet


@pytest.fixture
def client(running: BackgroundFleet, monkeypatch: pytest.MonkeyPatch) -> Client:
    monkeypatch.setenv("XDG_STATE_HOME", running.command_line.environment["XDG_STATE_HOME"])
    return connect()


def test_it_drives_and_reads(client: Client) -> None:
    with client:
        assert client.topics()["/tb3_0/odom"] == "nav_msgs/Odometry"
        before = client.latest(GROUND_TRUTH.of("tb3_0")).pose.pose.position.x
        began = client.time()
        client.publish(CMD_VEL.of("tb3_0"), Twist(linear=Vector3(x=0.1)), seconds=1.0)
        client.wait(0.5)
        assert client.time() - began >= 1.5
        driven = client.next(GROUND_TRUTH.of("tb3_0")).pose.pose.position.x - before
        # One second at 0.1 m/s, less the acceleration phase, plus the time until the last command has expired.
        assert 0.08 < driven < 0.16
        assert len(client.messages(ODOM.of("tb3_0"))) == 0
        client.wait(0.5)
        stamps = [each.header.stamp.ns for each in client.messages(ODOM.of("tb3_0"))]
        assert len(stamps) >= 10
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
