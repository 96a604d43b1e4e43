"""The loops of teleop: drive with a user's keys in wall time, or with a script of keys in simulation time.

Two clocks meet here. Whether a key is held is decided in wall time, so that a paused, slow or fast simulation does not
matter. Commands are sent in simulation time: zero is sent for ``give_way`` of simulation time after the last key, so
that a robot released during a pause, or in a very slow simulation, is still stopped once time continues. A key held
through a pause drives on afterwards. In a simulation faster than the wall clock, a tap lasts longer for the robot by
that factor; commands are then sent more often than ``repeat_rate``, since a base's time-out is in simulation time. The
keyboard loop does not follow ``Context.ticks``: it must notice a released key even without a clock.
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
"""Wall time [s] of a loop without key events: the delay until a released key is noticed."""
EXIT_DELAY_S = 1.0
"""Simulation time [s] for which the process stays after a script has ended, so that the base times out reproducibly
instead of when the process exits."""


def run(ctx: Context[TeleopParameters]) -> None:
    """Drive until the user, the script or the supervisor stops it; the last command is zero, unless others drive."""
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
    """Play the script from the first tick, and again after a reset of time, until the robot has been released."""
    p = ctx.params
    keys, start, last_command = KeyState.initial(p), -1, 0.0
    for tick in ctx.ticks():
        if ctx.params_changed:
            keys, p = reconfigured(keys, p, ctx.params), ctx.params
            commands.repeater.reconfigure(p.repeat_rate, p.give_way)
        if start < 0 or tick.reset:
            keys, start, last_command = KeyState.initial(p), tick.time, 0.0
            script.rewind()
            commands.repeater.reset()
        now = (tick.time - start) / 1e9
        events = script.pop_due(now)
        for event in events:
            keys = on_key(keys, event, p)
        commands.update(keys.command(now), now, now, bool(events), any(map(is_stop, events)))
        last_command = last_command if commands.repeater.state == "silent" else now
        if script.done and now - last_command > EXIT_DELAY_S:
            return


def run_keyboard(
    ctx: Context[TeleopParameters], keyboard: Keyboard, screen: Screen, commands: CommandPublisher
) -> None:
    """Follow the keyboard until it is disconnected or the process is asked to stop."""
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
        # No other key event occurred until ``due``; if this loop was delayed since then, later events are not read yet.
        command = keys.command(min(wall, due))
        commands.update(command, wall, monitor.sim_seconds, bool(events), any(map(is_stop, events)))
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
            turtle=monitor.turtle,
        )
        screen.update(view, wall)
