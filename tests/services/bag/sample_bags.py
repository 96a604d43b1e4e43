"""Small bags for tests: written by this project, and by rosbags in the format of ROS 2."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from messages.base import Message
from messages.cdr.sidecar import split
from messages.cdr.write import writer
from messages.geometry import Twist
from messages.nav import Odometry
from messages.rosgraph import Clock
from messages.std import Header, String, Time
from messages.topics import Quality
from services.bag.channel import SIDECAR, channel_of
from services.bag.writer import BagWriter

START = 1_700_000_000_000_000_000
"""Wall time [ns] of a bag's start."""
STEP = 20_000_000
"""Time between two messages of a topic [ns]."""

BagMessage = tuple[str, Message, int]
"""Topic, message and simulation time [ns]."""


def drive_messages(seconds: float, epoch: int = 0) -> Iterator[BagMessage]:
    """Yield a clock at 50 Hz, odometry of a motion, its command, and a latched robot description."""
    for tick in range(round(seconds * 1e9) // STEP + 1):
        now = tick * STEP
        yield "/clock", Clock(clock=Time.of(now), tick=tick * 4, epoch=epoch), now
        if not tick:
            yield "/r/robot_description", String(data="<robot/>"), now
        stamp = Header(stamp=Time.of(now), frame_id="r/odom")
        yield "/r/odom", Odometry(header=stamp, child_frame_id="r/base"), now
        yield "/r/cmd_vel", Twist.planar(tick / 100, 0.0), now


def quality_of(topic: str) -> Quality:
    return Quality.LATCHED if topic.endswith("description") else Quality.SENSOR


def write_messages(bag: BagWriter, lines: Iterator[BagMessage] | list[BagMessage], begin: int = START) -> None:
    """Write messages as the recorder does, in real time."""
    for number, (topic, message, now) in enumerate(lines, start=1):
        main, beside = split(message)
        for each, name in ((beside, topic + SIDECAR), (main, topic)):
            if each is not None:
                channel = channel_of(name, type(each), quality_of(topic))
                bag.write(channel, number, begin + now, now, writer(type(each))(each))


def make_bag(folder: Path, seconds: float = 2.0) -> Path:
    """Write a bag of ``drive_messages`` and return its folder."""
    with BagWriter(folder) as bag:
        write_messages(bag, drive_messages(seconds))
    return folder


TYPESTORE = get_typestore(Stores.ROS2_JAZZY)


def make_rosbag2_bag(folder: Path) -> Path:
    """Write a bag with rosbags, as ROS 2 would, and return its folder."""
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        twist = writer.add_connection("/cmd_vel", "geometry_msgs/msg/Twist", typestore=TYPESTORE)
        log = writer.add_connection("/rosout", "rcl_interfaces/msg/Log", typestore=TYPESTORE)
        battery = writer.add_connection("/battery", "sensor_msgs/msg/BatteryState", typestore=TYPESTORE)
        types = TYPESTORE.types
        vector, time = types["geometry_msgs/msg/Vector3"], types["builtin_interfaces/msg/Time"]
        move = types["geometry_msgs/msg/Twist"](linear=vector(x=0.5, y=0, z=0), angular=vector(x=0, y=0, z=-1))
        line = types["rcl_interfaces/msg/Log"](
            stamp=time(sec=3, nanosec=4), level=30, name="n", msg="careful", file="f", function="g", line=7
        )
        for number in range(3):
            writer.write(twist, START + number * 10**8, TYPESTORE.serialize_cdr(move, "geometry_msgs/msg/Twist"))
        writer.write(log, START + 5, TYPESTORE.serialize_cdr(line, "rcl_interfaces/msg/Log"))
        writer.write(battery, START + 6, b"\0\1\0\0" + bytes(100))
    return folder
