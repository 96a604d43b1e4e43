"""The loops of teleop: keys in, commands out; by a person in wall time, or by a script in simulation time.

Two times meet here. A hand lives in wall time, so whether a key is held is judged in wall time: a simulation that is
paused, slow or fast changes nothing in it. What the robot gets of it lives in simulation time: zero is held for
``give_way`` of simulation time after the last key, so that a robot that is let go during a pause, or in a simulation
that crawls, is still told to stop once time goes on. A key that is held through a pause drives on when time does. In a
simulation that is faster than the wall clock, a tap lasts longer for the robot by that factor; commands then go out
more often than ``repeat_rate``, since a base's time-out is of simulation time. The loop of a person does not follow
``Context.ticks``: it must turn, and notice a released key, also when no clock comes.
"""

from __future__ import annotations

import time

from services.runtime.context import Context
from services.teleop import TeleopParameters
from services.teleop.display import Screen, View
from services.teleop.hand import Hand, retuned, stops, strike
from services.teleop.keys import Keyboard
from services.teleop.mouth import Mouth
from services.teleop.outlook import Outlook
from services.teleop.script import Script, presses
from services.teleop.terminal import Terminal, require_terminal

TURN_S = 0.02
"""Wall time of a turn without keys: how late a released key is noticed."""
REST_S = 1.0
"""Simulation time for which a script stays when it has fallen silent. So the base forgets its last command by time-out,
and not when the process leaves, which no two runs do at the same simulation time."""


def run(ctx: Context[TeleopParameters]) -> None:
    """Drive until the person, the script or the supervisor ends it; the last command is zero, unless others drive."""
    script = Script(presses(ctx.params))
    if script.done:
        require_terminal()
    mouth = Mouth(ctx)
    mouth.await_base()
    try:
        if script.done:
            with Terminal() as keyboard:
                by_hand(ctx, keyboard, Screen(), mouth)
        else:
            by_script(ctx, script, mouth)
    finally:
        mouth.close()


def by_script(ctx: Context[TeleopParameters], script: Script, mouth: Mouth) -> None:
    """Play the script from the first tick on, and again when time begins anew, until the robot has been let go."""
    p = ctx.params
    hand, start, spoke = Hand.of(p), -1, 0.0
    for tick in ctx.ticks():
        if ctx.params_changed:
            hand, p = retuned(hand, p, ctx.params), ctx.params
            mouth.voice.retune(p.repeat_rate, p.give_way)
        if start < 0 or tick.reset:
            hand, start, spoke = Hand.of(p), tick.time, 0.0
            script.rewind()
            mouth.voice.restart()
        now = (tick.time - start) / 1e9
        struck = script.take(now)
        for press in struck:
            hand = strike(hand, press, p)
        mouth.say(hand.wants(now), now, now, bool(struck), any(map(stops, struck)))
        spoke = spoke if mouth.voice.state == "silent" else now
        if script.done and now - spoke > REST_S:
            return


def by_hand(ctx: Context[TeleopParameters], keyboard: Keyboard, screen: Screen, mouth: Mouth) -> None:
    """Follow the keyboard until it is gone or the process is asked to end."""
    p, node, voice = ctx.params, ctx.kernel, mouth.voice
    hand, outlook = Hand.of(p), Outlook(ctx, time.monotonic())
    screen.open(mouth.topic)
    while True:
        due = time.monotonic() + TURN_S
        struck = keyboard.take(TURN_S)
        wall = time.monotonic()
        if ctx.follow():
            hand, p = retuned(hand, p, ctx.params), ctx.params
            voice.retune(p.repeat_rate, p.give_way)
        if outlook.look(wall):
            voice.restart()
        for press in struck:
            hand = strike(hand, press, p)
        # Up to ``due`` nothing else was struck; of the time since, when this loop was held up, nobody has looked.
        wanted = hand.wants(min(wall, due))
        mouth.say(wanted, wall, outlook.seconds, bool(struck), any(map(stops, struck)))
        node.heart.state, node.heart.ticks = outlook.state, node.heart.ticks + 1
        node.turn()
        view = View(
            node=ctx.node,
            speed=hand.speed,
            turn=hand.turn,
            at_limit=hand.speed >= p.speed_limit or hand.turn >= p.turn_limit,
            sent=None if voice.state == "silent" else voice.sent,
            moving=outlook.moving,
            base=outlook.base,
            trouble=outlook.trouble,
        )
        screen.show(view, wall)
