"""The loop of the local planner: reads odometry, scans and goals, publishes commands, plan and status."""

from __future__ import annotations

import math

from messages.geometry import STOP, Twist
from messages.nav import Odometry
from messages.se2 import Pose2
from messages.sensor import LaserScan
from messages.std import Header, Time
from messages.topics import CMD_VEL, GOAL_POSE, ODOM, PLAN, SCAN, STATUS
from services.driving.plan import PlanReporter, plan_to_pose, pose_and_twist
from services.local_planner import PLAN_LEVEL, LocalPlannerParameters
from services.local_planner.controller import LocalPlanner, plan_of
from services.local_planner.detection import detect
from services.local_planner.tracking import Tracker
from services.runtime.context import Context
from services.runtime.errors import BadInput
from services.runtime.tf.listener import TransformListener


def run(ctx: Context[LocalPlannerParameters]) -> None:
    """Drive until asked to stop; the last command is STOP."""
    odom, scans, goals = ctx.latest(ODOM), ctx.latest(SCAN), ctx.stream(GOAL_POSE)
    commands = ctx.advertise(CMD_VEL)
    reporter = PlanReporter(ctx.advertise(PLAN).publish, ctx.advertise(STATUS).publish)
    mount = LaserMount(ctx.transforms(moving=False))
    frame = f"{ctx.namespace.strip('/')}/odom".lstrip("/")
    planner, tracker = LocalPlanner(ctx.params, ctx.node_name), Tracker()
    begun = False
    silence = 0.0
    try:
        for tick in ctx.ticks():
            p = ctx.params
            if (last := odom.value) is not None and last.header.frame_id:
                frame = last.header.frame_id
            header = Header(stamp=Time.of(tick.time), frame_id=frame)
            if tick.reset or not begun:
                planner, tracker = LocalPlanner(p, ctx.node_name), Tracker()
                silence, begun = 0.0, True
                reporter.reset()
            elif ctx.params_changed:
                planner.reconfigure(p)
                if ctx.params_changed & PLAN_LEVEL:
                    planner.set_plan(plan_of(p))
            for asked in goals.drain():
                try:
                    planner.set_plan(plan_to_pose(asked, frame))
                except BadInput as error:
                    ctx.log.warn(str(error), every=1)
            reporter.report_plan(planner.plan, header)

            now, scan = odom.fresh(p.odometry_timeout), scans.fresh(p.scan_timeout)
            if now is None or scan is None or (laser := mount.pose(now, scan)) is None:
                silence += tick.dt
                if silence > p.odometry_timeout:
                    missing = "odometry" if now is None else "laser scan" if scan is None else "transform to the laser"
                    ctx.log.warn(
                        f"no {missing} for {silence:.1f} s, standing still: is a robot with a laser in the simulation?",
                        every=5,
                    )
                progress = planner.hold()
            else:
                silence = 0.0
                if scan.header.stamp.ns != tracker.stamp:
                    there = pose_at(now, scan.header.stamp.ns)
                    tracker.update(scan.header.stamp.ns, there @ laser, detect(scan, p))
                here, moving = pose_at(now, tick.time), pose_and_twist(now)[1]
                progress = planner.step(here, moving, tracker.obstacles(tick.time), tick.dt)
            if progress.command is not None:
                commands.publish(Twist.planar(progress.command.v, progress.command.w))
            reporter.report_status(progress, header)
    finally:
        if planner.plan.goals:
            commands.publish(STOP)


class LaserMount:
    """The laser's pose on the robot, from the static frames; looked up once per pair of frames."""

    def __init__(self, transforms: TransformListener) -> None:
        self._transforms = transforms
        self._known: dict[tuple[str, str], Pose2] = {}

    def pose(self, odometry: Odometry, scan: LaserScan) -> Pose2 | None:
        """Return the pose of the scan's frame in the base's; None while unknown."""
        frames = odometry.child_frame_id, scan.header.frame_id
        if frames not in self._known:
            if not self._transforms.can(*frames):
                return None
            self._known[frames] = Pose2.from_msg(self._transforms.lookup(*frames).transform)
        return self._known[frames]


def pose_at(odometry: Odometry, time: int) -> Pose2:
    """Extrapolate the odometry at its velocity to ``time`` [ns], at most a few periods from its stamp."""
    here, moving = pose_and_twist(odometry)
    dt = (time - odometry.header.stamp.ns) / 1e9
    middle = here.yaw + moving.w * dt / 2
    return Pose2(
        here.x + moving.v * dt * math.cos(middle), here.y + moving.v * dt * math.sin(middle), here.yaw + moving.w * dt
    )
