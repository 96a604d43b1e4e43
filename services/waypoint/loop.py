"""The loop of the waypoint service: reads odometry and goals, publishes commands, plan and status."""

from __future__ import annotations

from messages.geometry import STOP, Twist
from messages.std import Header, Time
from messages.topics import CMD_VEL, GOAL_POSE, ODOM, PLAN, STATUS
from services.driving.plan import PlanReporter, plan_to_pose, pose_and_twist
from services.runtime.context import Context
from services.runtime.errors import BadInput
from services.waypoint import PLAN_LEVEL, WaypointParameters
from services.waypoint.controller import WaypointController, plan_of


def run(ctx: Context[WaypointParameters]) -> None:
    """Drive until asked to stop; the last command is STOP.

    Commands continue after the end: zero holds the robot, while silence would count as a time-out.
    """
    odom, goals = ctx.latest(ODOM), ctx.stream(GOAL_POSE)
    commands = ctx.advertise(CMD_VEL)
    reporter = PlanReporter(ctx.advertise(PLAN).publish, ctx.advertise(STATUS).publish)
    frame = f"{ctx.namespace.strip('/')}/odom".lstrip("/")
    controller = WaypointController(ctx.params)
    begun = False
    silence = 0.0
    try:
        for tick in ctx.ticks():
            if (last := odom.value) is not None and last.header.frame_id:
                frame = last.header.frame_id
            header = Header(stamp=Time.of(tick.time), frame_id=frame)
            if tick.reset or not begun:
                controller, silence, begun = WaypointController(ctx.params), 0.0, True
                reporter.reset()
            elif ctx.params_changed:
                controller.reconfigure(ctx.params)
                if ctx.params_changed & PLAN_LEVEL:
                    controller.set_plan(plan_of(ctx.params))
            for goal_pose in goals.drain():
                try:
                    controller.set_plan(plan_to_pose(goal_pose, frame))
                except BadInput as error:
                    ctx.log.warn(str(error), every=1)
            reporter.report_plan(controller.plan, header)

            now = odom.fresh(ctx.params.odometry_timeout)
            silence = silence + tick.dt if now is None else 0.0
            if silence > ctx.params.odometry_timeout:
                ctx.log.warn(
                    f"no odometry for {silence:.1f} s, standing still: is the robot in the simulation?", every=5
                )
            progress = controller.hold() if now is None else controller.step(*pose_and_twist(now), tick.dt)
            if progress.command is not None:
                commands.publish(Twist.planar(progress.command.v, progress.command.w))
            if reporter.report_status(progress, header):
                x, y = progress.goal.x, progress.goal.y
                ctx.log.debug(f"{progress.state}, point {progress.index + 1} of {progress.count}, ({x:g}, {y:g})")
    finally:
        if controller.plan.goals:
            commands.publish(STOP)
