"""Sidecar records: what a message carries beyond its ROS 2 type, recorded in a message before it."""

from __future__ import annotations

from typing import Annotated, ClassVar

from msgspec import Meta

from messages.base import Count, Message
from messages.rosgraph import DEBUG, ERROR, FATAL, INFO, WARN, Clock, Log
from messages.std import Header, String, Time

LEVELS = {DEBUG: 10, INFO: 20, WARN: 30, ERROR: 40, FATAL: 50}
"""ROS 2's log levels by those of ROS 1, which the bus uses."""
_LEVELS = {ours: level for level, ours in LEVELS.items()}

Level = Annotated[int, Meta(ge=0, le=255)]


class RosLog(Message, frozen=True, kw_only=True):
    """A ROS 2 log message."""

    ROS_TYPE: ClassVar[str] = "rcl_interfaces/Log"
    stamp: Time = Time()
    level: Level = 20
    name: str = ""
    msg: str = ""
    file: str = ""
    function: str = ""
    line: Annotated[int, Meta(ge=0, le=2**32 - 1)] = 0


class LogExtra(Message, frozen=True, kw_only=True):
    """The fields that ROS 2's log message lacks."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/LogExtra"
    level: Level = INFO
    frame_id: str = ""
    topics: tuple[str, ...] = ()


class ClockExtra(Message, frozen=True, kw_only=True):
    """The fields that ROS's clock lacks."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/ClockExtra"
    tick: Count = 0
    epoch: Count = 0
    paused: bool = False


class StringExtra(Message, frozen=True, kw_only=True):
    """The original text, if a different one is recorded for ROS 2's tools."""

    ROS_TYPE: ClassVar[str] = "elea_msgs/StringExtra"
    data: str = ""


EXTRAS: dict[type[Message], type[Message]] = {Clock: ClockExtra, Log: LogExtra, String: StringExtra}
"""The sidecar of each record that has one."""

ROS_RECORDS: dict[type[Message], type[Message]] = {Log: RosLog}
"""The record that replaces another one in ROS 2."""


def split(message: Message) -> tuple[Message, Message | None]:
    """Split a message into its ROS 2 form and its sidecar, None if it needs none."""
    match message:
        case Clock():
            return message, ClockExtra(tick=message.tick, epoch=message.epoch, paused=message.paused)
        case Log(header=header, level=level):
            line = RosLog(
                stamp=header.stamp,
                level=LEVELS.get(level, level),
                name=message.name,
                msg=message.msg,
                file=message.file,
                function=message.function,
                line=message.line,
            )
            if level in LEVELS and not header.frame_id and not message.topics:
                return line, None
            return line, LogExtra(level=level, frame_id=header.frame_id, topics=message.topics)
        case _:
            return message, None


def join(message: Message, extra: Message | None) -> Message:
    """Restore the message as on the bus from the parts that ``split`` returned."""
    match message, extra:
        case Clock(clock=time), ClockExtra(tick=tick, epoch=epoch, paused=paused):
            return Clock(clock=time, tick=tick, epoch=epoch, paused=paused)
        case String(), StringExtra(data=text):
            return String(data=text)
        case RosLog() as line, _:
            beside = extra if isinstance(extra, LogExtra) else LogExtra(level=_LEVELS.get(line.level, line.level))
            return Log(
                header=Header(stamp=line.stamp, frame_id=beside.frame_id),
                level=beside.level,
                name=line.name,
                msg=line.msg,
                file=line.file,
                function=line.function,
                line=line.line,
                topics=beside.topics,
            )
        case _:
            return message
