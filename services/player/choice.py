"""Which topics of a bag are played, and why the others are not."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import NamedTuple

from messages.elea import FleetState, Health
from messages.parameters import ParameterSchema, ParameterValues
from messages.topics import CLOCK
from services.bag.channel import Channel
from services.bag.typed import beside, why_not_played
from services.player import PlayerParameters
from services.runtime.errors import BadInput, unknown

OF_PROCESSES = frozenset(each.ROS_TYPE for each in (Health, FleetState, ParameterSchema, ParameterValues))
"""Types that tell of processes which are gone: played only when their topics are named."""


class Choice(NamedTuple):
    """Channels to play, and reasons by topic why others cannot be; ``beside`` complete the played ones."""

    played: tuple[Channel, ...]
    beside: tuple[Channel, ...]
    refused: dict[str, str]


def choose(channels: Iterable[Channel], params: PlayerParameters) -> Choice:
    """What to play of a bag; raises BadInput for names that are not in it, and when nothing is left."""
    channels = list(channels)
    if not channels:
        raise BadInput(f"{params.bag} holds no messages")
    known = {channel.name for channel in channels if not beside(channel)}
    names = {name if name.startswith("/") else f"/{name}" for name in params.topics}
    for name in sorted(names - known):
        raise unknown("topic", name, known, params.bag)
    excluded = _pattern(params.exclude)
    played: list[Channel] = []
    types: dict[str, str] = {}
    refused: dict[str, str] = {}
    for channel in channels:
        topic = channel.name
        if beside(channel) or (names and topic not in names) or (excluded and excluded.search(topic)):
            continue
        if not names and channel.type in OF_PROCESSES:
            continue
        if reason := why_not_played(channel):
            refused[topic] = reason
        elif types.setdefault(topic, channel.type) != channel.type:
            refused[topic] = f"it is played as {types[topic]}, and not as {channel.type} besides: a topic has one type"
        else:
            played.append(channel)
    if not played:
        reasons = "; ".join(f"{topic}: {reason}" for topic, reason in sorted(refused.items()))
        raise BadInput(f"nothing of {params.bag} can be played: {reasons or 'no topic is chosen'}")
    return Choice(tuple(played), tuple(channel for channel in channels if beside(channel)), refused)


def is_clock(channel: Channel) -> bool:
    """Whether a channel is simulation time."""
    return channel.name == CLOCK.name and channel.type == CLOCK.record.ROS_TYPE


def _pattern(text: str) -> re.Pattern[str] | None:
    try:
        return re.compile(text) if text else None
    except re.error as error:
        raise BadInput(f"player, exclude: {text!r} is not a regular expression: {error}") from None
