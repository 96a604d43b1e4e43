"""What it takes to encode and decode a record, beside the floor of MessagePack lists that msgspec reads by itself."""

from __future__ import annotations

import timeit
from collections.abc import Callable

from deploy.bench.figures import Figure
from deploy.bench.partner import odometry, scan
from messages.base import Message, bare_decoder, encode
from messages.nav import Odometry
from messages.sensor import LaserScan

TIMES = 2000
"""Calls of one measurement."""
TRIES = 15
"""Measurements of a round, of which the fastest counts: the others were interrupted."""


class _Lists(Message, frozen=True, kw_only=True):
    ranges: tuple[float, ...] = ()


def measure(rounds: int) -> list[Figure]:
    """The time of one call, without a network and in this process."""
    read_scan, read_odometry = bare_decoder(LaserScan), bare_decoder(Odometry)
    read_lists = bare_decoder(_Lists)
    seen, driven = scan(), odometry()
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
    """Wall time of one call [us]."""
    return min(timeit.repeat(call, number=TIMES, repeat=TRIES)) / TIMES * 1e6
