"""The player's loop: selects and advertises topics, waits for subscribers, and publishes the messages in turn."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from messages.records import unknown_record
from messages.rosgraph import Clock
from messages.topics import CLOCK, TOPICS, Topic
from services.bag.channel import RAW, Channel
from services.bag.reader import Bag, open_bag, record_type
from services.player import PlayerParameters
from services.player.clocks import CLOCK_RATE, ClockPublisher, LockstepClock, PlaybackClock, SimClock, WallClock
from services.player.playback import (
    SIM_PARAMETER_UPDATES,
    Playback,
    Selection,
    TimedMessage,
    is_clock,
    recorded_latency,
    select,
)
from services.runtime.context import Context
from services.runtime.discovery import known_nodes
from services.runtime.errors import BadInput, EleaError
from services.runtime.graph import Entity, token_pattern
from services.runtime.node import Node
from services.runtime.publisher import Publisher
from services.runtime.transport.wire import publisher_id

_FLUSH_CYCLES = 3
"""Number of idle cycles of 0.1 s in which the last messages are sent."""


_DISCOVERY_S = 1.5
"""Wall time [s] to discover a running simulation: with two clocks, time would jump back and forth for all nodes."""


class PlaybackIncomplete(EleaError):
    """A part of the bag was not played, or topics had no subscribers."""


def run(ctx: Context[PlayerParameters]) -> None:
    """Play the bag; raises PlaybackIncomplete at the end if a part of it could not be played."""
    p, node = ctx.params, ctx.node
    bag = open_bag(Path(p.bag))
    selection = select(bag.channels(), p)
    for problem in bag.problems:
        ctx.log.warn(f"{problem}; what can be read is played")
    for topic, reason in sorted(selection.rejected.items()):
        ctx.log.warn(f"{topic} is not played: {reason}")
    other = _other_clock_publisher(node)
    if other and p.members:
        raise BadInput(f"{other} publishes /clock: a bag in lockstep replaces the simulation, so stop {other} first")
    if other:
        ctx.log.info(f"{other} publishes /clock: the bag is played on its time, and its own clock is left out")
    recorded = any(is_clock(channel) for channel in selection.played)
    clock_publisher = ClockPublisher(node, not other, p.clock or (0.0 if recorded else CLOCK_RATE))
    publishers = Publishers(node, [channel for channel in selection.played if not is_clock(channel)])
    playback_clock = _playback_clock(ctx, bag, bool(other), clock_publisher)
    _await_subscribers(ctx, publishers)
    playback = Playback(bag, selection, p.start, p.duration)
    _play(ctx, playback, playback_clock, clock_publisher, publishers)
    _check_complete(bag, selection, playback, playback_clock.lost if isinstance(playback_clock, LockstepClock) else ())


def _play(
    ctx: Context[PlayerParameters],
    playback: Playback,
    playback_clock: PlaybackClock,
    clock_publisher: ClockPublisher,
    publishers: Publishers,
) -> None:
    ctx.node.heartbeat.state = "running"
    while True:
        played = 0
        playback_clock.start()
        for timed in playback.messages():
            playback_clock.wait_until(timed.bag_time)
            ctx.now, played = clock_publisher.now.time, played + 1
            if isinstance(timed.message, Clock) and timed.channel not in publishers:
                clock_publisher.publish_recorded(timed.message, timed.bag_time)
            else:
                publishers.publish(timed)
        if not played:
            raise BadInput(f"{ctx.params.bag}: no messages of the chosen topics in the requested time span")
        ctx.log.info(f"played {played} messages")
        if not ctx.params.loop:
            break
        clock_publisher.restart()
    playback_clock.finish()
    for _ in range(_FLUSH_CYCLES):
        ctx.idle()


def _playback_clock(
    ctx: Context[PlayerParameters], bag: Bag, follows: bool, clock_publisher: ClockPublisher
) -> PlaybackClock:
    p = ctx.params
    if p.members:
        latency = p.latency if p.latency is not None else recorded_latency(bag)
        if latency is None:
            latency = 0
            ctx.log.info(f"{p.bag} does not contain {SIM_PARAMETER_UPDATES}, which has the latency of its run: using 0")
        return LockstepClock(ctx.node, p.members, p.rate, clock_publisher, latency)
    return SimClock(ctx, p.rate) if follows else WallClock(ctx.node, p.rate, clock_publisher)


def _other_clock_publisher(node: Node) -> str:
    """Return the node that already publishes simulation time; empty if none is found within _DISCOVERY_S."""
    known = known_nodes(node.transport)
    deadline = time.monotonic() + _DISCOVERY_S
    is_complete = False
    while True:
        found = (Entity.parse(key) for key in node.transport.tokens(token_pattern("pub", name=CLOCK.name)))
        others = [each.node for each in found if each is not None and each.session != node.transport.session]
        if others or time.monotonic() > deadline:
            return next(iter(others), "")
        if not is_complete and known is not None and known <= set(node.transport.tokens(token_pattern("node"))):
            is_complete, deadline = True, min(deadline, time.monotonic() + node.transport.settle_s)
        node.spin_once()
        time.sleep(0.05)


def _await_subscribers(ctx: Context[PlayerParameters], publishers: Publishers) -> None:
    """Wait until every named topic has a subscriber, or any topic if none is named."""
    p, node = ctx.params, ctx.node
    if not p.wait:
        return
    deadline = time.monotonic() + p.wait
    while True:
        found = (Entity.parse(key) for key in node.transport.tokens(token_pattern("sub")))
        subscribed = {each.name for each in found if each is not None and each.session != node.transport.session}
        unmatched = [
            each.name for each in publishers.publishers if each.name not in subscribed and not _has_subscriber(each)
        ]
        if not unmatched or (not p.topics and len(unmatched) < len(publishers.publishers)):
            return
        if time.monotonic() > deadline:
            raise PlaybackIncomplete(f"no subscribers to {', '.join(unmatched[:5])} within {p.wait:g} s")
        ctx.idle()


def _has_subscriber(output: Publisher[Any]) -> bool:
    """Return whether a publisher has subscribers; False for latched ones, which always report some."""
    return output.has_subscribers and output.topic.quality.name != "LATCHED"


def _check_complete(bag: Bag, selection: Selection, playback: Playback, lost: tuple[str, ...]) -> None:
    problems = list(bag.problems)
    if lost:
        problems.append(f"lockstep continued without {', '.join(lost)}")
    problems += [
        f"{count} messages of {topic} do not match their type" for topic, count in playback.undecodable.items()
    ]
    problems += [
        f"{count} messages of {topic} have a time after 2038" for topic, count in playback.out_of_range.items()
    ]
    if selection.rejected:
        problems.append(f"not played: {', '.join(sorted(selection.rejected))}")
    if problems:
        raise PlaybackIncomplete("; ".join(problems))


class Publishers:
    """The publishers of ``channels``; a late subscriber gets the last message of every recorded node, as in the run."""

    def __init__(self, node: Node, channels: list[Channel]) -> None:
        self._node = node
        self._topics = {channel: _topic(channel) for channel in channels}
        self._publishers = {(channel, b""): node.advertise(topic) for channel, topic in self._topics.items()}

    def __contains__(self, channel: Channel) -> bool:
        return channel in self._topics

    @property
    def publishers(self) -> list[Publisher[Any]]:
        """The first publisher of each channel."""
        return [self._publishers[channel, b""] for channel in self._topics]

    def publish(self, timed: TimedMessage) -> None:
        """Publish a message on its channel, with the publisher of its sender."""
        output = self._publishers.get((timed.channel, timed.sender)) or self._add(timed.channel, timed.sender)
        if isinstance(timed.message, bytes):
            output.publish_encoded(timed.message)
        else:
            output.publish(timed.message)

    def _add(self, channel: Channel, sender: bytes) -> Publisher[Any]:
        """Add a publisher for another sender, with an id and sequence numbers of its own."""
        node, topic = self._node, self._topics[channel]
        name, key, own = node.identity.resolve(topic.name), node.identity.key(topic.name), node.identity.node
        made = Publisher(topic, name, key, own, node.transport, node.send_buffer)
        made.publisher = publisher_id(own, node.transport.session, f"{key} {sender.hex()}")
        node.publishers.append(made)
        self._publishers[channel, sender] = made
        return made


def _topic(channel: Channel) -> Topic[Any]:
    known = record_type(channel) if channel.encoding != RAW else None
    record = known if known is not None else unknown_record(channel.type)
    largest = max((each.largest for each in TOPICS if each.record is record), default=1 << 16)
    return Topic(channel.name, record, 0, channel.quality, "", largest)
