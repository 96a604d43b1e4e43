"""The loop of the square service: reads odometry, publishes commands, plan and status, and writes the log."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from messages.elea import GoalStatus
from messages.geometry import STOP, PoseStamped, Twist
from messages.nav import Odometry
from messages.nav import Path as Plan
from messages.se2 import Pose2, Twist2, wrap
from messages.std import Header, Time
from messages.topics import CMD_VEL, GROUND_TRUTH, ODOM, PLAN, STATUS
from services.runtime.context import Context
from services.square import SquareParameters
from services.square.controller import SquareController
from services.square.corners import SIDES, Square, StepResult
from services.square.csv_log import CsvLog, TruthBuffer


def run(ctx: Context[SquareParameters]) -> None:
    """Drive the square, then hold the robot until asked to stop; the last command is STOP."""
    with _open_log(ctx.params) as record:
        _drive(ctx, record)


def _drive(ctx: Context[SquareParameters], record: CsvLog | None) -> None:
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
                if record is not None:
                    record.reset()
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
            move = controller.hold() if now is None else controller.step(tick.time, *pose_and_twist(now), tick.dt)
            if controller.square is not None and controller.square is not latched:
                plans.publish(path_message(controller.square, header))
                start = controller.square.start
                ctx.log.info(f"start latched at ({start.x:.3f}, {start.y:.3f}) m, {math.degrees(start.yaw):.2f} deg")
            if move.command is not None:
                commands.publish(Twist.planar(move.command.v, move.command.w))
            # As in the tutorial, the log ends with the square.
            if now is not None and record is not None and move.state != "finished":
                actual, stamp = pose_and_twist(now)[0], now.header.stamp.ns
                record.add_row(tick.time, move.desired, actual, truth_buffer.at(stamp), move.index, move.phase)
                if record.error is not None:
                    ctx.log.error(f"the log {record.path} ends here, it cannot be written: {record.error}")
                    record = None
            if move.phase == "astray":
                ctx.log.warn("the robot is far from its square, standing still: has it been moved?", every=5)
            elif move.timed_out:
                ctx.log.warn(
                    f"corner {move.index} not met within the tolerances for {ctx.params.patience:g} s, going on: "
                    "is the robot blocked, or is the tolerance below what its base can resolve?"
                )
            if shown != (move.state, move.index) and controller.square is not None:
                shown = move.state, move.index
                states.publish(
                    status_message(move, controller.square, None if now is None else pose_and_twist(now)[0], header)
                )
                if move.state == "finished" and now is not None:
                    ctx.log.info(_closure_text(controller.square, pose_and_twist(now)[0]))
    finally:
        commands.publish(STOP)


@contextmanager
def _open_log(p: SquareParameters) -> Iterator[CsvLog | None]:
    if not p.log:
        yield None
        return
    with CsvLog(Path(p.log).absolute()) as record:
        yield record


def pose_and_twist(odometry: Odometry) -> tuple[Pose2, Twist2]:
    """Return the planar pose and velocity of an odometry message."""
    return Pose2.from_msg(odometry.pose.pose), Twist2.from_msg(odometry.twist.twist)


def path_message(square: Square, header: Header) -> Plan:
    """Return the corners in order, each with the heading of the next side."""
    corners = (PoseStamped(header=header, pose=each.wrapped.to_msg()) for each in square.corners())
    return Plan(header=header, poses=tuple(corners))


def status_message(move: StepResult, square: Square, here: Pose2 | None, header: Header) -> GoalStatus:
    """Return the progress as a message; if endless, the index restarts with each round."""
    corner = square.corner(move.index)
    return GoalStatus(
        header=header,
        state=move.state,
        index=move.index if square.corner_count else move.index % SIDES,
        count=square.corner_count or SIDES,
        goal=corner.wrapped.to_msg(),
        distance=0.0 if here is None else math.hypot(corner.x - here.x, corner.y - here.y),
    )


def _closure_text(square: Square, here: Pose2) -> str:
    start = square.start
    off, turned = math.hypot(here.x - start.x, here.y - start.y), math.degrees(wrap(here.yaw - start.yaw))
    return f"square completed, by odometry {1000 * off:.1f} mm and {turned:+.2f} deg from its start"
