"""Prepares a bag's messages for playback: selects topics, decodes, assigns bag times, and limits the time span."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from messages.base import Message, WrongPayload
from messages.elea import FleetState, Health
from messages.geometry import TransformStamped
from messages.parameters import ParameterSchema, ParameterValues
from messages.rosgraph import Clock
from messages.tf import TFMessage
from messages.topics import CLOCK, TF_STATIC
from services.bag.channel import RAW, Channel
from services.bag.reader import Bag, BagTime, MessageDecoder, Timeline, is_sidecar, unplayable_reason, unreadable_reason
from services.player import PlayerParameters
from services.runtime.errors import BadInput, unknown_name

PROCESS_TYPES = frozenset(each.ROS_TYPE for each in (Health, FleetState, ParameterSchema, ParameterValues))
"""Types about the processes of the recorded run: played only if their topics are named."""


class Selection(NamedTuple):
    """Channels to play, all sidecars, and for other topics the reasons why they cannot be played."""

    played: tuple[Channel, ...]
    sidecars: tuple[Channel, ...]
    rejected: dict[str, str]


def select(channels: Iterable[Channel], params: PlayerParameters) -> Selection:
    """Select the channels to play; raises BadInput for names that are not in the bag, and if nothing is left."""
    channels = list(channels)
    if not channels:
        raise BadInput(f"{params.bag} holds no messages")
    known = {channel.name for channel in channels if not is_sidecar(channel)}
    names = {name if name.startswith("/") else f"/{name}" for name in params.topics}
    for name in sorted(names - known):
        raise unknown_name("topic", name, known, params.bag)
    excluded = _compile(params.exclude)
    played: list[Channel] = []
    types: dict[str, str] = {}
    refused: dict[str, str] = {}
    for channel in channels:
        topic = channel.name
        if is_sidecar(channel) or (names and topic not in names) or (excluded and excluded.search(topic)):
            continue
        if not names and channel.type in PROCESS_TYPES:
            continue
        if reason := unplayable_reason(channel):
            refused[topic] = reason
        elif types.setdefault(topic, channel.type) != channel.type:
            refused[topic] = (
                f"it is played as {types[topic]}; its messages of type {channel.type} are not: a topic has one type"
            )
        else:
            played.append(channel)
    if not played:
        reasons = "; ".join(f"{topic}: {reason}" for topic, reason in sorted(refused.items()))
        raise BadInput(f"nothing of {params.bag} can be played: {reasons or 'no topic is chosen'}")
    return Selection(tuple(played), tuple(channel for channel in channels if is_sidecar(channel)), refused)


def is_clock(channel: Channel) -> bool:
    """Return whether a channel carries simulation time."""
    return channel.name == CLOCK.name and channel.type == CLOCK.record.ROS_TYPE


def _compile(text: str) -> re.Pattern[str] | None:
    try:
        return re.compile(text) if text else None
    except re.error as error:
        raise BadInput(f"player, exclude: {text!r} is not a regular expression: {error}") from None


class StaticTransforms:
    """Merges the messages on ``/tf_static`` by child frame, so that late subscribers get all frames."""

    def __init__(self) -> None:
        self._by_child: dict[str, TransformStamped] = {}

    def merge(self, message: TFMessage) -> TFMessage:
        """Return the message with all frames of earlier ones; its own transforms take precedence."""
        self._by_child |= {each.child_frame_id.removeprefix("/"): each for each in message.transforms}
        return TFMessage(transforms=tuple(self._by_child.values()))


SIM_PARAMETER_UPDATES = "/sim/parameter_updates"
"""Topic of a simulation's parameters, included in a fleet's recording unless excluded."""


def recorded_latency(bag: Bag) -> int | None:
    """Return the recorded run's latency in ticks, 0 or 1 (0 also without lockstep); None if the bag lacks it."""
    if not any(each.name == SIM_PARAMETER_UPDATES and not unreadable_reason(each) for each in bag.channels()):
        return None
    decoder = MessageDecoder()
    for entry in bag.entries():
        if entry.channel.name != SIM_PARAMETER_UPDATES:
            continue
        try:
            message = decoder.decode(entry)
        except WrongPayload:
            continue
        if isinstance(message, ParameterValues):
            values = {each.name: each.value for each in message.values}
            return int(values.get("mode") == "lockstep" and values.get("latency") == 1)
    return None


MAX_TIME_NS = (2**31 - 1) * 10**9
"""The latest time of a ``builtin_interfaces/Time``, in the year 2038."""


class TimedMessage(NamedTuple):
    """A message and its bag time; ``message`` is the payload if its type is unknown.

    ``sender`` distinguishes the nodes on one latched topic; it is empty for the first one.
    """

    bag_time: BagTime
    channel: Channel
    message: Message | bytes
    sender: bytes = b""


class Playback:
    """Reads ``bag`` any number of times, from ``start`` [s] on and for ``duration`` [s], to the end if that is 0.

    ``undecodable`` counts messages that do not match their type, ``out_of_range`` those after MAX_TIME_NS, by topic.
    """

    def __init__(self, bag: Bag, selection: Selection, start: float, duration: float) -> None:
        self._bag, self._selection = bag, selection
        self._start, self._end = round(start * 1e9), round((start + duration) * 1e9) if duration else None
        self._start_passed = False
        self.undecodable: Counter[str] = Counter()
        self.out_of_range: Counter[str] = Counter()

    def messages(self) -> Iterator[TimedMessage]:
        """Yield the selected messages from ``start`` on, preceded by those latched before it."""
        latched: dict[tuple[Channel, bytes], TimedMessage] = {}
        first: BagTime | None = None
        for timed in self._all():
            if self._end is not None and timed.bag_time.position > self._end:
                break
            if timed.bag_time.position < self._start:
                if timed.channel.quality.name == "LATCHED":
                    latched[timed.channel, timed.sender] = timed
                continue
            if first is None:
                first = timed.bag_time
                yield from (each._replace(bag_time=first) for each in latched.values())
            yield timed
        if first is None and self._start_passed:
            yield from latched.values()

    def _all(self) -> Iterator[TimedMessage]:
        timeline, decoder, static_transforms = Timeline(), MessageDecoder(), StaticTransforms()
        chosen, needed = set(self._selection.played), {*self._selection.played, *self._selection.sidecars}
        for entry in self._bag.entries():
            if entry.publish_time > MAX_TIME_NS:
                self.out_of_range[entry.channel.name] += 1
                continue
            if entry.channel not in needed:
                self._start_passed = timeline.locate(entry.publish_time).position >= self._start
                continue
            message: Message | bytes | None = entry.data
            if entry.channel.encoding != RAW:
                try:
                    message = decoder.decode(entry)
                except WrongPayload:
                    self.undecodable[entry.channel.name] += 1
                    continue
            epoch = message.epoch if isinstance(message, Clock) else None
            bag_time = timeline.locate(entry.publish_time, epoch)
            if message is None or entry.channel not in chosen:
                continue
            if isinstance(message, TFMessage) and entry.channel.name == TF_STATIC.name and not self._bag.from_elea:
                message = static_transforms.merge(message)
            yield TimedMessage(bag_time, entry.channel, message, decoder.sender(entry))
