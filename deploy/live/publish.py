"""Publishes messages from the command line: typed, numbered, stamped with simulation time, at a rate."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from deploy import INTERRUPTED
from deploy.interfaces import known_topic, record_by_type
from deploy.live.connect import cli_node, spin, user_and_host
from deploy.live.learned_types import record_on_network
from deploy.live.message_builder import MessageBuilder, split_type
from deploy.live.message_format import to_flow_yaml, truncate
from deploy.live.output import write_json, write_note, write_text
from deploy.live.subscribers import ClockSubscriber
from deploy.live.topics import TopicEndpoints, absolute_name, group_by_topic, is_hidden, topic_type
from messages.base import Message
from messages.names import key as key_of
from messages.plain import plain_record
from messages.topics import CLOCK, E_STOP, Quality, Topic
from services.runtime.errors import BadInput, EleaError, did_you_mean
from services.runtime.graph import snapshot
from services.runtime.light_node import LightNode
from services.runtime.network_address import NetworkAddress
from services.runtime.publisher import Publisher
from services.runtime.transport.api import TICKER_S, idle_subscriber

_CLOCK_TIMEOUT_S = 10.0
"""Wall time [s] to wait for the first /clock, if it is published."""
_SETTLE_S = 0.3
"""Wall time for the links to subscribers to come up that the graph already shows."""


@dataclass(frozen=True)
class PublishRequest:
    """The messages to publish: ``values``, preceded by the type if given; ``rate`` [Hz]; ``count``, 0 for no limit."""

    topic: str
    values: tuple[str, ...] = ()
    rate: float | None = None
    count: int = 0
    min_subscribers: int = 0
    timeout: float | None = None
    stamped: bool = True
    wall_time: bool = False
    keep_alive: float = 0.1


def publish(address: NetworkAddress, asked: PublishRequest, show: str = "text") -> int:
    """Publish until ``count`` or a signal; return the exit status.

    ``show`` is ``text``, ``json`` or empty. Raises EleaError.
    """
    name = absolute_name(asked.topic)
    # The user is the holder of a stop, not this process, which ends: the user's next command can release it.
    with cli_node(address, "pub", user_and_host() if known_topic(name) is E_STOP else "") as live:
        graph = snapshot(live.transport)
        known = group_by_topic(graph)
        ends = known.get(name, TopicEndpoints(name))
        record_on_network(live.transport, split_type(asked.values)[0] or topic_type(ends))
        record, values = _resolve_type(name, ends, asked.values, known)
        draft = MessageBuilder(record, values, asked.stamped)
        quality = _resolve_quality(name, ends)
        topic = Topic(name, record, 0.0, quality, "")
        live.declare_publication(name, record.ROS_TYPE, quality.name)
        output = Publisher(topic, name, key_of(name), live.node, live.transport)
        clock = ClockSubscriber(live.transport)
        fitting = [each.name for each in known.values() if each.subscribers and record.ROS_TYPE in each.types]
        if not ends.subscribers and (hint := did_you_mean(name, fitting)):
            write_note(f"no subscribers to {name}{hint}")
        if not _wait_for_subscribers(live, output, name, asked):
            return INTERRUPTED
        if any(each.name == CLOCK.name for each in graph if each.kind == "pub"):
            _wait_for_clock(live, clock)
        if draft.needs_clock and clock.now is None:
            write_note("there is no /clock: headers are stamped with 0")
        sent = _send(live, output, draft, clock, asked, _resolve_rate(asked, name, quality), show)
        _keep_alive(live, clock, asked.keep_alive)
    return INTERRUPTED if asked.count and sent < asked.count else 0


def _resolve_type(
    name: str, ends: TopicEndpoints, values: tuple[str, ...], known: Iterable[str]
) -> tuple[type[Message], list[str]]:
    """Return the record, from the words, the graph or the table of topics, and the remaining words; raises BadInput."""
    topic, types = known_topic(name), [each for each in ends.types if each != "-"]
    declared = types[0] if types else "" if topic is None else topic.record.ROS_TYPE
    type_name, words = split_type(values)
    if type_name:
        record = record_by_type(type_name)
        if types and record.ROS_TYPE not in types:
            raise BadInput(
                f"{name} carries {' and '.join(types)}, not {record.ROS_TYPE}: its subscribers would reject it"
            )
        return record, words
    if not declared:
        near = did_you_mean(name, known)
        raise BadInput(f"the type of {name} is unknown{near}: give it before the values, e.g. geometry_msgs/Twist")
    return record_by_type(declared), words


def _resolve_quality(name: str, ends: TopicEndpoints) -> Quality:
    """Return the quality of the topic's other endpoints, else that in the table of topics, else reliable delivery."""
    for each in (*ends.subscribers, *ends.publishers):
        if each.detail in Quality.__members__ and not is_hidden(each.node):
            return Quality[each.detail]
    topic = known_topic(name)
    return topic.quality if topic is not None else Quality.EVENT


def _resolve_rate(asked: PublishRequest, name: str, quality: Quality) -> float:
    """Return the rate [Hz]; 0 for a single message that is held."""
    if asked.rate is not None:
        return asked.rate
    if quality is Quality.LATCHED and not asked.count:
        return 0.0
    topic = known_topic(name)
    return topic.rate if topic is not None and quality is Quality.COMMAND and topic.rate else 1.0


def _wait_for_subscribers(live: LightNode, output: Publisher[Any], name: str, asked: PublishRequest) -> bool:
    """Wait for subscribers; return False if interrupted. Raises EleaError if they do not appear in time."""
    started, noted = time.monotonic(), False
    inlet = idle_subscriber(live.transport)
    settled = started + _SETTLE_S
    for _ in spin(live, inlet):
        now = time.monotonic()
        count = len(group_by_topic(snapshot(live.transport)).get(name, TopicEndpoints(name)).subscribers)
        if count >= asked.min_subscribers and (output.has_subscribers or now > settled or not count):
            break
        if output.has_subscribers and asked.min_subscribers == 1:
            break  # a foreign subscriber, which the graph does not show
        if asked.timeout is not None and now - started > asked.timeout:
            found = f"{count} of {asked.min_subscribers} subscribers of {name} appeared"
            raise EleaError(f"{found} within {asked.timeout:g} s")
        if not noted and now - started > 1.0:
            noted = True
            write_note(
                f"waiting for {asked.min_subscribers} subscriber(s) of {name}, {count} there (-w 0 does not wait)"
            )
        inlet.recv()
    inlet.close()
    return not live.stopping


def _wait_for_clock(live: LightNode, clock: ClockSubscriber) -> None:
    for _ in spin(live, clock.raw, _CLOCK_TIMEOUT_S):
        clock.update()
        if clock.now is not None:
            return


def _send(
    live: LightNode,
    output: Publisher[Any],
    draft: MessageBuilder,
    clock: ClockSubscriber,
    asked: PublishRequest,
    rate: float,
    show: str,
) -> int:
    """Publish at the rate, in simulation time if it runs; return the number sent."""
    simulated = clock.now is not None and not asked.wall_time
    period = 1.0 / rate if rate else float("inf")
    sent, due, epoch, noted = 0, 0.0, clock.epoch, False
    for _ in spin(live, clock.raw):
        clock.update()
        if clock.epoch != epoch:
            due, epoch = 0.0, clock.epoch
        while not live.stopping and not (asked.count and sent >= asked.count):
            now = (clock.now or 0) / 1e9 if simulated else time.monotonic()
            ahead = due - now
            if ahead > 1e-9:
                if simulated or ahead > TICKER_S:
                    break
                time.sleep(ahead)
                clock.update()
                continue
            message = draft.build(clock.now or 0)
            output.publish(message)
            sent += 1
            _show(message, show, sent)
            # After this process was suspended, missed messages are not sent.
            due = due + period if sent > 1 and due + 5 * period > now else now + period
        if asked.count and sent >= asked.count:
            break
        if simulated and clock.paused and rate and not noted:
            noted = True
            write_note(
                "simulation time is paused, so no more is published (use --wall-time to publish by the wall clock)"
            )
    return sent


def _show(message: Message, show: str, number: int) -> None:
    if show == "json":
        write_json(plain_record(message), lines=True)
    elif show:
        write_text(f"publishing #{number}: {to_flow_yaml(truncate(plain_record(message), 16))}\n", flush=True)


def _keep_alive(live: LightNode, clock: ClockSubscriber, seconds: float) -> None:
    for _ in spin(live, clock.raw, seconds):
        clock.update()
