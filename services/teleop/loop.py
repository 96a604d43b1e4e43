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
from services.teleop.keys import Keyboard, KeyState, is_stop, on_key, reconfigured
from services.teleop.robot import CommandPublisher, RobotMonitor
from services.teleop.screen import Screen, View
from services.teleop.script import KeyScript, script_events
from services.teleop.terminal import Terminal, require_terminal

LOOP_PERIOD_S = 0.02
"""Wall time of a turn without keys: how late a released key is noticed."""
EXIT_DELAY_S = 1.0
"""Simulation time for which a script stays when it has fallen silent. So the base forgets its last command by time-out,
and not when the process leaves, which no two runs do at the same simulation time."""


def run(ctx: Context[TeleopParameters]) -> None:
    """Drive until the person, the script or the supervisor ends it; the last command is zero, unless others drive."""
    script = KeyScript(script_events(ctx.params))
    if script.done:
        require_terminal()
    commands = CommandPublisher(ctx)
    commands.wait_for_base()
    try:
        if script.done:
            with Terminal() as keyboard:
                run_keyboard(ctx, keyboard, Screen(), commands)
        else:
            run_script(ctx, script, commands)
    finally:
        commands.close()


def run_script(ctx: Context[TeleopParameters], script: KeyScript, commands: CommandPublisher) -> None:
    """Play the script from the first tick on, and again when time begins anew, until the robot has been let go."""
    p = ctx.params
    keys, start, spoke = KeyState.initial(p), -1, 0.0
    for tick in ctx.ticks():
        if ctx.params_changed:
            keys, p = reconfigured(keys, p, ctx.params), ctx.params
            commands.repeater.reconfigure(p.repeat_rate, p.give_way)
        if start < 0 or tick.reset:
            keys, start, spoke = KeyState.initial(p), tick.time, 0.0
            script.rewind()
            commands.repeater.reset()
        now = (tick.time - start) / 1e9
        events = script.pop_due(now)
        for event in events:
            keys = on_key(keys, event, p)
        commands.update(keys.command(now), now, now, bool(events), any(map(is_stop, events)))
        spoke = spoke if commands.repeater.state == "silent" else now
        if script.done and now - spoke > EXIT_DELAY_S:
            return


def run_keyboard(
    ctx: Context[TeleopParameters], keyboard: Keyboard, screen: Screen, commands: CommandPublisher
) -> None:
    """Follow the keyboard until it is gone or the process is asked to end."""
    p, node, repeater = ctx.params, ctx.node, commands.repeater
    keys, monitor = KeyState.initial(p), RobotMonitor(ctx, time.monotonic())
    screen.print_header(commands.topic)
    while True:
        due = time.monotonic() + LOOP_PERIOD_S
        events = keyboard.read_events(LOOP_PERIOD_S)
        wall = time.monotonic()
        if ctx.update_params():
            keys, p = reconfigured(keys, p, ctx.params), ctx.params
            repeater.reconfigure(p.repeat_rate, p.give_way)
        if monitor.update(wall):
            repeater.reset()
        for event in events:
            keys = on_key(keys, event, p)
        # Up to ``due`` no other key event came; of the time since, when this loop was held up, nobody has looked.
        wanted = keys.command(min(wall, due))
        commands.update(wanted, wall, monitor.sim_seconds, bool(events), any(map(is_stop, events)))
        node.heartbeat.state, node.heartbeat.ticks = monitor.state, node.heartbeat.ticks + 1
        node.spin_once()
        view = View(
            node=ctx.node_name,
            speed=keys.speed,
            turn=keys.turn,
            at_limit=keys.speed >= p.speed_limit or keys.turn >= p.turn_limit,
            sent=None if repeater.state == "silent" else repeater.sent,
            odometry_twist=monitor.odometry_twist,
            base_status=monitor.base_status,
            error=monitor.error,
        )
        screen.update(view, wall)
