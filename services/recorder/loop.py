"""The recorder's loop: with the ticks of lockstep, else as messages come."""

from __future__ import annotations

import time
from pathlib import Path

from services.bag.folder import BagFolder
from services.recorder import RecorderParameters
from services.recorder.listening import Listening
from services.recorder.order import SETTLE_S
from services.recorder.selection import Selection
from services.recorder.tape import Tape
from services.runtime.context import Context
from services.runtime.errors import EleaError
from services.runtime.roster import gather
from services.runtime.service import period_of


class NotRecorded(EleaError):
    """A part of what was to be recorded is missing."""


def run(ctx: Context[RecorderParameters]) -> None:
    """Record until told to stop; raises NotRecorded at the end when the disk did not take everything."""
    p, node = ctx.params, ctx.kernel
    listening = Listening(node, Selection(p, node.identity.resolve))
    bag = BagFolder(Path(p.output).absolute(), p.max_size, p.max_duration, p.resume)
    with bag:
        ctx.log.info(f"recording to {bag.folder}")
        tape = Tape(bag, listening, ctx.log)
        try:
            gather(node.transport, [each for each in p.members if each != ctx.node], ctx.idle)
            listening.look()
            if missing := listening.missing:
                ctx.log.warn(f"nobody publishes or reads {', '.join(missing)} yet: recorded as soon as somebody does")
            if ctx.lockstep:
                _with_ticks(ctx, listening, tape)
            else:
                _with_messages(ctx, listening, tape)
        finally:
            if ctx.lockstep:
                node.admit()
                tape.take_rest(ctx.now)
            else:
                time.sleep(SETTLE_S)
                node.admit()
                tape.take(end=True)
            tape.close()
            _tell(ctx, bag, tape)


def _with_ticks(ctx: Context[RecorderParameters], listening: Listening, tape: Tape) -> None:
    for tick in ctx.ticks(meanwhile=tape.rest):
        tape.take_tick(tick.time)
        listening.update()
        tape.rest()


def _with_messages(ctx: Context[RecorderParameters], listening: Listening, tape: Tape) -> None:
    """Time may stand still or not exist: messages are taken as they come."""
    ctx.kernel.show_step(period_of(100, lockstep=False))
    ctx.kernel.heart.state = "running"
    while True:
        ctx.idle()
        ctx.kernel.admit()
        listening.update()
        tape.take()
        ctx.now = tape.now
        tape.rest()


def _tell(ctx: Context[RecorderParameters], bag: BagFolder, tape: Tape) -> None:
    ctx.log.info(
        f"recorded {bag.count} messages of {len(bag.topics)} topics, {bag.size / 1e6:.1f} MB in {bag.files} "
        f"{'file' if bag.files == 1 else 'files'}: {bag.folder}"
    )
    for name, count in tape.lost.items():
        ctx.log.warn(f"{count} messages of {name} were lost on their way")
    if tape.troubled:
        raise NotRecorded(f"{bag.unwritten} messages are missing from {bag.folder}: {tape.troubled}")
