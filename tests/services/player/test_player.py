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


def await_no_clock(node: Node) -> None:
    """Wait until the player before has left the network: the next one would wait for its clock."""
    wait_until(lambda: not node.transport.tokens(token_pattern("pub", name=CLOCK.name)), what="no publisher of /clock")


def play(network: Network, node: Node, bag: Path, *options: str) -> CommandResult:
    await_no_clock(node)
    return CommandLine(bag.parent).run("bag", "play", str(bag), "--connect", network.endpoint, *options)


def drained(*inputs: Subscriber[object]) -> list[list[object]]:
    for each in inputs:
        each.update()
    return [[message for message, _ in each.messages] for each in inputs]


def received(source: Subscriber[object], count: int) -> list[object]:
    """Wait for ``count`` messages and return all: the last may still be on their way when the player has ended."""
    found: list[object] = []

    def enough() -> bool:
        found.extend(drained(source)[0])
        return len(found) >= count

    wait_until(enough, 20.0, f"{count} messages on {source.name}")
    return found


def test_all_comes_back_in_its_order_at_the_rate_that_is_asked_for(
    network: Network, node: Node, tmp_path: Path
) -> None:
    """The bag is so short that the queue of a player whose sending thread gets no processor holds it all."""
    bag = make_bag(tmp_path / "bag", 1.0)
    clock, odom, command = (
        node.subscribe(CLOCK),
        node.subscribe(ODOM, "/other/odom"),
        node.subscribe(CMD_VEL, "/r/cmd_vel"),
    )
    begun = time.monotonic()
    ended = play(network, node, bag, "--rate", "0.8", "--remap", "/r/odom:=/other/odom")
    assert ended.status == 0, ended.err
    assert time.monotonic() - begun >= 1.25, "a second at four fifths of its speed"
    lines = list(drive_messages(1.0))
    assert received(odom, 51) == [message for topic, message, _ in lines if topic == "/r/odom"]
    assert received(command, 51) == [message for topic, message, _ in lines if topic == "/r/cmd_vel"]
    assert received(clock, 51) == [message for topic, message, _ in lines if topic == "/clock"]
    assert "played 154 messages" in ended.err
    node.unregister(clock, odom, command)


def test_a_span_of_it_with_what_was_latched_before(network: Network, node: Node, bag: Path) -> None:
    clock, odom = node.subscribe(CLOCK), node.subscribe(ODOM, "/r/odom")
    described = node.subscribe(ROBOT_DESCRIPTION, "/r/robot_description")
    span = "--start", "1", "--duration", "0.5"
    ended = play(network, node, bag, *span, "-r", "0", "--exclude", "^/clock", "--clock", "100")
    assert ended.status == 0, ended.err
    stamps = [each.header.stamp.ns for each in received(odom, 26)]  # type: ignore[attr-defined]
    assert stamps == [k * 20_000_000 for k in range(50, 76)]
    assert received(described, 1) == [String(data="<robot/>")]
    times = [each.clock.ns for each in received(clock, 51)]  # type: ignore[attr-defined]
    assert times == [k * 10_000_000 for k in range(100, 151)]
    node.unregister(clock, odom, described)


def test_it_can_be_looped_paused_and_joined_late(network: Network, node: Node, bag: Path) -> None:
    await_no_clock(node)
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
    here = node.call(PAUSE, Empty(), timeout=60.0)
    wait_until(lambda: (clock.update(), clock.messages and clock.messages[-1][0].paused)[1])
    assert clock.messages[-1][0].clock.ns == here.time
    node.call(RESUME, Empty(), timeout=60.0)
    wait_until(lambda: (clock.update(), clock.messages and not clock.messages[-1][0].paused)[1])
    assert player.stop() == 0, player.text
    node.unregister(clock, late)


def test_beside_a_simulation_it_follows_its_time(network: Network, node: Node, bag: Path) -> None:
    await_no_clock(node)
    out, odom = node.advertise(CLOCK), node.subscribe(ODOM, "/r/odom")
    own = node.subscribe(CLOCK)
    # It knows of the clock at once, perhaps before it knows of the subscription to its first message.
    awaits = "--param", 'topics=["/r/odom"]', "--param", "wait=60"
    player = network.start("player", "--param", f"bag={bag}", "--param", "rate=2", *awaits)
    wait_until(lambda: "publishes /clock" in player.text, 20, player.text)
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
    at = "--connect", network.endpoint
    refused = CommandLine(bag.parent).run("bag", "play", str(bag), *at, "--lockstep", "/x")
    assert (refused.status, "replaces the simulation" in refused.err) == (2, True)
    node.unregister(out, odom, own)


def test_unknown_types_come_back_as_they_travelled(network: Network, node: Node, tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as made:
        for number in range(5):
            channel = raw_channel("/thing", "my_msgs/Thing", Quality.EVENT)
            made.write(channel, number + 1, START + number, number, b"\x81\xa1a" + bytes([number]))
    thing = node.subscribe(Topic("/thing", unknown_record("my_msgs/Thing"), 0, Quality.EVENT, ""), "/thing", bytes)
    assert play(network, node, tmp_path / "bag").status == 0
    assert received(thing, 5) == [b"\x81\xa1a" + bytes([number]) for number in range(5)]
    node.unregister(thing)


def test_a_reset_is_a_new_epoch(network: Network, node: Node, tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as made:
        write_messages(made, drive_messages(0.1, epoch=0))
        write_messages(made, drive_messages(0.1, epoch=1), START + 10**9)
    clock = node.subscribe(CLOCK)
    assert play(network, node, tmp_path / "bag", "-r", "0").status == 0
    told = [(each.epoch, each.clock.ns // 20_000_000) for each in received(clock, 12)]  # type: ignore[attr-defined]
    assert told == [(epoch, k) for epoch in (0, 1) for k in range(6)]
    node.unregister(clock)


def test_a_torn_bag_is_played_to_its_end_and_told(network: Network, node: Node, tmp_path: Path) -> None:
    whole = (make_bag(tmp_path / "bag", 0.2) / "bag_0.mcap").read_bytes()
    (tmp_path / "torn.mcap").write_bytes(whole[:-100])
    command = node.subscribe(CMD_VEL, "/r/cmd_vel")
    ended = play(network, node, tmp_path / "torn.mcap")
    assert (ended.status, "is truncated" in ended.err) == (1, True)
    assert received(command, 11) == [Twist.planar(k / 100, 0.0) for k in range(11)]
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
