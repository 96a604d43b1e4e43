"""The recorder's loop: records at lockstep ticks, otherwise as messages arrive."""

from __future__ import annotations

import time
from pathlib import Path

from services.bag.writer import BagWriter
from services.recorder import RecorderParameters
from services.recorder.bag_recorder import REORDER_DELAY_S, BagRecorder
from services.recorder.subscriptions import Subscriptions, TopicFilter
from services.runtime.context import Context
from services.runtime.discovery import wait_for_nodes, wait_for_tokens
from services.runtime.errors import EleaError
from services.runtime.lockstep.protocol import SIMULATION
from services.runtime.step import period_of


class RecordingIncomplete(EleaError):
    """Messages are missing from the recording, because the disk refused them."""


def run(ctx: Context[RecorderParameters]) -> None:
    """Record until stopped; raises RecordingIncomplete at the end if the disk refused messages."""
    p, node = ctx.params, ctx.node
    subscriptions = Subscriptions(node, TopicFilter(p, node.identity.resolve))
    bag = BagWriter(Path(p.output).absolute(), p.max_size, p.max_duration, p.resume)
    with bag:
        ctx.log.info(f"recording to {bag.folder}")
        recorder = BagRecorder(bag, subscriptions, ctx.log)
        try:
            others = [each for each in p.members if each != ctx.node_name]
            wait_for_nodes(node.transport, others, ctx.idle)
            subscriptions.subscribe_existing()
            if p.members or ctx.lockstep:  # time begins once this node is ready
                wait_for_tokens(node.transport, [SIMULATION, *others], ctx.idle)
                subscriptions.subscribe_existing()
            if missing := subscriptions.missing:
                ctx.log.warn(
                    f"no publishers or subscribers of {', '.join(missing)} yet: each is recorded once there is one"
                )
            if ctx.lockstep:
                _record_ticks(ctx, subscriptions, recorder)
            else:
                _record_messages(ctx, subscriptions, recorder)
        finally:
            recorder.close()
            _report(ctx, bag, recorder)


def _record_ticks(ctx: Context[RecorderParameters], subscriptions: Subscriptions, recorder: BagRecorder) -> None:
    def record_remaining() -> None:
        ctx.node.update_subscribers()
        recorder.record_remaining(ctx.now)

    for tick in ctx.ticks(meanwhile=recorder.flush_due, before_leaving=record_remaining):
        recorder.record_tick(tick.time)
        subscriptions.update()
        recorder.flush_due()


def _record_messages(ctx: Context[RecorderParameters], subscriptions: Subscriptions, recorder: BagRecorder) -> None:
    """Record messages as they arrive, since simulation time may stand still or not exist."""
    ctx.node.declare_stepping(period_of(100, lockstep=False))
    ctx.node.heartbeat.state = "running"
    try:
        while True:
            ctx.idle()
            ctx.node.update_subscribers()
            subscriptions.update()
            recorder.record()
            ctx.now = recorder.now
            recorder.flush_due()
    finally:
        time.sleep(REORDER_DELAY_S)
        ctx.node.update_subscribers()
        recorder.record(end=True)


def _report(ctx: Context[RecorderParameters], bag: BagWriter, recorder: BagRecorder) -> None:
    ctx.log.info(
        f"recorded {bag.count} messages of {len(bag.time_spans)} topics, {bag.size / 1e6:.1f} MB in {bag.files} "
        f"{'file' if bag.files == 1 else 'files'}: {bag.folder}"
    )
    for name, count in recorder.lost.items():
        ctx.log.warn(f"{count} messages of {name} were lost before they reached the recorder")
    if recorder.write_error:
        raise RecordingIncomplete(f"{bag.unwritten} messages are missing from {bag.folder}: {recorder.write_error}")
