"""The logger's loop: writes every robot's topics and the log to a recording."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from pathlib import Path

from messages.names import absolute_namespace
from messages.topics import ROSOUT, WORLD_MARKERS, WORLD_STATES
from models.model import read_model
from services.logger import LoggerParameters
from services.logger.file_rotation import rotate
from services.logger.subscriptions import DisplaySubscriptions, RobotSubscriptions
from services.runtime.context import Context
from services.runtime.errors import BadInput

try:
    from services.logger.display_scene import DisplayScene
    from services.logger.recording import Recording
    from services.logger.viewer import open_viewer, should_open
except ImportError as error:
    raise BadInput(f"rerun cannot be loaded ({error}): is rerun-sdk installed in this environment?") from None


def run(ctx: Context[LoggerParameters]) -> None:
    """Record until stopped, including the last messages."""
    p = ctx.params
    file = Path(p.file or "run.rrd").absolute()
    port = p.port if p.serve else None
    robots = pair_models(p.robots, p.models)
    names = [name for name, _ in robots]
    namespaces = pair_names(names, "namespaces", p.namespaces or tuple(names))
    prefixes = pair_names(names, "frame_prefixes", p.frame_prefixes or tuple(f"{name}/" for name in names))
    if aside := rotate(file):
        ctx.log.warn(f"{file.name} existed already, perhaps after a crash: it is kept as {aside.name}")
    with Recording(file, robots, p.extent, ctx.log.warn, port, p.memory, p.footer, prefixes) as recording:
        ctx.log.info(f"recording to {file}" + (f", live at {recording.url}" if recording.url else ""))
        show_live(ctx, recording)
        states = dict(zip(names, p.states, strict=False))
        frames = ctx.transforms(moving=False)
        subscriptions = [
            RobotSubscriptions(
                ctx,
                robot,
                absolute_namespace(namespaces[robot]),
                frames.buffer,
                states.get(robot, ""),
                p.scans and read_model(model).laser is not None,
            )
            for robot, model in robots
        ]
        displays = DisplaySubscriptions(ctx, [name for each in subscriptions for name in each.topics])
        scene = DisplayScene(recording.log_at, displays.frame, ctx.log.warn)
        lines, markers, world_states = ctx.stream(ROSOUT), ctx.stream(WORLD_MARKERS), ctx.stream(WORLD_STATES)
        due = time.monotonic() + p.window
        try:
            for tick in ctx.ticks():
                if tick.reset:
                    recording.write_world(world_states.drain())
                    write_batches(ctx, recording, subscriptions, last=True)
                    recording.restart()
                    scene.restart()
                    for each in subscriptions:
                        each.columns.clear()
                for array in markers.drain():
                    recording.set_world(array)
                for each in subscriptions:
                    each.collect(tick.time, tick.dt)
                displays.collect(scene, tick.time)
                recording.show_images(scene.images)
                if time.monotonic() >= due:
                    recording.write_log(lines.drain())
                    recording.write_world(world_states.drain())
                    write_batches(ctx, recording, subscriptions)
                    recording.commit()
                    due = time.monotonic() + ctx.params.window
        finally:
            ctx.node.update_subscribers()
            for stream in (lines, markers, world_states):
                stream.refresh()
            frames.refresh()
            for each in subscriptions:
                each.collect_remaining(ctx.now)
            displays.collect(scene, ctx.now)
            scene.update(ctx.now, final=True)
            for array in markers.drain():
                recording.set_world(array)
            recording.write_world(world_states.drain())
            recording.write_log(lines.drain())
            write_batches(ctx, recording, subscriptions, last=True)


def pair_models(robots: Sequence[str], models: Sequence[str]) -> list[tuple[str, str]]:
    """Pair each robot with its model; raises BadInput for mismatched counts and for duplicate names."""
    names = [robot.strip("/") for robot in robots]
    if len(set(names)) != len(names):
        raise BadInput(f"logger: robots {', '.join(names)}: a name is given twice")
    if len(models) not in (1, len(robots)):
        raise BadInput(
            f"logger: {len(models)} models for {len(robots)} robots: give one model for each, or one for all"
        )
    return list(zip(names, models if len(models) > 1 else (*models,) * len(robots), strict=True))


def pair_names(robots: Sequence[str], what: str, given: Sequence[str]) -> dict[str, str]:
    """Map each robot to its value; raises BadInput for mismatched counts."""
    if len(given) != len(robots):
        raise BadInput(f"logger: {len(given)} {what} for {len(robots)} robots: give one for each, or none")
    return dict(zip(robots, given, strict=True))


def write_batches(
    ctx: Context[LoggerParameters],
    recording: Recording,
    subscriptions: Sequence[RobotSubscriptions],
    last: bool = False,
) -> None:
    """Write the collected columns, and warn about dropped rows."""
    recording.write({each.robot: each.columns.flush() for each in subscriptions}, last)
    if lost := sum(each.columns.dropped for each in subscriptions):
        ctx.log.warn(
            f"{lost} rows were dropped, as messages arrive faster than they are written: is the disk slow?", every=5.0
        )


def show_live(ctx: Context[LoggerParameters], recording: Recording) -> None:
    """Open a viewer if the parameters ask for one; the recording continues without it."""
    if recording.url and should_open(ctx.params.view, os.environ):
        try:
            open_viewer(recording.url, os.environ, recording.file.with_suffix(".viewer.log"))
        except OSError as error:
            ctx.log.warn(f"no viewer: {error}; open one with: rerun --connect {recording.url}")
