"""The channel of the fleet: the processes as their supervisor reports them, with the processor and memory each uses."""

from __future__ import annotations

import msgspec
import psutil

from messages.elea import FleetState
from messages.topics import FLEET_STATE
from services.panel.channel import as_json
from services.panel.feeds import Feeds, Hold
from services.panel.network import Network

USAGE_PERIOD_S = 1.0
"""Wall time between two measurements of what the processes use."""


class FleetChannel:
    """Tells the newest state; none when there is no supervisor."""

    period, streams = 0.1, False

    def __init__(self, feeds: Feeds, network: Network) -> None:
        self.version = 0
        self._place = (FLEET_STATE.name, FleetState.ROS_TYPE)
        self._hold, self._network = Hold(feeds), network
        self._state: FleetState | None = None
        self._there = False
        self._usage = Usage()
        self._due = 0.0

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
        if self._state is not None and there and now >= self._due:
            self._due = now + USAGE_PERIOD_S
            if self._usage.measure({each.name: each.pid for each in self._state.processes if each.pid}):
                self.version += 1

    def news(self, since: int) -> str | None:
        state = msgspec.to_builtins(self._state) if self._state is not None and self._there else None
        return as_json("fleet", state=state, usage=self._usage.shown)


class Usage:
    """Processor [% of one core, since the previous measurement] and resident memory [MiB] of processes, by name."""

    def __init__(self) -> None:
        self.shown: dict[str, tuple[float, int]] = {}
        self._processes: dict[str, psutil.Process] = {}

    def measure(self, pids: dict[str, int]) -> bool:
        """Measure the processes of this machine with these ids; whether anything that is shown has changed."""
        self._processes = {name: process for name, process in self._processes.items() if pids.get(name) == process.pid}
        found = {}
        for name, pid in pids.items():
            try:
                process = self._processes.get(name)
                if process is None:  # its first share of the processor spans no time, and is 0
                    process = self._processes[name] = psutil.Process(pid)
                with process.oneshot():
                    found[name] = round(process.cpu_percent(), 1), round(process.memory_info().rss / 2**20)
            except psutil.Error:
                self._processes.pop(name, None)
        changed, self.shown = found != self.shown, found
        return changed
