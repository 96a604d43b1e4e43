"""Publishing what a person types: typed, numbered, stamped with simulation time, at a rate."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from deploy.live.clock import SimClock
from deploy.live.ends import Ends, absolute, is_hidden, nearest, topics
from deploy.live.known import record_of, topic_of
from deploy.live.measure import INTERRUPTED
from deploy.live.output import note, say, say_json
from deploy.live.session import Session, person, session
from deploy.live.text import flow, trimmed
from deploy.live.values import Draft, split_type
from deploy.place import Place
from messages.base import Message
from messages.names import key as key_of
from messages.plain import plain_record
from messages.topics import CLOCK, E_STOP, Quality, Topic
from services.runtime.errors import BadInput, EleaError
from services.runtime.graph import snapshot
from services.runtime.network.transport import BEAT_S, resting
from services.runtime.outputs import Output

_CLOCK_S = 2.0
"""Wall time that the first /clock has, where somebody publishes it."""
_SETTLE_S = 0.3
"""Wall time in which links to subscribers come up that the graph shows already."""


@dataclass(frozen=True)
class Publication:
    """What is to be sent: ``values`` begin with the type, if it is given. ``rate`` [Hz], ``count`` 0 for no end."""

    topic: str
    values: tuple[str, ...] = ()
    rate: float | None = None
    count: int = 0
    matching: int = 0
    timeout: float | None = None
    stamped: bool = True
    wall_time: bool = False
    keep_alive: float = 0.1


def publish(place: Place, asked: Publication, show: str = "text") -> int:
    """Send until it is enough; the exit status. ``show`` is ``text``, ``json`` or empty. Raises EleaError."""
    name = absolute(asked.topic)
    # A stop is held by the person, whose next command resets it, and not by this process, which is gone by then.
    with session(place, "pub", person() if topic_of(name) is E_STOP else "") as live:
        graph = snapshot(live.transport)
        known = topics(graph)
        ends = known.get(name, Ends(name))
        record, values = _typed(name, ends, asked.values, known)
        draft = Draft(record, values, asked.stamped)
        quality = _quality(name, ends)
        topic = Topic(name, record, 0.0, quality, "")
        live.writes(name, record.ROS_TYPE, quality.name)
        output = Output(topic, name, key_of(name), live.node, live.transport)
        clock = SimClock(live.transport)
        fitting = [each.name for each in known.values() if each.subscribers and record.ROS_TYPE in each.types]
        if not ends.subscribers and (hint := nearest(name, fitting)):
            note(f"nobody subscribes to {name}{hint}")
        if not _matched(live, output, name, asked):
            return INTERRUPTED
        if any(each.name == CLOCK.name for each in graph if each.kind == "pub"):
            _await_clock(live, clock)
        if draft.timed and clock.now is None:
            note("there is no /clock: headers are stamped with 0")
        sent = _send(live, output, draft, clock, asked, _rate(asked, name, quality), show)
        _linger(live, clock, asked.keep_alive)
    return INTERRUPTED if asked.count and sent < asked.count else 0


def _typed(name: str, ends: Ends, values: tuple[str, ...], known: Iterable[str]) -> tuple[type[Message], list[str]]:
    """The record, by the words, the graph or the table of topics, and the words that are left; raises BadInput."""
    topic, types = topic_of(name), [each for each in ends.types if each != "-"]
    declared = types[0] if types else "" if topic is None else topic.record.ROS_TYPE
    type_name, words = split_type(values)
    if type_name:
        record = record_of(type_name)
        if types and record.ROS_TYPE not in types:
            raise BadInput(f"{name} carries {' and '.join(types)}, not {record.ROS_TYPE}: its readers would refuse it")
        return record, words
    if not declared:
        near = nearest(name, known)
        raise BadInput(
            f"nobody tells the type of {name}{near} (a new topic needs it before the values, as geometry_msgs/Twist)"
        )
    return record_of(declared), words


def _quality(name: str, ends: Ends) -> Quality:
    """The quality that the others on the topic have, else that of the table, else every one arrives."""
    for each in (*ends.subscribers, *ends.publishers):
        if each.detail in Quality.__members__ and not is_hidden(each.node):
            return Quality[each.detail]
    topic = topic_of(name)
    return topic.quality if topic is not None else Quality.EVENT


def _rate(asked: Publication, name: str, quality: Quality) -> float:
    """Messages per second; 0 for one that is held."""
    if asked.rate is not None:
        return asked.rate
    if quality is Quality.LATCHED and not asked.count:
        return 0.0
    topic = topic_of(name)
    return topic.rate if topic is not None and quality is Quality.COMMAND and topic.rate else 1.0


def _matched(live: Session, output: Output[Any], name: str, asked: Publication) -> bool:
    """Wait for subscribers; False when it was interrupted. Raises EleaError when they do not come in time."""
    started, told = time.monotonic(), False
    inlet = resting(live.transport)
    settled = started + _SETTLE_S
    for _ in live.turns(inlet):
        now = time.monotonic()
        count = len(topics(snapshot(live.transport)).get(name, Ends(name)).subscribers)
        if count >= asked.matching and (output.wanted or now > settled or not count):
            break
        if output.wanted and asked.matching == 1:
            break  # a foreign subscriber, which the graph does not show
        if asked.timeout is not None and now - started > asked.timeout:
            raise EleaError(f"{count} of {asked.matching} subscribers of {name} came within {asked.timeout:g} s")
        if not told and now - started > 1.0:
            told = True
            note(f"waiting for {asked.matching} subscriber(s) of {name}, {count} there (-w 0 does not wait)")
        inlet.take()
    inlet.close()
    return not live.stopping


def _await_clock(live: Session, clock: SimClock) -> None:
    for _ in live.turns(clock.inlet, _CLOCK_S):
        clock.follow()
        if clock.now is not None:
            return


def _send(
    live: Session, output: Output[Any], draft: Draft, clock: SimClock, asked: Publication, rate: float, show: str
) -> int:
    """Send at the rate, of simulation time where it runs; how many were sent."""
    simulated = clock.now is not None and not asked.wall_time
    period = 1.0 / rate if rate else float("inf")
    sent, due, epoch, told = 0, 0.0, clock.epoch, False
    for _ in live.turns(clock.inlet):
        clock.follow()
        if simulated and clock.paused and not told:
            told = True
            note("simulation time is paused, and the rate counts by it (--wall-time counts by the wall clock)")
        if clock.epoch != epoch:
            due, epoch = 0.0, clock.epoch
        while not live.stopping and not (asked.count and sent >= asked.count):
            now = (clock.now or 0) / 1e9 if simulated else time.monotonic()
            ahead = due - now
            if ahead > 1e-9:
                if simulated or ahead > BEAT_S:
                    break
                time.sleep(ahead)
                clock.follow()
                continue
            message = draft.made(clock.now or 0)
            output.publish(message)
            sent += 1
            _show(message, show, sent)
            # After a pause of this process, what is late is not made up for.
            due = due + period if sent > 1 and due + 5 * period > now else now + period
        if asked.count and sent >= asked.count:
            break
    return sent


def _show(message: Message, show: str, number: int) -> None:
    if show == "json":
        say_json(plain_record(message), lines=True)
    elif show:
        say(f"publishing #{number}: {flow(trimmed(plain_record(message), 16))}\n", flush=True)


def _linger(live: Session, clock: SimClock, seconds: float) -> None:
    for _ in live.turns(clock.inlet, seconds):
        clock.follow()
