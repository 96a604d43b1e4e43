"""Publishes more data than any reader can receive, with messages of a heartbeat's quality in it; prints the counts."""

from __future__ import annotations

import time

from messages.elea import Health
from messages.std import String
from messages.topics import HEALTH, Quality, Topic
from services.runtime import Parameters, Service, main
from services.runtime.context import Context

HEARTBEAT = Topic("/beat", Health, 0, HEALTH.quality, "travels like a heartbeat")
FLOOD = Topic("/flood", String, 0, Quality.SENSOR, "more than anybody takes", 1 << 20)
FLOOD_S = 0.75
"""Wall time of the flood."""
HEARTBEATS = 30
FLOOD_PER_BEAT = 50
"""Messages of the flood between two heartbeats, at least: it is one on a busy machine, too."""


def run(ctx: Context[Parameters]) -> None:
    beat, flood, filling = ctx.advertise(HEARTBEAT), ctx.advertise(FLOOD), String(data="x" * 60_000)
    while not (beat.has_subscribers and flood.has_subscribers):
        ctx.idle()
    start = time.monotonic()
    while beat.sent < HEARTBEATS:
        flood.publish(filling)
        due = time.monotonic() >= start + beat.sent * FLOOD_S / HEARTBEATS
        if due and flood.sent >= beat.sent * FLOOD_PER_BEAT:
            beat.publish(Health(beat=beat.sent))
    print(f"sent {flood.sent}", flush=True)
    while True:
        ctx.idle()


if __name__ == "__main__":
    main(Service(name="flooder", about="floods", run=run))
