"""Late joiners of a replay get the last message of every node that latched a topic, as in the run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer

from messages.base import Message
from messages.cdr.write import writer
from messages.geometry import Transform, TransformStamped, Vector3
from messages.std import Header, String
from messages.tf import TFMessage
from messages.topics import ROBOT_DESCRIPTION, TF_STATIC, Quality
from services.bag.channel import channel_of
from services.bag.info import bag_info
from services.bag.reader import Entry, is_sidecar, open_bag
from services.bag.writer import BagWriter
from services.player import PlayerParameters
from services.player.playback import Playback, TimedMessage, select
from services.runtime.node import Node
from services.runtime.subscriber import Subscriber
from tests.harness.command_line import CommandLine
from tests.harness.processes import Network
from tests.harness.waiting import wait_until
from tests.services.bag.sample_bags import START, TYPESTORE

pytestmark = pytest.mark.waits


def frames(x: float, *names: str) -> TFMessage:
    """Return transforms of frames ``x`` [m] ahead of the world's origin."""
    at = Transform(translation=Vector3(x=x))
    return TFMessage(
        transforms=tuple(
            TransformStamped(header=Header(frame_id="world"), child_frame_id=name, transform=at) for name in names
        )
    )


def recorded(network: Network, bag: Path) -> None:
    """Record a bag of two nodes that latch two topics, one of them restarted; it ends after two quiet hours, so that a
    replay at ten times the rate outlasts any late start.
    """
    text = "/twice/robot_description"
    recorder = network.start("recorder", "--param", f"output={bag}", "--param", f'topics=["/tf_static", "{text}"]')
    wait_until(lambda: "recording to" in recorder.text, what=recorder.text)
    with network.node("right") as right:
        with network.node("left") as left:
            left.advertise(TF_STATIC).publish(frames(1.0, "left/base"))
            left.advertise(ROBOT_DESCRIPTION, text).publish(String(data="first of /left"))
            wait_until(lambda: len(_held(bag)) == 2, 20.0, "the first messages in the bag")
            right.advertise(TF_STATIC).publish(frames(2.0, "right/base"))
            right.advertise(ROBOT_DESCRIPTION, text).publish(String(data="first of /right"))
            wait_until(lambda: len(_held(bag)) == 4, 20.0, "those of the other node, too")
        with network.node("left") as left:
            left.advertise(TF_STATIC).publish(frames(3.0, "left/base"))
            left.advertise(ROBOT_DESCRIPTION, text).publish(String(data="last of /left"))
            wait_until(lambda: len(_held(bag)) == 6, 20.0, "the last messages in the bag")
    assert recorder.stop() == 0, recorder.text
    last = _held(bag)[-1]
    with BagWriter(bag, resume=True) as made:
        later = last.log_time + 7200 * 10**9, last.publish_time + 7200 * 10**9
        made.write(channel_of("/end", String, Quality.EVENT), 1, *later, writer(String)(String(data="end")))


def _held(bag: Path) -> list[Entry]:
    return [each for each in open_bag(bag).entries() if not is_sidecar(each.channel)]


def test_who_joins_a_replay_late_gets_the_last_of_every_node(network: Network, node: Node, tmp_path: Path) -> None:
    recorded(network, tmp_path / "bag")
    held = {each.topic: each.messages for each in bag_info(open_bag(tmp_path / "bag")).topics}
    assert (held["/tf_static"], held["/twice/robot_description"]) == (3, 3)
    with AnyReader([tmp_path / "bag"]) as reader:
        read = [(each.topic, reader.deserialize(data, each.msgtype)) for each, _, data in reader.messages()]
    assert [topic for topic, _ in read].count("/tf_static/_sender") == 1, (
        "of the second node; the first one is not noted"
    )
    fixed, texts = heard(node)
    options = "--param", f"bag={tmp_path / 'bag'}", "--param", "rate=10", "--param", "wait=60"
    player = network.start("player", *options)
    wait_until(lambda: (fixed.take(), len(fixed.found) == 3)[1], 20.0, player.text)
    wait_until(lambda: (texts.take(), len(texts.found) == 3)[1], 20.0, player.text)
    with network.node("late") as late:
        again, others = heard(late)
        wait_until(lambda: (again.take(), len(again.found) == 2)[1], 20.0, "the frames of both nodes")
        wait_until(lambda: (others.take(), len(others.found) == 2)[1], 20.0, "the texts of both nodes")
        assert set(again.found) == {frames(3.0, "left/base"), frames(2.0, "right/base")}
        assert set(others.found) == {String(data="last of /left"), String(data="first of /right")}
    told = CommandLine(tmp_path).run("topic", "info", "-v", "/tf_static", "--connect", network.endpoint, "--json")
    assert [each["node"] for each in json.loads(told.out)["publishers"]] == ["/player", "/player"], "one for each node"
    assert player.stop() == 0, player.text


class ReceivedMessages:
    """All messages of a topic."""

    def __init__(self, source: Subscriber[Any]) -> None:
        self._source = source
        self.found: list[Message] = []

    def take(self) -> None:
        self._source.update()
        self.found += [message for message, _ in self._source.messages]


def heard(node: Node) -> tuple[ReceivedMessages, ReceivedMessages]:
    return ReceivedMessages(node.subscribe(TF_STATIC)), ReceivedMessages(
        node.subscribe(ROBOT_DESCRIPTION, "/twice/robot_description")
    )


def foreign(folder: Path, *messages: TFMessage) -> Path:
    """Write a bag as rosbag2 does, without any identification of publishers."""
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        fixed = bag.add_connection("/tf_static", "tf2_msgs/msg/TFMessage", typestore=TYPESTORE)
        for number, message in enumerate(messages):
            bag.write(fixed, START + number * 10**9, writer(TFMessage)(message))
    return folder


def test_fixed_frames_of_a_foreign_bag_are_joined(tmp_path: Path) -> None:
    said = frames(1.0, "a"), frames(2.0, "b", "c"), frames(3.0, "/a")
    bag = open_bag(foreign(tmp_path / "ros", *said))
    choice = select(bag.channels(), PlayerParameters(bag=str(bag.path)))

    def played(start: float) -> list[TimedMessage]:
        return list(Playback(bag, choice, start, 0.0).messages())

    (_, _, whole) = (cue.message for cue in played(0.0))
    assert isinstance(whole, TFMessage)
    found = {each.child_frame_id: each.transform.translation.x for each in whole.transforms}
    assert found == {"/a": 3.0, "b": 2.0, "c": 2.0}
    assert [cue.message for cue in played(2.0)][-1] == whole, "also for who starts later"
