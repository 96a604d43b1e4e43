"""A recorded lab: every message once, the same for all readers, viewable, and giving the same commands on playback."""

from __future__ import annotations

import json
import signal
from collections import Counter, defaultdict
from pathlib import Path

import matplotlib.image
import msgspec
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rerun.chunk import Chunk, RrdReader
from rosbags.highlevel import AnyReader

from deploy.fleet_file import read_fleet
from messages.base import Message
from messages.cdr.sidecar import split
from messages.elea import FleetState
from messages.names import Identity
from messages.parameters import ParameterValues
from messages.requests import SUPERVISOR_STOP, Name
from messages.std import String
from messages.tf import TFMessage
from messages.topics import CLOCK, FLEET_STATE, ROBOT_DESCRIPTION
from models.palette import colours
from services.bag.info import BagInfo
from services.bag.reader import MessageDecoder, open_bag
from services.catalog import load_service
from services.logger.viewer import convert_bag
from services.recorder.urdf_prefix import prefix_links
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.step import STEP_NS
from services.runtime.transport.unix_sockets import router_endpoint
from services.runtime.transport.zenoh import ZenohTransport
from services.runtime.transport.zenoh_config import configuration
from tests.harness.command_line import CommandLine
from tests.harness.processes import Network
from tests.harness.waiting import wait_until
from tests.messages.ros_values import assert_same, ros_view
from tests.system.short_fleets import short_lab, without_logger

SECONDS = 3
OPTIONS = ("--record", "--no-view", "--no-picture")
ROBOTS = ("tb3_0", "tb3_1", "tb3_2", "tb3_3", "p3dx")
SAMPLES = 8
"""Number of messages of each topic that are compared field by field: the independent readers take 1 ms for each."""


class Recorded:
    """The run, its bag, and the bag's messages as read by our own reader."""

    def __init__(self, terminal: CommandLine, results: Path) -> None:
        self.terminal, self.bag = terminal, results / "bag"
        self.log = (results / "logs" / "recorder.log").read_text()
        typed = MessageDecoder()
        self.entries = list(open_bag(self.bag).entries())
        self.messages = [(entry, typed.decode(entry)) for entry in self.entries]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    terminal = CommandLine(tmp_path_factory.mktemp("bag"))
    fleet, results = short_lab(terminal.folder / "lab.toml"), terminal.folder / "run"
    text = without_logger(fleet)
    assert "latency = 1" in text
    assert 'ends = "goals"' in text
    fleet.write_text(text.replace('ends = "goals"', 'ends = "never"'))
    process = terminal.start(*("up", str(fleet), "--port", str(terminal.port)), *("--report", str(results), *OPTIONS))
    try:
        stop_recorder(router_endpoint(terminal.port))
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=300)
    finally:
        process.kill()
    # The laps are not whole, unless this process stood still meanwhile.
    assert process.returncode == (0 if json.loads((results / "report.json").read_text())["ok"] else 1), err
    assert "lockstep" in out, err
    assert "ended with an error" not in err
    return Recorded(terminal, results)


def stop_recorder(endpoint: str) -> None:
    """End the recording while all nodes still run: what controllers publish at their end is no response to an input."""
    identity = Identity.of("tester")
    with (
        ZenohTransport(configuration("direct", (endpoint,))) as transport,
        Node(transport, identity, "tester", Log(identity.node)) as node,
    ):
        clock = node.subscribe(CLOCK)
        wait_until(
            lambda: (clock.update(), clock.messages and clock.messages[-1][0].clock.ns > SECONDS * 10**9)[1],
            90.0,
            "time",
        )
        node.call(SUPERVISOR_STOP, Name(name="recorder"), 60.0)
        states = node.subscribe(FLEET_STATE)
        wait_until(lambda: (states.update(), [each for each, _ in states.messages if _ended(each)])[1], 30.0, "its end")


def _ended(fleet: FleetState) -> bool:
    return any(each.name == "recorder" and each.state == "stopped" for each in fleet.processes)


def test_every_message_is_there_once(recorded: Recorded) -> None:
    info = msgspec.json.decode(recorded.terminal.run("bag", "info", str(recorded.bag), "--json").out, type=BagInfo)
    assert (info.lost, info.unwritten, info.troubles) == ({}, 0, ())
    told = {each.topic: each for each in info.topics}
    times = defaultdict(list)
    for entry in recorded.entries:
        times[entry.channel.topic].append(entry.publish_time)
    for name in ROBOTS:
        for topic in (f"/{name}/{each}" for each in ("odom", "ground_truth", "joint_states", "cmd_vel")):
            rate = 25 if name.startswith("tb3") else 50
            # A message in transit when the recording ended belongs to no tick and no period.
            for found, expected in (
                (times[topic], told[topic].rate),
                ([t for t in times[topic] if t % STEP_NS == 0], rate),
            ):
                assert (len(found) - 1) / (max(found) - min(found)) * 1e9 == pytest.approx(expected, rel=0.001), topic
    assert told["/clock"].rate == pytest.approx(50)
    assert told["/tf_static"].latched
    assert all(each.playable for each in info.topics)
    numbers = defaultdict(list)
    for entry in recorded.entries:
        numbers[entry.channel.topic].append(entry.sequence)
    for topic in (f"/{name}/{each}" for name in ROBOTS for each in ("odom", "scan", "cmd_vel")):
        assert numbers[topic] == list(range(1, len(numbers[topic]) + 1)), topic


def test_two_other_readers_find_the_same_in_every_type(recorded: Recorded) -> None:
    wanted = defaultdict(list)
    for entry, message in recorded.messages:
        if message is not None and len(wanted[entry.channel.topic]) < SAMPLES:
            namespace, _, name = entry.channel.topic.strip("/").rpartition("/")
            if name == ROBOT_DESCRIPTION.name and isinstance(message, String):
                message = String(data=prefix_links(message.data, f"{namespace}/"))
            wanted[entry.channel.topic].append(ros_view(split(message)[0]))
    compared: Counter[str] = Counter()
    with AnyReader([recorded.bag]) as reader:
        assert reader.message_count == len(recorded.entries)
        for connection, _, data in reader.messages():
            at = compared[connection.topic]
            if connection.topic in wanted and at < SAMPLES:
                assert_same(wanted[connection.topic][at], reader.deserialize(data, connection.msgtype))
                compared[connection.topic] += 1
    assert compared.keys() == wanted.keys()
    again: Counter[str] = Counter()
    with next(recorded.bag.glob("*.mcap")).open("rb") as stream:
        found = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in found.iter_decoded_messages(log_time_order=False):
            if channel.topic in wanted and again[channel.topic] < SAMPLES:
                assert_same(wanted[channel.topic][again[channel.topic]], message)
                again[channel.topic] += 1
    assert again == compared


def test_the_viewer_opens_it(recorded: Recorded, tmp_path: Path) -> None:
    """Unmodified, through the viewer's own importer: frames, joints, poses, bodies and log become displayable."""
    convert_bag(sorted(recorded.bag.glob("*.mcap")), tmp_path / "own.rrd")
    chunks = list(RrdReader(tmp_path / "own.rrd").stream())
    entities = {str(each.entity_path) for each in chunks}
    assert {"/tf", "/tb3_0/joint_states", "/tb3_0/plan", "/rosout"} <= entities, entities
    told = [message for _, message in recorded.messages if isinstance(message, TFMessage)]
    frames = {each.child_frame_id for message in told for each in message.transforms}
    for robot in (*ROBOTS, "arm"):
        shapes = [each for each in chunks if str(each.entity_path).startswith(f"/{robot}/visual_geometries/")]
        hung = {frame for each in shapes for frame in column(each, "CoordinateFrame:frame")}
        assert len(hung) > 1, robot
        assert hung <= frames, f"{robot}: each shape hangs on a frame that is told of"


def column(chunk: Chunk, name: str) -> list[str]:
    rows = chunk.to_record_batch()
    return [value for row in rows.column(name).to_pylist() for value in row] if name in rows.schema.names else []


def test_view_makes_a_picture_of_it(recorded: Recorded, tmp_path: Path) -> None:
    ended = recorded.terminal.run("view", str(recorded.bag), "--picture", "-o", str(tmp_path))
    if not any(Path("/usr/share/vulkan/icd.d").glob("*.json")):
        assert (ended.status, "libvulkan1 mesa-vulkan-drivers" in ended.err) == (2, True)
        return
    assert ended.status == 0, ended.err
    pixels = np.rint(matplotlib.image.imread(Path(ended.out.strip()))[:, :, :3] * 255).astype(int)
    world = pixels[:, :1000]
    for name, colour in colours((*ROBOTS, "arm")).items():
        if name == "arm":
            continue  # it has no trail
        assert (np.abs(world - colour).max(axis=2) < 12).sum() > 40, name


def test_played_back_it_makes_the_same_commands(recorded: Recorded, tmp_path: Path) -> None:
    """Real controllers, fed with the recorded messages in lockstep, give the same commands bit for bit, tick for tick.

    The arm's reference runs with it, so its efforts repeat only with the lab's latency, which is 1 in its file.
    """
    schedule = [msgspec.to_builtins(each) for each in read_fleet(recorded.terminal.folder / "lab.toml").change]
    members: dict[str, dict[str, object]] = {"/params": {"schedule": schedule}}
    for node in ("/tb3_1/waypoint", "/p3dx/square", "/arm/reference", "/arm/arm"):
        members[node] = stated(recorded, node)
    played = ("/clock", "/tb3_1/odom", "/p3dx/odom", "/p3dx/ground_truth", "/arm/joint_states")
    commands = ["/tb3_1/cmd_vel", "/p3dx/cmd_vel", "/arm/joint_effort"]
    with Network(tmp_path) as network:
        for node, parameters in members.items():
            namespace, _, kind = node.rpartition("/")
            wait = () if kind == "params" else ("--await-params",)
            network.start(kind, "--lockstep", "--namespace", namespace or "/", *wait, *options(parameters))
        again: dict[str, object] = {"output": str(tmp_path / "again"), "topics": commands, "members": list(members)}
        recorder = network.start("recorder", "--lockstep", *options(again))
        ended = recorded.terminal.run(
            *("bag", "play", str(recorded.bag), *(word for each in played for word in ("--topics", each))),
            *("--lockstep", ",".join((*members, "/recorder")), "--connect", network.endpoint),
        )
        assert ended.status == 0, ended.err
        assert recorder.stop() == 0, recorder.text
    for topic, rate in zip(commands, (25, 50, 100), strict=True):
        before, after = told(recorded.bag, topic), told(tmp_path / "again", topic)
        assert len(before) >= SECONDS * rate
        assert len({data for _, data in before}) > SECONDS
        assert [each for each in after if each[0] <= before[-1][0]] == before, topic


def stated(recorded: Recorded, node: str) -> dict[str, object]:
    """Return a node's parameters from the lab's file and its model, as published at the start of the run."""
    service = load_service(node.rpartition("/")[2])
    name = f"{service.parameter_set or node}/parameter_updates"
    first = next(each for entry, each in recorded.messages if entry.channel.topic == name)
    assert isinstance(first, ParameterValues)
    own = service.parameters.__struct_fields__
    return {each.name: each.value for each in first.values if each.origin == "fleet" and each.name in own}


def options(parameters: dict[str, object]) -> list[str]:
    return [word for name, value in parameters.items() for word in ("--fleet-param", f"{name}={json.dumps(value)}")]


def told(bag: Path, topic: str) -> list[tuple[int, bytes]]:
    """Return time [ns] and bytes of each command that took effect at a tick.

    Messages in transit at the end are in the bag, too, with times after its last tick that are no step's.
    """
    found = [(each.publish_time, each.data) for each in open_bag(bag).entries() if each.channel.topic == topic]
    return [each for each in found if each[0] % STEP_NS == 0]


def test_nothing_is_lost_between_bus_and_bag(recorded: Recorded) -> None:
    """Each message decodes to its own type; fields without a place in the type would have been counted."""
    assert "no place" not in recorded.log
    kinds = {type(message) for _, message in recorded.messages if message is not None}
    assert len(kinds) >= 14
    assert all(issubclass(kind, Message) for kind in kinds)
