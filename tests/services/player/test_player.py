"""The player as a real process: times, names, latched topics, foreign clocks, and what can't be played."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from mcap.writer import Writer as McapWriter

from messages.geometry import Twist
from messages.parameters import Parameter, ParameterValues
from messages.records import unknown_record
from messages.requests import PAUSE, RESUME
from messages.rosgraph import Clock
from messages.std import Empty, String, Time
from messages.topics import CLOCK, CMD_VEL, ODOM, ROBOT_DESCRIPTION, Quality, Topic
from services.bag.channel import raw_channel
from services.bag.reader import open_bag
from services.bag.writer import BagWriter
from services.player.playback import SIM_PARAMETER_UPDATES, recorded_latency
from services.runtime.graph import token_pattern
from services.runtime.node import Node
from services.runtime.subscriber import Subscriber
from tests.harness.command_line import CommandLine, CommandResult
from tests.harness.processes import Network
from tests.harness.waiting import wait_until
from tests.services.bag.sample_bags import START, drive_messages, make_bag, write_messages

pytestmark = pytest.mark.waits


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_bag(tmp_path_factory.mktemp("bags") / "bag", 2.0)


def play(network: Network, bag: Path, *options: str) -> CommandResult:
    return CommandLine(bag.parent).run("bag", "play", str(bag), "--connect", network.endpoint, *options)


def drained(*inputs: Subscriber[object]) -> list[list[object]]:
    for each in inputs:
        each.update()
    return [[message for message, _ in each.messages] for each in inputs]


def test_all_comes_back_in_its_order_at_the_rate_that_is_asked_for(network: Network, node: Node, bag: Path) -> None:
    clock, odom, command = (
        node.subscribe(CLOCK),
        node.subscribe(ODOM, "/other/odom"),
        node.subscribe(CMD_VEL, "/r/cmd_vel"),
    )
    begun = time.monotonic()
    ended = play(network, bag, "--rate", "2", "--remap", "/r/odom:=/other/odom")
    assert ended.status == 0, ended.err
    assert time.monotonic() - begun >= 1.0, "two seconds at twice their speed"
    lines = list(drive_messages(2.0))
    clocks, odometry, commands = drained(clock, odom, command)
    assert odometry == [message for topic, message, _ in lines if topic == "/r/odom"]
    assert commands == [message for topic, message, _ in lines if topic == "/r/cmd_vel"]
    assert clocks == [message for topic, message, _ in lines if topic == "/clock"]
    assert "played 304 messages" in ended.err
    node.unregister(clock, odom, command)


def test_a_span_of_it_with_what_was_latched_before(network: Network, node: Node, bag: Path) -> None:
    clock, odom = node.subscribe(CLOCK), node.subscribe(ODOM, "/r/odom")
    described = node.subscribe(ROBOT_DESCRIPTION, "/r/robot_description")
    ended = play(network, bag, "--start", "1", "--duration", "0.5", "-r", "0", "--exclude", "^/clock", "--clock", "100")
    assert ended.status == 0, ended.err
    clocks, odometry, texts = drained(clock, odom, described)
    assert [each.header.stamp.ns for each in odometry] == [k * 20_000_000 for k in range(50, 76)]  # type: ignore[attr-defined]
    assert texts == [String(data="<robot/>")]
    assert [each.clock.ns for each in clocks] == [k * 10_000_000 for k in range(100, 151)]  # type: ignore[attr-defined]
    node.unregister(clock, odom, described)


def test_it_can_be_looped_paused_and_joined_late(network: Network, node: Node, bag: Path) -> None:
    clock = node.subscribe(CLOCK)
    player = network.start("player", "--param", f"bag={bag}", "--param", "loop=true", "--param", "rate=8")
    epochs: list[int] = []

    def past(epoch: int) -> bool:
        clock.update()
        epochs.extend(message.epoch for message, _ in clock.messages)
        return bool(epochs) and epochs[-1] >= epoch

    wait_until(lambda: past(2), 30, player.text)
    assert epochs == sorted(epochs)
    late = node.subscribe(ROBOT_DESCRIPTION, "/r/robot_description")
    wait_until(lambda: drained(late)[0] == [String(data="<robot/>")], 10, "the latched text")
    here = node.call(PAUSE, Empty())
    wait_until(lambda: (clock.update(), clock.messages and clock.messages[-1][0].paused)[1])
    assert clock.messages[-1][0].clock.ns == here.time
    node.call(RESUME, Empty())
    wait_until(lambda: (clock.update(), clock.messages and not clock.messages[-1][0].paused)[1])
    assert player.stop() == 0, player.text
    node.unregister(clock, late)


def test_beside_a_simulation_it_follows_its_time(network: Network, node: Node, bag: Path) -> None:
    out, odom = node.advertise(CLOCK), node.subscribe(ODOM, "/r/odom")
    own = node.subscribe(CLOCK)
    player = network.start("player", "--param", f"bag={bag}", "--param", "rate=2")
    wait_until(lambda: "publishes /clock" in player.text, 10, player.text)
    wait_until(
        lambda: node.transport.tokens(token_pattern("sub", "/player", CLOCK.name)), 10, "a player that hears the clock"
    )
    sent = heard = 0

    def so_far() -> int:
        odom.update()
        return len(odom.messages)

    while heard < 101:
        out.publish(Clock(clock=Time.of(sent * 20_000_000), tick=sent * 4))
        wanted = min(101, 2 * sent + 1)  # one at 0 s and one every 10 ms of simulation time
        sent += 1
        while heard < wanted:
            heard += wait_until(so_far, 10, f"odometry number {heard + 1} of {wanted}")
        assert heard == wanted, "ahead of the simulation's time"
    assert player.wait() == 0
    assert player.text.count("tester publishes /clock: the bag is played on its time") == 1
    assert len(drained(own)[0]) == sent, "no clock but the simulation's"
    refused = play(network, bag, "--lockstep", "/x")
    assert (refused.status, "replaces the simulation" in refused.err) == (2, True)
    node.unregister(out, odom, own)


def test_unknown_types_come_back_as_they_travelled(network: Network, node: Node, tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as made:
        for number in range(5):
            channel = raw_channel("/thing", "my_msgs/Thing", Quality.EVENT)
            made.write(channel, number + 1, START + number, number, b"\x81\xa1a" + bytes([number]))
    thing = node.subscribe(Topic("/thing", unknown_record("my_msgs/Thing"), 0, Quality.EVENT, ""), "/thing", bytes)
    assert play(network, tmp_path / "bag").status == 0
    assert drained(thing)[0] == [b"\x81\xa1a" + bytes([number]) for number in range(5)]
    node.unregister(thing)


def test_a_reset_is_a_new_epoch(network: Network, node: Node, tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as made:
        write_messages(made, drive_messages(0.1, epoch=0))
        write_messages(made, drive_messages(0.1, epoch=1), START + 10**9)
    clock = node.subscribe(CLOCK)
    assert play(network, tmp_path / "bag", "-r", "0").status == 0
    told = [(each.epoch, each.clock.ns // 20_000_000) for each in drained(clock)[0]]  # type: ignore[attr-defined]
    assert told == [(epoch, k) for epoch in (0, 1) for k in range(6)]
    node.unregister(clock)


def test_a_torn_bag_is_played_to_its_end_and_told(network: Network, node: Node, tmp_path: Path) -> None:
    whole = (make_bag(tmp_path / "bag", 0.2) / "bag_0.mcap").read_bytes()
    (tmp_path / "torn.mcap").write_bytes(whole[:-100])
    command = node.subscribe(CMD_VEL, "/r/cmd_vel")
    ended = play(network, tmp_path / "torn.mcap")
    assert (ended.status, "is truncated" in ended.err) == (1, True)
    assert drained(command)[0] == [Twist.planar(k / 100, 0.0) for k in range(11)]
    node.unregister(command)


def test_what_cannot_be_played_ends_with_a_reason(network: Network, bag: Path, tmp_path: Path) -> None:
    with (tmp_path / "foreign.mcap").open("wb") as stream:
        writer = McapWriter(stream)
        writer.start("ros2", "somebody")
        schema = writer.register_schema("sensor_msgs/msg/BatteryState", "ros2msg", b"12 wheels")
        writer.add_message(writer.register_channel("/battery", "cdr", schema), 1, b"\0\1\0\0" + bytes(4), 1)
        writer.finish()
    (tmp_path / "empty.mcap").touch()
    (tmp_path / "text.mcap").write_text("no bag at all")
    cases = [
        (
            (str(tmp_path / "foreign.mcap"),),
            2,
            "/battery: its schema cannot be read",
        ),
        ((str(tmp_path / "empty.mcap"),), 2, "is empty"),
        ((str(tmp_path / "text.mcap"),), 2, "not an MCAP file"),
        ((str(tmp_path / "nowhere"),), 2, "there is no bag"),
        ((str(bag), "--topics", "/r/odomm"), 2, "did you mean '/r/odom'?"),
        ((str(bag), "--start", "100"), 2, "no messages of the chosen topics in the requested time span"),
        ((str(bag), "--exclude", "("), 2, "not a regular expression"),
        ((str(bag), "--rate", "-1"), 2, "rate = -1.0"),
        ((str(bag), "--remap", "odom"), 2, "not a remapping rule"),
        ((str(bag), "--latency", "1"), 2, "--latency is for --lockstep"),
        ((str(bag), "--wait", "0.3"), 1, "no subscribers to"),
    ]
    for arguments, status, reason in cases:
        ended = CommandLine(tmp_path).run("bag", "play", *arguments, "--connect", network.endpoint)
        assert (ended.status, reason in ended.err) == (status, True), (arguments, ended)
        assert "Traceback" not in ended.err


@pytest.mark.parametrize(
    ("mode", "latency", "wanted"), [("lockstep", 1, 1), ("lockstep", 0, 0), ("real", 1, 0), ("lockstep", "one", 0)]
)
def test_a_bag_tells_the_latency_of_its_run(tmp_path: Path, mode: str, latency: int | str, wanted: int) -> None:
    values = tuple(Parameter(name=name, value=value) for name, value in (("mode", mode), ("latency", latency)))
    with BagWriter(tmp_path / "bag") as made:
        write_messages(
            made, [("/clock", Clock(), 0), (SIM_PARAMETER_UPDATES, ParameterValues(set="/sim", values=values), 0)]
        )
    assert recorded_latency(open_bag(tmp_path / "bag")) == wanted


def test_a_bag_of_others_tells_no_latency(bag: Path) -> None:
    assert recorded_latency(open_bag(bag)) is None
