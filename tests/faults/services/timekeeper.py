"""A healthy service that reports how time passes in its loop."""

from __future__ import annotations

from messages.std import String
from messages.topics import Quality, Topic
from services.runtime import Parameters, Service, main
from services.runtime.context import Context

TICKS = Topic("ticks", String, 25, Quality.EVENT, "time [ns], dt [s], epoch and reset of each tick")


def run(ctx: Context[Parameters]) -> None:
    for tick in ctx.ticks():
        ctx.publish(TICKS, String(data=f"{tick.time} {tick.dt} {tick.epoch} {tick.reset:d}"))


if __name__ == "__main__":
    main(Service(name="timekeeper", about="tells how time passes", run=run, rate=25))
