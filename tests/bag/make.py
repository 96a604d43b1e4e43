"""Small bags for tests."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from messages.base import Message
from messages.cdr.extras import split
from messages.cdr.write import writer
from messages.geometry import Twist
from messages.nav import Odometry
from messages.rosgraph import Clock
from messages.std import Header, String, Time
from messages.topics import Quality
from services.bag.channel import BESIDE, channel_of
from services.bag.folder import BagFolder

START = 1_700_000_000_000_000_000
"""Wall time [ns] at which a bag begins."""
STEP = 20_000_000
"""Time between two messages of a topic, ns."""

Line = tuple[str, Message, int]
"""Topic, message and simulated time [ns]."""


def drive(seconds: float, epoch: int = 0) -> Iterator[Line]:
    """A clock at 50 Hz, an odometry that moves, its command, and a description that is latched."""
    for tick in range(round(seconds * 1e9) // STEP + 1):
        now = tick * STEP
        yield "/clock", Clock(clock=Time.of(now), tick=tick * 4, epoch=epoch), now
        if not tick:
            yield "/r/robot_description", String(data="<robot/>"), now
        stamp = Header(stamp=Time.of(now), frame_id="r/odom")
        yield "/r/odom", Odometry(header=stamp, child_frame_id="r/base"), now
        yield "/r/cmd_vel", Twist.planar(tick / 100, 0.0), now


def quality(topic: str) -> Quality:
    return Quality.LATCHED if topic.endswith("description") else Quality.SENSOR


def put(bag: BagFolder, lines: Iterator[Line] | list[Line], begin: int = START) -> None:
    """Write lines as the recorder does, in real time."""
    for number, (topic, message, now) in enumerate(lines, start=1):
        main, beside = split(message)
        for each, name in ((beside, topic + BESIDE), (main, topic)):
            if each is not None:
                channel = channel_of(name, type(each), quality(topic))
                bag.add(channel, number, begin + now, now, writer(type(each))(each))


def make_bag(folder: Path, seconds: float = 2.0) -> Path:
    """A bag of ``drive``."""
    with BagFolder(folder) as bag:
        put(bag, drive(seconds))
    return folder
