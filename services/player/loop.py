"""The player's loop: choose, declare, wait, and put one message after the other on the bus."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from messages.rosgraph import Clock
from messages.topics import CLOCK
from services.bag.reading import Bag, open_bag
from services.player import PlayerParameters
from services.player.choice import Choice, choose, is_clock
from services.player.clockwork import RATE, Clockwork
from services.player.latency import SETTINGS, recorded_latency
from services.player.pace import Following, Pace, Wall
from services.player.playback import Playback
from services.player.stage import Stage
from services.player.steps import Steps
from services.runtime.context import Context
from services.runtime.errors import BadInput, EleaError
from services.runtime.graph import Entity, pattern
from services.runtime.node import Node
from services.runtime.outputs import Output

_LINGER = 3
"""Tenths of a second that the last messages have to leave."""


_LOOK_S = 1.5
"""Wall time in which a simulation that runs must have come in sight: two clocks would tear time apart for everybody."""


class NotPlayed(EleaError):
    """Something of the bag was not played, or nobody listened."""


def run(ctx: Context[PlayerParameters]) -> None:
    """Play the bag; raises NotPlayed at the end when a part of it could not be played."""
    p, node = ctx.params, ctx.kernel
    bag = open_bag(Path(p.bag))
    choice = choose(bag.channels(), p)
    for trouble in bag.troubles:
        ctx.log.warn(f"{trouble}; what can be read is played")
    for topic, reason in sorted(choice.refused.items()):
        ctx.log.warn(f"{topic} is not played: {reason}")
    theirs = _clock_of_others(node)
    if theirs and p.members:
        raise BadInput(f"{theirs} publishes /clock: a bag in lockstep is the simulation itself; end the other one")
    if theirs:
        ctx.log.info(f"{theirs} publishes /clock: the bag is played on its time, and its own clock is left out")
    recorded = any(is_clock(channel) for channel in choice.played)
    clockwork = Clockwork(node, not theirs, p.clock or (0.0 if recorded else RATE))
    stage = Stage(node, [channel for channel in choice.played if not is_clock(channel)])
    pace = _pace(ctx, bag, bool(theirs), clockwork)
    _await_subscribers(ctx, stage)
    playback = Playback(bag, choice, p.start, p.duration)
    _play(ctx, playback, pace, clockwork, stage)
    _account(ctx, bag, choice, playback, pace.lost if isinstance(pace, Steps) else ())


def _play(ctx: Context[PlayerParameters], playback: Playback, pace: Pace, clockwork: Clockwork, stage: Stage) -> None:
    ctx.kernel.heart.state = "running"
    while True:
        played = 0
        pace.begin()
        for cue in playback.cues():
            pace.reach(cue.moment)
            ctx.now, played = clockwork.now.time, played + 1
            if isinstance(cue.message, Clock) and cue.channel not in stage:
                clockwork.play(cue.message, cue.moment)
            else:
                stage.play(cue)
        if not played:
            raise BadInput(f"{ctx.params.bag}: no message of the chosen topics lies in the span that is asked for")
        ctx.log.info(f"played {played} messages")
        if not ctx.params.loop:
            break
        clockwork.again()
    pace.finish()
    for _ in range(_LINGER):
        ctx.idle()


def _pace(ctx: Context[PlayerParameters], bag: Bag, follows: bool, clockwork: Clockwork) -> Pace:
    p = ctx.params
    if p.members:
        latency = p.latency if p.latency is not None else recorded_latency(bag)
        if latency is None:
            latency = 0
            ctx.log.info(f"{p.bag} does not hold {SETTINGS}, which tells the latency of its run: 0 is taken")
        return Steps(ctx.kernel, p.members, p.rate, clockwork, latency)
    return Following(ctx, p.rate) if follows else Wall(ctx.kernel, p.rate, clockwork)


def _clock_of_others(node: Node) -> str:
    """The node that publishes simulation time already; empty when none does within _LOOK_S."""
    deadline = time.monotonic() + _LOOK_S
    while True:
        found = (Entity.parse(key) for key in node.transport.tokens(pattern("pub", name=CLOCK.name)))
        others = [each.node for each in found if each is not None and each.session != node.transport.session]
        if others or time.monotonic() > deadline:
            return next(iter(others), "")
        node.turn()
        time.sleep(0.05)


def _await_subscribers(ctx: Context[PlayerParameters], stage: Stage) -> None:
    """Wait until every topic that was named has a subscriber, or, when none was, any topic has."""
    p, node = ctx.params, ctx.kernel
    if not p.wait:
        return
    deadline = time.monotonic() + p.wait
    while True:
        found = (Entity.parse(key) for key in node.transport.tokens(pattern("sub")))
        heard = {each.name for each in found if each is not None and each.session != node.transport.session}
        lonely = [each.name for each in stage.outputs if each.name not in heard and not _wanted(each)]
        if not lonely or (not p.topics and len(lonely) < len(stage.outputs)):
            return
        if time.monotonic() > deadline:
            raise NotPlayed(f"nobody has subscribed to {', '.join(lonely[:5])} within {p.wait:g} s")
        ctx.idle()


def _wanted(output: Output[Any]) -> bool:
    """What is latched counts as wanted always, so it says nothing."""
    return output.wanted and output.topic.quality.name != "LATCHED"


def _account(
    ctx: Context[PlayerParameters], bag: Bag, choice: Choice, playback: Playback, lost: tuple[str, ...]
) -> None:
    troubles = list(bag.troubles)
    if lost:
        troubles.append(f"lockstep went on without {', '.join(lost)}")
    troubles += [f"{count} messages of {topic} were not of their type" for topic, count in playback.unread.items()]
    troubles += [f"{count} messages of {topic} bear no time before 2038" for topic, count in playback.untimed.items()]
    if choice.refused:
        troubles.append(f"not played: {', '.join(sorted(choice.refused))}")
    if troubles:
        raise NotPlayed("; ".join(troubles))
