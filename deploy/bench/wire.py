"""Round trip, throughput and encoding: typed messages against raw Zenoh bytes and plain MessagePack."""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import time
import timeit
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import zenoh

from deploy.bench.barrier import killed_at_exit
from deploy.bench.figures import Figure, ratios
from deploy.bench.peer import (
    FLOOD,
    FLOOD_OF_SCANS,
    FLOOD_OFFSET_SEC,
    PING,
    PONG,
    RAW_FLOOD,
    RAW_PING,
    RAW_PONG,
    SCANS,
    bench_node,
    make_odometry,
    make_scan,
)
from messages.base import Message, encode, raw_decoder
from messages.nav import Odometry
from messages.sensor import LaserScan
from services.runtime.graph import token_pattern
from services.runtime.node import Node
from services.runtime.subscriber import Subscriber
from services.runtime.transport.unix_sockets import router_in
from services.runtime.transport.zenoh_config import configuration

CALLS = 2000
"""Number of calls per measurement."""
TRIES = 15
"""Measurements per round, of which the fastest counts: the others were interrupted."""


class _Lists(Message, frozen=True, kw_only=True):
    ranges: tuple[float, ...] = ()


def measure_codec(rounds: int) -> list[Figure]:
    """Measure the time of one call in this process, without a network."""
    read_scan, read_odometry = raw_decoder(LaserScan), raw_decoder(Odometry)
    read_lists = raw_decoder(_Lists)
    seen, driven = make_scan(), make_odometry()
    wire, driven_wire = encode(seen), encode(driven)
    lists = encode(_Lists(ranges=(*seen.ranges,)))
    calls: list[tuple[str, str, float | None, Callable[[], object]]] = [
        ("scan_encode_us", "encoding a LaserScan of 360 rays", 3.0, lambda: encode(seen)),
        ("scan_decode_us", "decoding it", 4.0, lambda: read_scan(wire)),
        ("scan_list_us", "decoding its ranges alone as msgspec decodes a list", None, lambda: read_lists(lists)),
        ("odometry_decode_us", "decoding an Odometry", None, lambda: read_odometry(driven_wire)),
    ]
    return [
        Figure(name, "us", about, tuple(_fastest(call) for _ in range(rounds)), at_most=bound)
        for name, about, bound, call in calls
    ]


def _fastest(call: Callable[[], object]) -> float:
    """Return the minimum wall time of one call [us]."""
    return min(timeit.repeat(call, number=CALLS, repeat=TRIES)) / CALLS * 1e6


TRIPS = 1500
"""Number of round trips per block."""
MESSAGES = 20_000
"""Number of messages per flood."""
FLOODS = 11
"""Floods of each side per round, in turn: one takes less than 0.1 s, and a single disturbance halves its rate."""
_FLOOD_S = 20.0
"""Maximum wall time of a flood."""


class TypedClient:
    """This side as a node of the runtime."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._ping, self._pong = node.advertise(PING), node.subscribe(PONG)
        self._flood, self._scans = node.subscribe(FLOOD), node.subscribe(SCANS)
        self._message = make_odometry()

    def wait_for_peer(self) -> None:
        """Block until the other side has subscribed."""
        while not (self._ping.has_subscribers and any("bench_typed" in key for key in self._tokens())):
            time.sleep(0.02)

    def _tokens(self) -> list[str]:
        return self._node.transport.tokens(token_pattern("pub", name=FLOOD.name))

    def trip(self) -> None:
        """Send one message there and back."""
        self._ping.publish(self._message)
        while True:
            self._node.transport.wait(self._pong.raw)
            if self._pong.recv() is not None:
                return

    def flood(self, count: int) -> tuple[int, float]:
        """Return the number of Odometry messages received, and the time from the first to the last [s]."""
        self._ping.publish(make_odometry(FLOOD_OFFSET_SEC + count))
        return self._arrive(self._flood, count)

    def scans(self, count: int) -> tuple[int, float]:
        """Return the same for LaserScan messages."""
        self._ping.publish(make_odometry(FLOOD_OFFSET_SEC + count, FLOOD_OF_SCANS))
        return self._arrive(self._scans, count)

    def _arrive(self, source: Subscriber[Any], count: int) -> tuple[int, float]:
        take, final = source.recv, count - 1
        while take() is None:
            self._node.transport.wait(source.raw)
        arrived, first = 1, time.perf_counter()
        last = first
        while last - first < _FLOOD_S:
            if (message := take()) is None:
                last = time.perf_counter()
                self._node.transport.wait(source.raw)
                continue
            arrived += 1
            if message.header.stamp.sec == final:
                return arrived, time.perf_counter() - first
        raise TimeoutError(f"the last of {count} messages did not come within {_FLOOD_S:g} s")


class RawClient:
    """This side as a plain Zenoh session, with payloads of the same size."""

    def __init__(self, session: zenoh.Session) -> None:
        self._pong = session.declare_subscriber(RAW_PONG, zenoh.handlers.RingChannel(1024))
        self._flood = session.declare_subscriber(RAW_FLOOD, zenoh.handlers.FifoChannel(1024))
        self._ping = session.declare_publisher(RAW_PING, congestion_control=zenoh.CongestionControl.DROP)
        self._payload, self._scan = encode(make_odometry()), encode(make_scan())

    def wait_for_peer(self) -> None:
        """Block until the other side has subscribed and answers."""
        while not getattr(self._ping.matching_status, "matching", False):
            time.sleep(0.02)
        while self._pong.try_recv() is None:
            self._ping.put(self._payload)
            time.sleep(0.05)
        while self._pong.try_recv() is not None:
            pass

    def trip(self) -> None:
        """Send the payload there and back."""
        self._ping.put(self._payload)
        self._pong.recv().payload.to_bytes()

    def flood(self, count: int) -> tuple[int, float]:
        """Return the number of payloads of an Odometry's size received, and the time from the first to the last [s]."""
        return self._arrive(self._payload, count)

    def scans(self, count: int) -> tuple[int, float]:
        """Return the same for payloads of a LaserScan's size."""
        return self._arrive(self._scan, count)

    def _arrive(self, payload: bytes, count: int) -> tuple[int, float]:
        self._ping.put(payload)  # the payload of its flood
        self._pong.recv()
        self._ping.put(count.to_bytes(8, "little"))
        self._flood.recv()
        first = time.perf_counter()
        for _ in range(count - 1):
            self._flood.recv().payload.to_bytes()
        return count, time.perf_counter() - first

    def end(self) -> None:
        """Stop the peer."""
        self._ping.put(b"")


def _block(trip: Callable[[], None]) -> list[float]:
    times = []
    for _ in range(TRIPS):
        started = time.perf_counter()
        trip()
        times.append(time.perf_counter() - started)
    return times


def run_wire(rounds: int, folder: Path, say: Callable[[str], None]) -> list[Figure]:
    """Start a router and both peers, measure, and stop them."""
    endpoint = router_in(folder)  # Both sides use the same kind of link.
    module = [sys.executable, "-P", "-m"]
    commands = (
        [*module, "services", "router", "--param", f"listen={endpoint}"],
        [*module, "deploy.bench.peer", "raw", endpoint],
        [*module, "deploy.bench.peer", "typed", "--connect", endpoint],
    )
    with ExitStack() as stack:
        log = stack.enter_context((folder / "partners.log").open("wb"))
        for command in commands:
            stack.enter_context(killed_at_exit(subprocess.Popen(command, stdout=log, stderr=log)))
        node = stack.enter_context(bench_node(endpoint))
        plain = zenoh.Config.from_json5(json.dumps(configuration("direct", (endpoint,))))
        return measure_wire(node, stack.enter_context(zenoh.open(plain)), rounds, say)


def measure_wire(node: Node, session: zenoh.Session, rounds: int, say: Callable[[str], None]) -> list[Figure]:
    """Measure against both peers, which must be running: in each round blocks of raw and typed trips, then floods of
    both.
    """
    typed, raw = TypedClient(node), RawClient(session)
    ends: dict[str, Any] = {"raw": raw, "typed": typed}
    typed.wait_for_peer()
    raw.wait_for_peer()
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
        Figure("throughput_loss_percent", "%", "of these, lost by the subscriber", tuple(losses["flood"])),
        Figure("scans_ratio", "", "LaserScans of 360 rays one way, typed / raw", ratios(scans["typed"], scans["raw"])),
        Figure("scans_per_s", "1/s", "the same, absolute", tuple(scans["typed"])),
        Figure("scans_loss_percent", "%", "of these, lost by the subscriber", tuple(losses["scans"])),
    ]
