"""A synthetic drive for the logger's tests: messages of four robots that drive through the tutorial's points."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from messages.elea import GoalStatus
from messages.geometry import Pose, PoseStamped, PoseWithCovariance, Twist, TwistWithCovariance
from messages.nav import Odometry, Path
from messages.sensor import JointState
from messages.std import SECOND, Header, Time

X = (5.0, 1.0, 2.5, 4.0, 0.0, 0.0, 5.0, 5.0, 0.0, 0.0)
Y = (0.0, -4.0, 2.5, -4.0, 0.0, 2.5, 2.5, -4.0, -4.0, 0.0)
STEP = 20_000_000
"""Time between two samples [ns]: 50 Hz."""
MAX_LINEAR, MAX_ANGULAR = 0.22, 1.5
WHEEL, TRACK = 0.033, 0.16
JOINTS = ("wheel_left_joint", "wheel_right_joint")


@dataclass
class SyntheticRobot:
    """A unicycle that turns towards its goal and drives there, with drifting odometry."""

    y0: float
    drift: float = 0.0

    def __post_init__(self) -> None:
        self.x, self.y, self.yaw, self.v, self.wanted = 0.0, self.y0, 1.57, 0.0, 0.0
        self.left = self.right = self.travelled = 0.0
        self.goal, self.time = 0, 0
        self.goals = [(x, y + self.y0) for x, y in zip(X, Y, strict=True)]

    @property
    def header(self) -> Header:
        return Header(stamp=Time.of(self.time), frame_id="world")

    def step(self) -> tuple[float, float]:
        """Advance by one sample; return the command (v [m/s], w [rad/s])."""
        dt = STEP / SECOND
        gx, gy = self.goals[self.goal]
        distance = math.hypot(gx - self.x, gy - self.y)
        if distance < 0.02 and self.goal < len(self.goals) - 1:
            self.goal += 1
        error = math.remainder(math.atan2(gy - self.y, gx - self.x) - self.yaw, math.tau)
        wanted = 0.0 if abs(error) > 0.3 or distance < 0.01 else min(MAX_LINEAR, distance)
        w = 0.0 if distance < 0.01 else max(-MAX_ANGULAR, min(MAX_ANGULAR, 2.5 * error))
        self.wanted = wanted
        self.v += max(-0.5 * dt, min(0.5 * dt, wanted - self.v))
        self.yaw += w * dt
        self.x += self.v * math.cos(self.yaw) * dt
        self.y += self.v * math.sin(self.yaw) * dt
        self.travelled += self.v * dt
        self.left += (self.v - w * TRACK / 2) * dt / WHEEL
        self.right += (self.v + w * TRACK / 2) * dt / WHEEL
        self.time += STEP
        return wanted, w

    def truth(self) -> Odometry:
        pose = PoseWithCovariance(pose=Pose.planar(self.x, self.y, self.yaw))
        return Odometry(header=self.header, pose=pose, twist=TwistWithCovariance(twist=Twist.planar(self.v, 0.0)))

    def odometry(self) -> Odometry:
        away = self.drift * self.travelled
        return Odometry(header=self.header, pose=PoseWithCovariance(pose=Pose.planar(self.x + away, self.y, self.yaw)))

    def joints(self) -> JointState:
        return JointState(header=self.header, name=JOINTS, position=(self.left, self.right))

    def plan(self) -> Path:
        poses = tuple(PoseStamped(header=self.header, pose=Pose.planar(x, y)) for x, y in self.goals)
        return Path(header=self.header, poses=poses)

    def status(self) -> GoalStatus:
        return GoalStatus(header=self.header, state="driving", index=self.goal, count=len(self.goals))


def synthetic_fleet() -> dict[str, SyntheticRobot]:
    """Return the tutorial's four robots at their starts."""
    return {f"tb3_{k}": SyntheticRobot(y0=0.5 * k, drift=0.001 * (k + 1)) for k in range(4)}


def step_all(robots: dict[str, SyntheticRobot], count: float) -> Iterator[int]:
    """Step all robots together for ``count`` [s]; yield the time [ns] after each step."""
    for _ in range(round(count * SECOND / STEP)):
        for robot in robots.values():
            robot.step()
        yield next(iter(robots.values())).time
