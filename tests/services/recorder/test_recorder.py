"""The recorder as a real process: the topics that it records, a kill that costs at most a second, and a full disk."""

from __future__ import annotations

import json
import time
from collections import Counter
from pathlib import Path

import pytest
from rosbags.highlevel import AnyReader

from messages.base import encode
from messages.elea import InterfaceDefinition, InterfaceDefinitions
from messages.geometry import Twist
from messages.records import unknown_record
from messages.rosgraph import Clock
from messages.std import String, Time
from messages.topics import CLOCK, CMD_VEL, INTERFACES, ODOM, ROBOT_DESCRIPTION, Quality, Topic
from services.bag.reader import Entry, MessageDecoder, open_bag
from services.recorder import RecorderParameters
from services.recorder.bag_recorder import PublishTimes, receive_time
from services.recorder.subscriptions import TopicFilter
from services.runtime.errors import BadInput
from services.runtime.node import Node
from tests.harness.cases import case
from tests.harness.command_line import CommandLine
from tests.harness.processes import Network, Process
from tests.harness.waiting import wait_until

LIMITED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))
sys.argv[0] = "recorder"
from services.recorder import SERVICE
from services.runtime.main import main
main(SERVICE)
"""
"""A recorder with a file size limit: the kernel fails its writes as on a full disk."""

SHORT_OF_SPACE = """
import resource
from dataclasses import replace
from services.recorder import SERVICE
from services.recorder.loop import run as record
from services.runtime.main import main

def run(ctx):
    resource.setrlimit(resource.RLIMIT_FSIZE, (80_000, 80_000))
    record(ctx)

main(replace(SERVICE, run=run))
"""
FLEET = """
name = "f"
[run]
ends = "goals"
duration = 30
[[robot]]
name = "r"
model = "burger"
services = [{ kind = "waypoint", parameters = { goals = [[0.8, 0.0]] } }]
"""
FLEET_OF_MODE = """
name = "f"
[run]
mode = "{mode}"
ends = "never"
[[robot]]
name = "r"
model = "burger"
"""


def record(network: Network, node: Node, folder: Path, *options: str) -> Process:
    """Start a recorder and wait until it has subscribed to everything that the node publishes."""
    process = network.start("recorder", "--name", f"r{time.time_ns()}", "--param", f"output={folder}", *options)
    wait_until(lambda: "recording to" in process.text or process.status is not None, what=process.text)
    return process


def heard(node: Node, *topics: str) -> bool:
    return all(each.has_subscribers for each in node.publishers if each.name in topics)


def read(path: Path) -> list[Entry]:
    return list(open_bag(path).entries())


def held(path: Path, *topics: str) -> int:
    """Return how many messages of each of these topics a bag has at least, also while it is recorded."""
    counts = Counter(each.channel.topic for each in read(path))
    return min(counts[topic] for topic in topics)


def test_it_takes_up_all_that_there_is_and_what_comes_later(network: Network, node: Node, tmp_path: Path) -> None:
    strange = Topic("/strange", unknown_record("my_msgs/Thing"), 0, Quality.EVENT, "")
    # With the qualities of CLOCK and CMD_VEL, the publisher may drop messages when its sending thread gets no CPU, and
    # a command may overtake the clock before it.
    clock = node.advertise(Topic(CLOCK.name, Clock, CLOCK.rate, Quality.EVENT, ""))
    early = node.advertise(ROBOT_DESCRIPTION, "/r/robot_description")
    early.publish(String(data="<robot/>"))
    raw = node.advertise(strange, "/strange")
    told = node.advertise(INTERFACES)
    told.publish(InterfaceDefinitions(definitions=(InterfaceDefinition(type="walk/Step", text="float32 length\n"),)))
    step = node.advertise(Topic("/step", unknown_record("walk/Step"), 0, Quality.EVENT, ""))
    with record(network, node, tmp_path / "bag", "--param", "exclude=(health|rosout)$") as process:
        wait_until(lambda: heard(node, "/clock", "/strange", "/step"))
        # Latched topics arrive by a query of their own: without the first, the recorder does not know walk/Step.
        wait_until(lambda: held(tmp_path / "bag", "/interfaces", "/r/robot_description") >= 1, 20.0, process.text)
        late = node.advertise(Topic(CMD_VEL.name, Twist, CMD_VEL.rate, Quality.EVENT, ""), "/r/cmd_vel")
        wait_until(lambda: late.has_subscribers)
        for tick in range(1, 51):
            clock.publish(Clock(clock=Time.of(tick * 20_000_000), tick=tick * 4))
            late.publish(Twist.planar(tick / 100, 0.0))
            raw.publish_encoded(b"\x81\xa1a" + bytes([tick]))
            step.publish_encoded(encode({"length": tick / 2}))
            time.sleep(0.002)
        many = "/clock", "/r/cmd_vel", "/strange", "/step"
        wait_until(lambda: held(tmp_path / "bag", *many) == 50, 20.0, process.text)
        assert process.stop() == 0, process.text
    found, typed = read(tmp_path / "bag"), MessageDecoder()
    of = {each.channel.topic: [e for e in found if e.channel == each.channel] for each in found}
    others = {"/r/robot_description", "/r/cmd_vel", "/strange", "/step", "/interfaces"}
    assert set(of) == {"/clock", "/clock/_elea", *others}
    assert [typed.decode(each) for each in of["/r/cmd_vel"]] == [Twist.planar(k / 100, 0.0) for k in range(1, 51)]
    assert [each.publish_time for each in of["/r/cmd_vel"]] == [k * 20_000_000 for k in range(1, 51)]
    assert [each.data[-1] for each in of["/strange"]] == list(range(1, 51))
    with AnyReader([tmp_path / "bag"]) as reader:  # an announced type has its own schema and CDR
        [channel] = [each for each in reader.connections if each.topic == "/step"]
        lengths = [reader.deserialize(data, channel.msgtype).length for _, _, data in reader.messages([channel])]
    assert (channel.msgtype, lengths) == ("walk/msg/Step", [tick / 2 for tick in range(1, 51)])
    assert getattr(typed.decode(of["/step"][1]), "length") == 1.0  # noqa: B009 - a record of its own schema
    assert of["/r/robot_description"][0].channel.quality is Quality.LATCHED
    assert "/strange is my_msgs/Thing, which is unknown here" in process.text
    times = [each.log_time for each in found]
    assert times == sorted(times)
    node.unregister(clock, early, raw, late, told, step)


def test_a_killed_recorder_has_lost_a_second_at_most(network: Network, node: Node, tmp_path: Path) -> None:
    """What it receives is on the disk without any more messages; ``bag/test_files.py`` has the time that this takes."""
    out = node.advertise(Topic(ODOM.name, ODOM.record, ODOM.rate, Quality.EVENT, ""), "/k/odom")
    with record(network, node, tmp_path / "bag", "--param", 'topics=["/k/odom"]') as process:
        wait_until(lambda: out.has_subscribers)
        for _ in range(50):
            out.publish(ODOM.record())
        wait_until(lambda: held(tmp_path / "bag", "/k/odom") == 50, 20.0, process.text)
        for _ in range(50):
            out.publish(ODOM.record())
        process.kill()
    node.unregister(out)
    bag = open_bag(tmp_path / "bag")
    found = list(bag.entries())
    assert [each.sequence for each in found] == list(range(1, len(found) + 1))
    assert len(found) >= 50
    assert "truncated" in bag.problems[0]
    terminal = CommandLine(tmp_path)
    shown = terminal.run("bag", "info", str(tmp_path / "bag"))
    assert (shown.status, "truncated" in shown.err) == (1, True)
    mended = terminal.run("bag", "export", str(tmp_path / "bag"), "--to", "rosbag2", "-o", "mended")
    assert mended.status == 0, mended.err
    with AnyReader([tmp_path / "mended"]) as reader:
        assert reader.message_count == len(found)


def test_a_full_disk_stops_nothing_and_is_told(tmp_path: Path) -> None:
    robot = '[{"name":"r","model":"burger"}]'
    members = '["/r/waypoint","/recorder"]'
    with Network(tmp_path) as network, network.node() as node:
        simulation = network.start(
            "sim",
            "--lockstep",
            *("--param", f"robots={robot}", "--param", "mode=lockstep", "--param", f"members={members}"),
        )
        network.start("waypoint", "--lockstep", "--namespace", "/r", "--param", "goals=[[100,0]]")
        command = [
            "-c",
            LIMITED.format(limit=200_000),
            *("--connect", network.endpoint, "--lockstep", "--param", f"output={tmp_path / 'bag'}"),
            *("--param", 'members=["/r/waypoint"]'),
        ]
        clock, odometry = node.subscribe(CLOCK), node.subscribe(ODOM, "/r/odom")
        with Process(command, tmp_path / "recorder.log") as recorder:
            wait_until(lambda: "the recording cannot be written" in recorder.text, 60, recorder.text)
            since = wait_until(lambda: (clock.update(), clock.messages)[1], 30)[-1][0].clock.ns

            def later() -> bool:
                odometry.update()
                return bool(odometry.messages) and odometry.messages[-1][0].header.stamp.ns > since + 2 * 10**9

            wait_until(later, 30, "odometry of two seconds later")
            assert odometry.messages[-1][0].twist.twist.linear.x == pytest.approx(0.22, abs=0.01), "the robot drives on"
            assert recorder.status is None
            # Not later: on a busy machine, a member's token may be gone long before its last report arrives.
            assert "gone" not in simulation.text
            assert recorder.stop() == 1, recorder.text
    assert "messages are missing from" in recorder.text
    bag = open_bag(tmp_path / "bag")
    found = list(bag.entries())
    numbers = [each.sequence for each in found if each.channel.topic == "/r/odom"]
    assert numbers
    assert numbers == sorted(set(numbers)), "whole chunks, each once"
    assert all((tmp_path / "bag" / each.name).stat().st_size <= 200_000 for each in (tmp_path / "bag").iterdir())


def test_a_run_whose_bag_is_not_whole_says_so(tmp_path: Path) -> None:
    """The run itself isn't affected: its report says that all checks hold."""
    terminal = CommandLine(tmp_path)
    (tmp_path / "limited.py").write_text(SHORT_OF_SPACE)
    fleet = tmp_path / "fleet.toml"
    fleet.write_text(FLEET + '[[service]]\nkind = "limited.py"\nparameters = { output = "bag", resume = true }\n')
    ended = terminal.run_fleet(fleet, tmp_path / "run", "--no-saved")
    assert ended.status == 1, ended.err
    assert "recorder ended with an error" in ended.err
    assert "messages are missing from" in ended.err
    assert json.loads((tmp_path / "run" / "report.json").read_text())["ok"] is True


def test_a_recording_begins_with_the_run(tmp_path: Path) -> None:
    begun = {}
    for mode in ("real", "lockstep"):
        (folder := tmp_path / mode).mkdir()
        fleet = folder / "fleet.toml"
        fleet.write_text(FLEET_OF_MODE.format(mode=mode))
        line = CommandLine(folder)
        begun[mode] = line, line.start_fleet(fleet, folder / "run", "--record", "--duration", "0.5")
    for mode, (line, process) in begun.items():
        with case(mode):
            ended = line.finish(process)
            assert ended.status == 0, ended.err
            found, typed, first = read(tmp_path / mode / "run" / "bag"), MessageDecoder(), {}
            for each in found:
                first.setdefault(each.channel.topic, (each.sequence, each.publish_time))
            for topic in ("/clock", "/tf", "/r/odom", "/r/ground_truth", "/r/joint_states", "/r/scan"):
                assert first[topic] == (1, 0), topic
            assert first["/r/imu"] == (1, 10_000_000), "one step is needed for a specific force"
            clock = next(typed.decode(each) for each in found if each.channel.topic == "/clock")
            assert clock == Clock()


def test_which_topics_are_recorded() -> None:
    def choose(**given: object) -> TopicFilter:
        return TopicFilter(RecorderParameters(**given), lambda name: name if name[0] == "/" else f"/r/{name}")  # type: ignore[arg-type]

    names = ("/clock", "/r/odom", "/r/scan", "/q/odom")
    assert [each for each in names if each in choose()] == list(names)
    assert [each for each in names if each in choose(topics=("odom",))] == ["/r/odom"]
    both = choose(topics=("/clock",), regex="/odom$")
    assert [each for each in names if each in both] == ["/clock", "/r/odom", "/q/odom"]
    assert [each for each in names if each in choose(exclude="^/r")] == ["/clock", "/q/odom"]
    with pytest.raises(BadInput, match=r"regex: '\(' is not a regular expression"):
        choose(regex="(")


def test_simulated_time_is_the_stamp_near_the_clock_and_else_the_clock() -> None:
    times, odom = PublishTimes(), ODOM.record
    assert times.publish_time(Twist(), 77, has_clock=False) == 77, "without a clock, the wall's"
    assert times.publish_time(Twist(), 77, has_clock=True) == 0, "before the first clock, the beginning"
    assert times.publish_time(Clock(clock=Time.of(5 * 10**9)), 78, has_clock=True) == 5 * 10**9
    assert times.publish_time(Twist(), 79, has_clock=True) == 5 * 10**9
    assert times.publish_time(Clock(clock=Time(sec=-3)), 80, has_clock=True) == 0, (
        "no bag holds a time before the beginning"
    )
    times.publish_time(Clock(clock=Time.of(5 * 10**9)), 80, has_clock=True)
    stamped = [odom(header=type(odom().header)(stamp=Time.of(at))) for at in (5 * 10**9 - 7, 10**9, 9 * 10**9)]
    assert [times.publish_time(each, 80, has_clock=True) for each in stamped] == [5 * 10**9 - 7, 5 * 10**9, 5 * 10**9]


@pytest.mark.parametrize(("source", "wanted"), [(None, 20), (15, 15), (5, 10), (25, 20)])
def test_a_message_came_when_it_was_sent_or_at_the_bounds_of_what_can_be(source: int | None, wanted: int) -> None:
    assert receive_time(source, 10, 20) == wanted
