"""The channels of parameters: which sets there are, described, and the values of each."""

from __future__ import annotations

from typing import Any

import msgspec

from messages.parameters import ParameterSchema, ParameterValues
from messages.topics import DESCRIPTIONS, UPDATES
from services.panel.channel import as_json
from services.panel.feeds import Feeds, Hold
from services.panel.network import Network

_DESCRIBED, _UPDATED = (each.name.removeprefix("~") for each in (DESCRIPTIONS, UPDATES))


class SetsChannel:
    """Tells all descriptions when any of them changes. A set goes when nobody publishes it any more."""

    period, streams = 0.1, False
    topic, record = _DESCRIBED, ParameterSchema.ROS_TYPE

    def __init__(self, feeds: Feeds, network: Network) -> None:
        self.version = 0
        self._hold, self._network = Hold(feeds), network
        self._known: dict[str, tuple[int, Any]] = {}
        self._wanted = False
        self._followed = -1

    def follow(self, wanted: bool) -> None:
        self._wanted, self._followed = wanted, -1
        if not wanted:
            self._hold.want({})
            self._known = {}

    def turn(self, now: float) -> None:
        if self._followed != self._network.version:
            self._followed = self._network.version
            there = [each.name for each in self._network.ending("pub", self.topic) if each.record == self.record]
            self._hold.want({(name, self.record): DESCRIPTIONS.quality.name for name in there})
            for name in [each for each in self._known if each not in there]:
                del self._known[name]
                self.version += 1
        for name, record in self._hold.places():
            for message, _ in self._hold.batch(name, record)[-1:]:
                self.version += 1
                self._known[name] = self.version, message

    def news(self, since: int) -> str | None:
        sets = [msgspec.to_builtins(message) for _, message in self._known.values()]
        return as_json("sets", sets=sorted(sets, key=lambda each: str(each["set"])))


class ValuesChannel(SetsChannel):
    """Tells the values of the sets that have changed."""

    streams = True
    topic, record = _UPDATED, ParameterValues.ROS_TYPE

    def news(self, since: int) -> str | None:
        news = [msgspec.to_builtins(message) for at, message in self._known.values() if at > since]
        return as_json("values", sets=news) if news else None
