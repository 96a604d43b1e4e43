"""A loop sees all publishers' frames as of the start of its tick, and only new ones after a reset."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from messages.geometry import TransformStamped
from messages.se3 import Pose3
from messages.std import Header, Time
from messages.tf import TFMessage
from messages.topics import TF, TF_STATIC
from services.runtime.context import Context, Tick
from services.runtime.errors import NoTransform, UnknownFrame
from services.runtime.node import Node
from services.runtime.parameters.base import Parameters
from services.runtime.transport.memory import MemoryBus
from tests.harness.memory_node import ManualClock, memory_node

MS = 1_000_000


def told(parent: str, child: str, x: float, ns: int = 0) -> TFMessage:
    header = Header(stamp=Time.of(ns), frame_id=parent)
    transform = Pose3((x, 0.0, 0.0)).to_transform()
    return TFMessage(transforms=(TransformStamped(header=header, child_frame_id=child, transform=transform),))


@contextmanager
def three(bus: MemoryBus) -> Iterator[tuple[Node, Node, Context[Parameters]]]:
    """Two publishing nodes and the context of one that looks up transforms."""
    with memory_node(bus, "sim") as sim, memory_node(bus, "state") as state, memory_node(bus, "reader") as reader:
        yield sim, state, Context(reader, Parameters(), 10.0)


def step(ticks: Iterator[Tick], clock: ManualClock, ns: int, epoch: int = 0) -> Tick:
    """Return the next tick; the clock is published until the loop, which subscribes late, has received it."""
    came = threading.Event()

    def tell() -> None:
        while not came.is_set():
            clock.publish(ns, epoch)
            came.wait(0.01)

    teller = threading.Thread(target=tell)
    teller.start()
    try:
        return next(ticks)
    finally:
        came.set()
        teller.join()


def test_it_follows_the_snapshot(bus: MemoryBus, clock: ManualClock) -> None:
    with three(bus) as (sim, state, ctx):
        frames = ctx.transforms()
        moving, fixed, other = sim.advertise(TF), sim.advertise(TF_STATIC), state.advertise(TF_STATIC)
        fixed.publish(told("world", "odom", 1.0))
        other.publish(told("base", "laser", 0.1))
        moving.publish(told("odom", "base", 2.0, 0))
        ticks = ctx.ticks()
        step(ticks, clock, 0)
        first = frames.lookup("world", "laser")
        assert first.transform.translation.x == pytest.approx(3.1)
        assert (first.header.frame_id, first.child_frame_id, first.header.stamp.ns) == ("world", "laser", 0)
        moving.publish(told("odom", "base", 4.0, 100 * MS))
        assert frames.lookup("world", "laser") == first, "what comes during a tick is for the next one"
        step(ticks, clock, 100 * MS)
        assert frames.lookup("world", "laser").transform.translation.x == pytest.approx(5.1)
        assert frames.lookup("world", "laser", 50 * MS).transform.translation.x == pytest.approx(4.1)
        assert frames.can("laser", "world")
        assert not frames.can("laser", "nowhere")
        assert frames.frames() == ["base", "laser", "odom", "world"]


def test_a_new_epoch_clears_it(bus: MemoryBus, clock: ManualClock) -> None:
    with three(bus) as (sim, _, ctx):
        frames = ctx.transforms()
        moving, fixed = sim.advertise(TF), sim.advertise(TF_STATIC)
        fixed.publish(told("world", "odom", 1.0))
        moving.publish(told("odom", "base", 2.0, 5000 * MS))
        ticks = ctx.ticks()
        step(ticks, clock, 5000 * MS)
        assert frames.can("world", "base")
        fixed.publish(told("world", "odom", 7.0))
        assert step(ticks, clock, 0, 1).reset
        with pytest.raises(NoTransform):
            frames.lookup("world", "base")
        assert frames.lookup("world", "odom").transform.translation.x == 7.0
        moving.publish(told("odom", "base", 3.0, 100 * MS))
        step(ticks, clock, 100 * MS, 1)
        assert frames.lookup("world", "base").transform.translation.x == 10.0


def test_a_lookup_waits_while_the_loop_s_own_ticks_pass(bus: MemoryBus, clock: ManualClock) -> None:
    """A missing transform arrives with the third tick; one that never arrives costs the timeout in simulation time."""
    with three(bus) as (sim, _, ctx):
        frames = ctx.transforms()
        moving, now = sim.advertise(TF), 0
        ticks = ctx.ticks()

        def hand() -> Iterator[Tick]:
            nonlocal now
            while True:
                if now == 200:
                    moving.publish(told("odom", "base", 2.0, 200 * MS))
                yield step(ticks, clock, now * MS)
                now += 100

        own = hand()
        found = frames.wait_for(own, "odom", "base", timeout=1.0)
        assert (now, found.header.stamp.ns, found.transform.translation.x) == (200, 200 * MS, 2.0)
        with pytest.raises(UnknownFrame, match=r"'map' is unknown.*waited for 0\.5 s of simulation time"):
            frames.wait_for(own, "map", "base", timeout=0.5)
        assert now == 700
        back = frames.lookup_full("base", 200 * MS, "base", 200 * MS, "odom")
        assert (back.child_frame_id, back.header.stamp.ns, back.transform.translation.x) == ("base", 200 * MS, 0.0)
        assert not frames.can_full("base", 200 * MS, "base", 900 * MS, "odom")


def test_a_frame_that_becomes_fixed_in_the_tick_in_which_it_last_moved_is_fixed(
    bus: MemoryBus, clock: ManualClock
) -> None:
    with three(bus) as (sim, state, ctx):
        frames = ctx.transforms()
        moving, fixed = sim.advertise(TF), state.advertise(TF_STATIC)
        moving.publish(told("world", "cup", 1.0, 50 * MS))
        fixed.publish(told("world", "cup", 9.0))
        step(ctx.ticks(), clock, 100 * MS)
        assert frames.lookup("world", "cup", 5000 * MS).transform.translation.x == 9.0


def test_two_publishers_of_a_frame_are_told_once(bus: MemoryBus, clock: ManualClock) -> None:
    with three(bus) as (sim, state, ctx):
        said: list[str] = []
        ctx.transforms()
        ctx.log.publish = lambda line: said.append(line.msg)
        for each in (sim, state):
            each.advertise(TF).publish(told(each.identity.node, "base", 1.0))
        ticks = ctx.ticks()
        step(ticks, clock, 0)
        step(ticks, clock, 100 * MS)
        assert [each for each in said if "parents" in each] == [
            "frame 'base' has 2 parents, 'sim' and 'state': a frame has one publisher, see ./elea tf tree"
        ]
