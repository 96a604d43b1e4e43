"""The other end of the wire measurements, in its own process: ``python -m deploy.bench.peer KIND``.

``typed`` is a service of the runtime that answers each Odometry with an Odometry, ``drive`` one that answers with a
command; ``raw`` answers bytes with bytes on a plain Zenoh session of the same configuration. ``typed`` and ``raw`` can
also flood the measuring side. ``member`` takes part in a bare barrier: it only answers each grant on its own key.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import zenoh

from messages.base import Float32Array, covariance
from messages.geometry import Pose, PoseWithCovariance, Twist, TwistWithCovariance
from messages.names import Identity
from messages.nav import Odometry
from messages.sensor import LaserScan
from messages.std import Header, Time
from messages.topics import Quality, Topic
from services.runtime import Service, main
from services.runtime.context import Context
from services.runtime.log import Log
from services.runtime.node import Node
from services.runtime.transport.zenoh import ZenohTransport, limit_threads
from services.runtime.transport.zenoh_config import configuration

PING = Topic("/bench/ping", Odometry, 0, Quality.SENSOR, "measured round trip, out")
PONG = Topic("/bench/pong", Odometry, 0, Quality.SENSOR, "measured round trip, back")
DRIVE = Topic("/bench/odom", Odometry, 0, Quality.SENSOR, "measured round trip to a command, out")
DRIVEN = Topic("/bench/cmd_vel", Twist, 0, Quality.SENSOR, "measured round trip to a command, back")
FLOOD = Topic("/bench/flood", Odometry, 0, Quality.EVENT, "measured throughput")
SCANS = Topic("/bench/scans", LaserScan, 0, Quality.EVENT, "measured throughput of scans")
RAW_PING, RAW_PONG, RAW_FLOOD = "bench_raw/ping", "bench_raw/pong", "bench_raw/flood"
RAW_GRANT, RAW_REPORT = "bench_raw/go", "bench_raw/done"
"""Key prefixes, followed by the number of a member."""

FLOOD_OFFSET_SEC = 1_000_000
"""A ping whose stamp has at least this many seconds requests a flood of (seconds - FLOOD_OFFSET_SEC) messages: of scans
if its ``child_frame_id`` is FLOOD_OF_SCANS.
"""
FLOOD_OF_SCANS = "scans"


def make_scan(number: int = 0) -> LaserScan:
    """Return a scan of 360 rays, like that of a TurtleBot's laser."""
    return LaserScan(
        header=Header(stamp=Time(sec=number, nanosec=123_456_789), frame_id="tb3_0/base_scan"),
        angle_max=math.tau,
        angle_increment=math.tau / 360,
        scan_time=0.2,
        range_min=0.12,
        range_max=3.5,
        ranges=Float32Array([0.12 + 0.009 * ray for ray in range(360)]),
    )


def make_odometry(number: int = 0, child: str = "tb3_0/base_footprint") -> Odometry:
    """Return a message with every field in use, like that of a robot."""
    variances = covariance(1e-5, 1e-5, 1e-5, 1e-5, 1e-5, 1e-5)
    return Odometry(
        header=Header(stamp=Time(sec=number, nanosec=123_456_789), frame_id="tb3_0/odom"),
        child_frame_id=child,
        pose=PoseWithCovariance(pose=Pose.planar(1.2345, -0.9876, 0.4321), packed=variances),
        twist=TwistWithCovariance(twist=Twist.planar(0.21987, 0.1234), packed=variances),
    )


def typed_peer(ctx: Context[Any]) -> None:
    """Answer each ping with an Odometry, or a flood."""
    pong, flood, scans = ctx.advertise(PONG), ctx.advertise(FLOOD), ctx.advertise(SCANS)
    for ping in ctx.messages(PING):
        asked = ping.header.stamp.sec - FLOOD_OFFSET_SEC
        if asked < 0:
            pong.publish(ping)
            continue
        if ping.child_frame_id == FLOOD_OF_SCANS:
            one = make_scan()
            for _ in range(asked - 1):
                scans.publish(one)
            scans.publish(make_scan(asked - 1))
            continue
        for _ in range(asked - 1):
            flood.publish(ping)
        flood.publish(make_odometry(asked - 1))


def drive_peer(ctx: Context[Any]) -> None:
    """Answer each Odometry with a command."""
    driven = ctx.advertise(DRIVEN)
    for seen in ctx.messages(DRIVE):
        driven.publish(Twist.planar(seen.pose.pose.position.x, 0.0))


@contextmanager
def bench_node(endpoint: str) -> Iterator[Node]:
    """Open the benchmark's own node."""
    identity = Identity.of("bench")
    with (
        ZenohTransport(configuration("direct", (endpoint,), reliable=True)) as transport,
        Node(transport, identity, "bench", Log(identity.node)) as node,
    ):
        yield node


def raw_session(endpoint: str) -> zenoh.Session:
    """Open a plain Zenoh session with the runtime's configuration and threads in lockstep."""
    with limit_threads():
        return zenoh.open(zenoh.Config.from_json5(json.dumps(configuration("direct", (endpoint,), reliable=True))))


def barrier_member(endpoint: str, number: str) -> None:
    """Answer each grant; an empty one ends the process."""
    with raw_session(endpoint) as session:
        grants = session.declare_subscriber(f"{RAW_GRANT}/{number}", zenoh.handlers.RingChannel(1024))
        done = session.declare_publisher(f"{RAW_REPORT}/{number}", congestion_control=zenoh.CongestionControl.BLOCK)
        while grant := grants.recv().payload.to_bytes():
            done.put(grant)


def raw_peer(endpoint: str) -> None:
    """Answer each ping, or flood if it has eight bytes, the number of messages; an empty one ends the process."""
    with zenoh.open(zenoh.Config.from_json5(json.dumps(configuration("direct", (endpoint,))))) as session:
        pings = session.declare_subscriber(RAW_PING, zenoh.handlers.RingChannel(1024))
        pong = session.declare_publisher(RAW_PONG, congestion_control=zenoh.CongestionControl.DROP)
        flood = session.declare_publisher(RAW_FLOOD, congestion_control=zenoh.CongestionControl.BLOCK)
        payload = b""
        while True:
            asked = pings.recv().payload.to_bytes()
            if not asked:
                return
            if len(asked) == 8:
                for _ in range(int.from_bytes(asked, "little")):
                    flood.put(payload)
            else:
                payload = asked
                pong.put(payload)


if __name__ == "__main__":
    if sys.argv[1] == "raw":
        raw_peer(sys.argv[2])
    elif sys.argv[1] == "member":
        barrier_member(*sys.argv[2:])
    else:
        kind = sys.argv.pop(1)
        run = drive_peer if kind == "drive" else typed_peer
        main(Service(name=f"bench_{kind}", about="Answers the bench.", run=run))
