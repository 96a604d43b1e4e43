"""Round trip and throughput between two processes: typed messages against raw Zenoh bytes, block by block in turn."""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import zenoh

from deploy.bench.barrier import ended
from deploy.bench.figures import Figure, ratios
from deploy.bench.partner import (
    COUNT_IN_SEC,
    FLOOD,
    OF_SCANS,
    PING,
    PONG,
    RAW_FLOOD,
    RAW_PING,
    RAW_PONG,
    SCANS,
    odometry,
    scan,
    watcher,
)
from messages.base import encode
from services.runtime.graph import pattern
from services.runtime.inputs import Input
from services.runtime.network.sockets import router_in
from services.runtime.network.zenoh_config import configuration
from services.runtime.node import Node

TRIPS = 1500
"""Round trips of one block."""
MESSAGES = 20_000
"""Messages of one flood."""
FLOODS = 11
"""Floods of each side in a round, in turn: one takes less than 0.1 s, and a single thing in its way halves its rate."""
_FLOOD_S = 20.0
"""Wall time within which a flood must have ended."""


class TypedEnd:
    """This side as a node of the runtime."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._ping, self._pong = node.write(PING), node.read(PONG)
        self._flood, self._scans = node.read(FLOOD), node.read(SCANS)
        self._message = odometry()

    def await_partner(self) -> None:
        """Block until the other side listens."""
        while not (self._ping.wanted and any("bench_partner" in key for key in self._tokens())):
            time.sleep(0.02)

    def _tokens(self) -> list[str]:
        return self._node.transport.tokens(pattern("pub", name=FLOOD.name))

    def trip(self) -> None:
        """One message there and back."""
        self._ping.publish(self._message)
        while True:
            self._node.transport.wait(self._pong.inlet)
            if self._pong.next() is not None:
                return

    def flood(self, count: int) -> tuple[int, float]:
        """Odometries that arrived, and the time from the first to the last [s]."""
        self._ping.publish(odometry(COUNT_IN_SEC + count))
        return self._arrive(self._flood, count)

    def scans(self, count: int) -> tuple[int, float]:
        """The same of LaserScans."""
        self._ping.publish(odometry(COUNT_IN_SEC + count, OF_SCANS))
        return self._arrive(self._scans, count)

    def _arrive(self, source: Input[Any], count: int) -> tuple[int, float]:
        take, final = source.next, count - 1
        while take() is None:
            self._node.transport.wait(source.inlet)
        arrived, first = 1, time.perf_counter()
        last = first
        while last - first < _FLOOD_S:
            if (message := take()) is None:
                last = time.perf_counter()
                self._node.transport.wait(source.inlet)
                continue
            arrived += 1
            if message.header.stamp.sec == final:
                return arrived, time.perf_counter() - first
        raise TimeoutError(f"the last of {count} messages did not come within {_FLOOD_S:g} s")


class RawEnd:
    """This side as a plain Zenoh session, with payloads of the same size."""

    def __init__(self, session: zenoh.Session) -> None:
        self._pong = session.declare_subscriber(RAW_PONG, zenoh.handlers.RingChannel(1024))
        self._flood = session.declare_subscriber(RAW_FLOOD, zenoh.handlers.FifoChannel(1024))
        self._ping = session.declare_publisher(RAW_PING, congestion_control=zenoh.CongestionControl.DROP)
        self._payload, self._scan = encode(odometry()), encode(scan())

    def await_partner(self) -> None:
        """Block until the other side listens and answers."""
        while not getattr(self._ping.matching_status, "matching", False):
            time.sleep(0.02)
        while self._pong.try_recv() is None:
            self._ping.put(self._payload)
            time.sleep(0.05)
        while self._pong.try_recv() is not None:
            pass

    def trip(self) -> None:
        """The payload there and back."""
        self._ping.put(self._payload)
        self._pong.recv().payload.to_bytes()

    def flood(self, count: int) -> tuple[int, float]:
        """Payloads of an Odometry's size that arrived, and the time from the first to the last [s]."""
        return self._arrive(self._payload, count)

    def scans(self, count: int) -> tuple[int, float]:
        """The same of a LaserScan's size."""
        return self._arrive(self._scan, count)

    def _arrive(self, payload: bytes, count: int) -> tuple[int, float]:
        self._ping.put(payload)  # what it floods with
        self._pong.recv()
        self._ping.put(count.to_bytes(8, "little"))
        self._flood.recv()
        first = time.perf_counter()
        for _ in range(count - 1):
            self._flood.recv().payload.to_bytes()
        return count, time.perf_counter() - first

    def end(self) -> None:
        """Let the partner go."""
        self._ping.put(b"")


def _block(trip: Callable[[], None]) -> list[float]:
    times = []
    for _ in range(TRIPS):
        started = time.perf_counter()
        trip()
        times.append(time.perf_counter() - started)
    return times


def run(rounds: int, folder: Path, say: Callable[[str], None]) -> list[Figure]:
    """Start a router and both partners, measure, end them."""
    endpoint = router_in(folder)  # Both sides meet over the same kind of link.
    module = [sys.executable, "-P", "-m"]
    commands = (
        [*module, "services.router", "--param", f"listen={endpoint}"],
        [*module, "deploy.bench.partner", "raw", endpoint],
        [*module, "deploy.bench.partner", "typed", "--connect", endpoint],
    )
    with ExitStack() as stack:
        log = stack.enter_context((folder / "partners.log").open("wb"))
        for command in commands:
            stack.enter_context(ended(subprocess.Popen(command, stdout=log, stderr=log)))
        node = stack.enter_context(watcher(endpoint))
        plain = zenoh.Config.from_json5(json.dumps(configuration("direct", (endpoint,))))
        return measure(node, stack.enter_context(zenoh.open(plain)), rounds, say)


def measure(node: Node, session: zenoh.Session, rounds: int, say: Callable[[str], None]) -> list[Figure]:
    """Both partners must be there. Each round takes a block of raw, of typed, and the floods of both."""
    typed, raw = TypedEnd(node), RawEnd(session)
    ends: dict[str, Any] = {"raw": raw, "typed": typed}
    typed.await_partner()
    raw.await_partner()
    trips: dict[str, list[list[float]]] = {"raw": [], "typed": []}
    rates: dict[str, list[float]] = {"raw": [], "typed": []}
    scans: dict[str, list[float]] = {"raw": [], "typed": []}
    losses: dict[str, list[float]] = {"flood": [], "scans": []}
    for end in ends.values():
        for _ in range(200):
            end.trip()
    for number in range(rounds):
        say(f"wire, round {number + 1} of {rounds}")
        for name in sorted(ends, reverse=bool(number % 2)):
            trips[name].append(_block(ends[name].trip))
        for what, found in (("flood", rates), ("scans", scans)):
            floods: dict[str, list[float]] = {"raw": [], "typed": []}
            arrivals = 0
            for flood in range(FLOODS):
                for name in sorted(ends, reverse=bool(flood % 2)):
                    arrived, seconds = getattr(ends[name], what)(MESSAGES)
                    floods[name].append(arrived / seconds)
                    arrivals += arrived if name == "typed" else 0
            for name in ends:
                found[name].append(statistics.median(floods[name]))
            losses[what].append(100 * (1 - arrivals / (FLOODS * MESSAGES)))
    raw.end()
    median = {name: [statistics.median(block) for block in blocks] for name, blocks in trips.items()}
    tail = {name: [statistics.quantiles(block, n=100)[98] for block in blocks] for name, blocks in trips.items()}
    micro = 1e6
    return [
        Figure(
            "echo_p50_ratio",
            "",
            "round trip of an Odometry between two services / of raw Zenoh bytes, median",
            ratios(median["typed"], median["raw"]),
            at_most=1.25,
        ),
        Figure("echo_p50_us", "us", "the same, absolute", tuple(each * micro for each in median["typed"])),
        Figure("echo_p99_ratio", "", "the same ratio at the 99th percentile", ratios(tail["typed"], tail["raw"])),
        Figure(
            "throughput_ratio",
            "",
            "messages a second one way, typed / raw",
            ratios(rates["typed"], rates["raw"]),
            at_least=0.45,
        ),
        Figure("throughput_per_s", "1/s", "the same, absolute", tuple(rates["typed"])),
        Figure("throughput_loss_percent", "%", "of these the reader lost", tuple(losses["flood"])),
        Figure("scans_ratio", "", "LaserScans of 360 rays one way, typed / raw", ratios(scans["typed"], scans["raw"])),
        Figure("scans_per_s", "1/s", "the same, absolute", tuple(scans["typed"])),
        Figure("scans_loss_percent", "%", "of these the reader lost", tuple(losses["scans"])),
    ]
