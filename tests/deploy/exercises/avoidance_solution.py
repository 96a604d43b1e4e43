"""A solution of the exercise on obstacle avoidance: drive in the free direction nearest to that of the goal."""

from __future__ import annotations

from math import atan2, cos, hypot, inf, pi, remainder, sin, tau

from services.runtime import CMD_VEL, ODOM, SCAN, STOP, Context, LaserScan, Twist, main

GOAL = (6.0, 0.0)
WIDTH = 0.24
"""Half the width of the free lane that a heading needs [m]: the robot's radius, a clearance and a reserve."""
LOOK_AHEAD = 1.2
STEPS = 72


def free_way(scan: LaserScan, heading: float) -> float:
    """Return the free length [m] of a lane along ``heading`` [rad], at most LOOK_AHEAD."""
    free = LOOK_AHEAD
    for index, distance in enumerate(scan.ranges):
        if not scan.range_min <= distance < LOOK_AHEAD + WIDTH:
            continue
        angle = remainder(scan.angle_min + index * scan.angle_increment - heading, tau)
        if abs(angle) < pi / 2 and abs(distance * sin(angle)) < WIDTH:
            free = min(free, distance * cos(angle) - WIDTH)
    return free


def steer(x: float, y: float, yaw: float, scan: LaserScan | None) -> Twist:
    """Return the command for a robot at (x, y) [m] with heading ``yaw`` [rad]."""
    dx, dy = GOAL[0] - x, GOAL[1] - y
    if hypot(dx, dy) < 0.05 or scan is None:
        return STOP
    goal = remainder(atan2(dy, dx) - yaw, tau)
    best, turn, way = inf, 0.0, 0.0
    for step in range(-STEPS // 2, STEPS // 2):
        heading = step * tau / STEPS
        free = min(free_way(scan, heading), hypot(dx, dy))
        cost = abs(remainder(heading - goal, tau)) + 0.3 * abs(heading) + 4.0 * max(0.0, 0.8 - free)
        if cost < best:
            best, turn, way = cost, heading, free
    return Twist.planar(min(0.2, 0.5 * max(0.0, way)) * max(0.0, cos(turn)) ** 2, 2.0 * turn)


def run(ctx: Context) -> None:
    odom, scan = ctx.latest(ODOM), ctx.latest(SCAN)
    for _ in ctx.ticks():
        here = odom.fresh(0.5)
        if here is None:
            ctx.publish(CMD_VEL, STOP)
            continue
        pose = here.pose.pose
        ctx.publish(CMD_VEL, steer(pose.position.x, pose.position.y, pose.orientation.yaw, scan.value))


main(run, name="controller", about="Drives to the goal by the laser.", rate=5)
