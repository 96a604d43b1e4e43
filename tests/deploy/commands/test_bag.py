"""The commands of ``elea bag`` on real processes and files: results, and exit status for each bad input."""

from __future__ import annotations

import json
import os
import signal
import sys
from collections import Counter
from pathlib import Path
from subprocess import DEVNULL, Popen
from time import sleep

import pytest
from rerun.chunk import RrdReader

from messages.geometry import PoseStamped
from messages.std import String
from messages.topics import GOAL_POSE, ODOM, ROBOT_DESCRIPTION
from services.bag.reader import open_bag
from services.runtime.node import Node
from tests.harness.background_fleet import interrupt
from tests.harness.command_line import CommandLine
from tests.harness.health import ask_health
from tests.harness.message_recorder import WITHIN_S
from tests.harness.processes import Network
from tests.harness.waiting import wait_until
from tests.services.bag.sample_bags import make_bag, make_rosbag2_bag

pytestmark = pytest.mark.waits


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the bags ``ours``, ``foreign`` (rosbag2) and ``torn.mcap`` (truncated), and an ``empty`` folder."""
    folder = tmp_path_factory.mktemp("bags")
    (folder / "empty").mkdir()
    make_rosbag2_bag(folder / "foreign")
    whole = (make_bag(folder / "ours", 0.2) / "ours_0.mcap").read_bytes()
    (folder / "torn.mcap").write_bytes(whole[:-100])
    return folder


def test_record_takes_what_is_chosen_until_ctrl_c(network: Network, node: Node, tmp_path: Path) -> None:
    terminal = CommandLine(tmp_path)
    goal, odometry, other = (
        node.advertise(GOAL_POSE, "/v/goal_pose"),
        node.advertise(ODOM, "/v/odom"),
        node.advertise(ODOM, "/w/odom"),
    )
    options = ("-e", "odom$", "-x", "^/w", "-o", "lap", "-d", "0.2")
    process = terminal.start("bag", "record", "/v/goal_pose", *options, "--connect", network.endpoint)
    wait_until(lambda: goal.has_subscribers and odometry.has_subscribers, 30.0, "a recorder")
    sent = 0

    def received() -> bool:
        counts = {each.topic: each.received for each in ask_health(node.transport, "/recorder").inputs}
        return counts.get("/v/goal_pose") == counts.get("/v/odom") == sent

    def record() -> bool:
        """Publish some messages, wait for the recorder to receive them, and return whether there are three files."""
        nonlocal sent
        for _ in range(10):
            for out in (odometry, other):
                out.publish(ODOM.record())
            goal.publish(PoseStamped())
            sent += 1
            sleep(0.01)
        wait_until(received, WITHIN_S, "all messages in the recorder")
        return len(list((tmp_path / "lap").glob("*.mcap"))) >= 3

    wait_until(record, WITHIN_S, "a new file each 0.2 s")
    ended = interrupt(process)
    assert ended.status == 0, ended.err
    told = json.loads(terminal.run("bag", "info", "lap", "--json").out)
    assert {each["topic"]: each["messages"] for each in told["topics"]} == {"/v/goal_pose": sent, "/v/odom": sent}
    assert len(told["files"]) >= 3
    assert f"recorded {2 * sent} messages of 2 topics" in ended.err
    node.unregister(goal, odometry, other)


def test_record_on_a_full_disk_tells_what_is_missing(network: Network, node: Node, tmp_path: Path) -> None:
    """A file size limit of 128 kB makes the kernel fail writes as on a full disk, without affecting other processes."""
    out = node.advertise(ROBOT_DESCRIPTION, "/full/robot_description")
    record = f"{sys.executable} -P -m deploy bag record /full/robot_description -o full --connect {network.endpoint}"
    log, sent = tmp_path / "log", 0

    def failed() -> bool:
        nonlocal sent
        assert process.poll() is None, log.read_text()
        out.publish(String(data=os.urandom(500).hex()))
        sent += 1
        return "the recording cannot be written (File too large)" in log.read_text()

    with log.open("w") as err:
        process = Popen(
            ["bash", "-c", f"ulimit -f 128; exec {record}"],
            env=CommandLine(tmp_path).environment,
            cwd=tmp_path,
            stdout=DEVNULL,
            stderr=err,
        )
    try:
        wait_until(failed, WITHIN_S, "a disk that is full")
        process.send_signal(signal.SIGINT)
        assert process.wait(120) == 1, log.read_text()
    finally:
        process.kill()
    assert "messages are missing from" in log.read_text()
    kept = Counter(each.channel.topic for each in open_bag(tmp_path / "full").entries())
    assert 0 < kept["/full/robot_description"] < sent
    node.unregister(out)


def test_info_and_export(bags: Path, tmp_path: Path) -> None:
    terminal = CommandLine(tmp_path)
    shown = terminal.run("bag", "info", str(bags / "foreign")).out
    assert "sensor_msgs/msg/BatteryState" in shown
    assert "cannot be played" not in shown
    told = {
        each["topic"]: each
        for each in json.loads(terminal.run("bag", "info", str(bags / "foreign"), "--json").out)["topics"]
    }
    assert told["/battery"]["playable"]
    tables = json.loads(terminal.run("bag", "export", str(bags / "ours"), "-o", "tables", "--json").out)
    assert tables == {"output": str(tmp_path / "tables"), "troubles": []}
    assert len((tmp_path / "tables" / "r__odom.csv").read_text().splitlines()) == 12
    for name, topics in (("ours", {"/r/odom", "/r/cmd_vel"}), ("foreign", {"/cmd_vel", "/battery"})):
        ended = terminal.run("bag", "export", str(bags / name), "--to", "rrd", "-o", f"{name}.rrd")
        assert ended.status == 0, ended.err
        entities = {str(each.entity_path) for each in RrdReader(tmp_path / f"{name}.rrd").stream()}
        assert topics <= entities, entities
    torn = terminal.run("bag", "export", str(bags / "torn.mcap"), "-o", "rest")
    assert (torn.status, "torn.mcap is truncated" in torn.err) == (1, True)
    assert len((tmp_path / "rest" / "r__odom.csv").read_text().splitlines()) == 12


def test_bags_whose_names_have_a_dot_have_a_recording_each(tmp_path: Path) -> None:
    """Holds whether or not this machine can draw: the recording is made first."""
    terminal = CommandLine(tmp_path)
    for name, seconds in (("lap.1", 0.1), ("lap.2", 0.2)):
        make_bag(tmp_path / name, seconds)
    views = [terminal.start("view", name, "--picture", "--size", "320x320") for name in ("lap.1", "lap.2")]
    assert all(terminal.finish(each).status in (0, 2) for each in views)
    held = [len(list(RrdReader(tmp_path / f"lap.{number}.rrd").stream())) for number in (1, 2)]
    assert all(held)
    assert sorted(each.name for each in tmp_path.glob("*.rrd")) == ["lap.1.rrd", "lap.2.rrd"]
    assert not list(tmp_path.glob(".*.rrd")), "what is half done lies beside it until it is whole"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["record"], "nothing to record: name topics, or give --all or --regex"),
        (["record", "-a", "/clock"], "--all records every topic"),
        (["record", "-a", "-b", "12 parsecs"], "is not a size: write bytes, or 100M"),
        (["record", "-a", "-d", "-1"], "max_duration = -1.0"),
        (["record", "-e", "("], "'(' is not a regular expression"),
        (["record", "/a//b"], "parts are joined by a single '/'"),
        (["record", "-a", "-o", "{bags}/ours"], "exists already: choose another folder"),
        (["record", "-a", "-o", "/proc/bag"], "the bag /proc/bag cannot be written"),
        (["info", "{bags}/nowhere"], "there is no bag"),
        (["info", "{bags}/empty"], "is not a bag: no .mcap file"),
        (["export", "{bags}/ours", "--topics", "/r/odomm"], "did you mean '/r/odom'?"),
        (["export", "{bags}/ours", "--to", "xml"], "'xml' is not one of 'csv', 'rrd', 'rosbag2'"),
        (["export", "{bags}/ours", "-o", "/dev/full/x"], "the tables cannot be written"),
        (["recrod"], "unknown command 'recrod'; did you mean 'record'?"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_bad_input(network: Network, bags: Path, tmp_path: Path, arguments: list[str], said: str) -> None:
    words = [each.format(bags=bags) for each in arguments]
    connect = ("--connect", network.endpoint) if words[0] == "record" else ()
    ended = CommandLine(tmp_path).run("bag", *words, *connect)
    assert (ended.status, said in ended.err) == (2, True), ended.err
    assert ended.out == ""
    assert "Traceback" not in ended.err
