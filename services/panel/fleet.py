"""The channel of the fleet: the processes as their supervisor tells of them."""

from __future__ import annotations

import msgspec

from messages.elea import FleetState
from messages.topics import FLEET_STATE
from services.panel.channel import as_json
from services.panel.feeds import Feeds, Hold
from services.panel.network import Network


class FleetChannel:
    """Tells the newest state; none when there is no supervisor."""

    period, streams = 0.1, False

    def __init__(self, feeds: Feeds, network: Network) -> None:
        self.version = 0
        self._place = (FLEET_STATE.name, FleetState.ROS_TYPE)
        self._hold, self._network = Hold(feeds), network
        self._state: FleetState | None = None
        self._there = False

    def follow(self, wanted: bool) -> None:
        self._hold.want({self._place: FLEET_STATE.quality.name} if wanted else {})
        if not wanted:
            self._state = None

    def turn(self, now: float) -> None:
        batch = self._hold.batch(*self._place)
        there = self._network.published(FLEET_STATE.name) is not None
        if batch:
            self._state = batch[-1][0]
        if batch or there != self._there:
            self._there = there
            self.version += 1

    def news(self, since: int) -> str | None:
        state = msgspec.to_builtins(self._state) if self._state is not None and self._there else None
        return as_json("fleet", state=state)
