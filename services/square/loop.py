"""The loop of the square service: reads odometry, publishes commands, plan and status, and writes the log."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from messages.elea import GoalStatus
from messages.geometry import STOP, PoseStamped, Twist
from messages.nav import Path as Plan
from messages.se2 import Pose2, wrap
from messages.std import Header, Time
from messages.topics import CMD_VEL, GROUND_TRUTH, ODOM, PLAN, STATUS
from services.driving.plan import pose_and_twist
from services.runtime.context import Context
from services.square import SquareParameters
from services.square.controller import SquareController
from services.square.corners import SIDES, Square, StepResult
from services.square.csv_log import CsvLog, TruthBuffer


def run(ctx: Context[SquareParameters]) -> None:
    """Drive the square, then hold the robot until asked to stop; the last command is STOP."""
    with _open_log(ctx.params) as csv_log:
        _drive(ctx, csv_log)


def _drive(ctx: Context[SquareParameters], csv_log: CsvLog | None) -> None:
    odom, truth = ctx.latest(ODOM), ctx.stream(GROUND_TRUTH)
    commands, plans, states = ctx.advertise(CMD_VEL), ctx.advertise(PLAN), ctx.advertise(STATUS)
    frame = f"{ctx.namespace.strip('/')}/odom".lstrip("/")
    controller, truth_buffer = SquareController(ctx.params), TruthBuffer()
    shown: tuple[str, int] | None = None
    silence = 0.0
    try:
        for tick in ctx.ticks():
            if (last := odom.value) is not None and last.header.frame_id:
                frame = last.header.frame_id
            header = Header(stamp=Time.of(tick.time), frame_id=frame)
            if tick.reset:
                controller, truth_buffer, shown, silence = SquareController(ctx.params), TruthBuffer(), None, 0.0
                if csv_log is not None:
                    csv_log.reset()
            elif ctx.params_changed:
                controller.reconfigure(ctx.params)
            for sample in truth.drain():
                truth_buffer.add(sample.header.stamp.ns, pose_and_twist(sample)[0])

            now = odom.fresh(ctx.params.odometry_timeout)
            silence = silence + tick.dt if now is None else 0.0
            if silence > ctx.params.odometry_timeout:
                ctx.log.warn(
                    f"no odometry on {ctx.namespace.rstrip('/')}/odom for {silence:.1f} s, standing still: "
                    "is the robot in the simulation?",
                    every=5,
                )
            latched = controller.square
            result = controller.hold() if now is None else controller.step(tick.time, *pose_and_twist(now), tick.dt)
            if controller.square is not None and controller.square is not latched:
                plans.publish(path_message(controller.square, header))
                start = controller.square.start
                ctx.log.info(f"start latched at ({start.x:.3f}, {start.y:.3f}) m, {math.degrees(start.yaw):.2f} deg")
            if result.command is not None:
                commands.publish(Twist.planar(result.command.v, result.command.w))
            # As in the tutorial, the log ends with the square.
            if now is not None and csv_log is not None and result.state != "finished":
                actual, stamp = pose_and_twist(now)[0], now.header.stamp.ns
                csv_log.add_row(tick.time, result.desired, actual, truth_buffer.at(stamp), result.index, result.phase)
                if csv_log.error is not None:
                    ctx.log.error(f"the log {csv_log.path} ends here, it cannot be written: {csv_log.error}")
                    csv_log = None
            if result.phase == "astray":
                ctx.log.warn("the robot is far from its square, standing still: has it been moved?", every=5)
            elif result.timed_out:
                ctx.log.warn(
                    f"corner {result.index} not met within the tolerances after {ctx.params.patience:g} s, continuing: "
                    "is the robot blocked, or is the tolerance below what its base can resolve?"
                )
            if shown != (result.state, result.index) and controller.square is not None:
                shown = result.state, result.index
                states.publish(
                    status_message(result, controller.square, None if now is None else pose_and_twist(now)[0], header)
                )
                if result.state == "finished" and now is not None:
                    ctx.log.info(_closure_text(controller.square, pose_and_twist(now)[0]))
    finally:
        commands.publish(STOP)


@contextmanager
def _open_log(p: SquareParameters) -> Iterator[CsvLog | None]:
    if not p.log:
        yield None
        return
    with CsvLog(Path(p.log).absolute()) as csv_log:
        yield csv_log


def path_message(square: Square, header: Header) -> Plan:
    """Return the corners in order, each with the heading of the next side."""
    corners = (PoseStamped(header=header, pose=each.wrapped.to_msg()) for each in square.corners())
    return Plan(header=header, poses=tuple(corners))


def status_message(result: StepResult, square: Square, here: Pose2 | None, header: Header) -> GoalStatus:
    """Return the progress as a message; if endless, the index restarts with each round."""
    corner = square.corner(result.index)
    return GoalStatus(
        header=header,
        state=result.state,
        index=result.index if square.corner_count else result.index % SIDES,
        count=square.corner_count or SIDES,
        goal=corner.wrapped.to_msg(),
        distance=0.0 if here is None else math.hypot(corner.x - here.x, corner.y - here.y),
    )


def _closure_text(square: Square, here: Pose2) -> str:
    start = square.start
    off, turned = math.hypot(here.x - start.x, here.y - start.y), math.degrees(wrap(here.yaw - start.yaw))
    return f"square completed, by odometry {1000 * off:.1f} mm and {turned:+.2f} deg from its start"
