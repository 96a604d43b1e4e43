"""Subscribes to the topics of one robot for the logger."""

from __future__ import annotations

from messages.topics import CMD_VEL, CONTROL_STATE, GOAL_POSE, GROUND_TRUTH, JOINT_STATES, ODOM, PLAN, SCAN, STATUS
from services.logger import LoggerParameters
from services.logger.columns import RobotColumns
from services.runtime.context import Context
from services.runtime.tf.buffer import TransformBuffer


class RobotSubscriptions:
    """Subscribes to a robot's topics and passes their messages to its columns.

    Args:
        ctx: the logger's context.
        robot: the robot's name.
        namespace: that of its topics.
        frames: transforms of ``/tf_static``.
        state: topic of an arm's controller state; empty without one.
        scans: whether to subscribe to its laser, which the simulation only computes for subscribers.
    """

    def __init__(
        self,
        ctx: Context[LoggerParameters],
        robot: str,
        namespace: str,
        frames: TransformBuffer,
        state: str = "",
        scans: bool = False,
    ) -> None:
        self.robot, self.columns = robot, RobotColumns(frames=frames)
        self._truth = ctx.stream(GROUND_TRUTH.of(namespace))
        self._odometry = ctx.stream(ODOM.of(namespace))
        self._commands = ctx.stream(CMD_VEL.of(namespace))
        self._joints = ctx.stream(JOINT_STATES.of(namespace))
        self._plans = ctx.stream(PLAN.of(namespace))
        self._status = ctx.stream(STATUS.of(namespace))
        self._scans = ctx.stream(SCAN.of(namespace)) if scans else None
        self.topics = tuple(each.of(namespace).name for each in (PLAN, GOAL_POSE, SCAN))
        """Those of its topics that are drawn as its own."""
        self._control = ctx.stream(CONTROL_STATE.named(state)) if state else None

    def collect(self, now: int, dt: float) -> None:
        """Collect the messages of the ``dt`` [s] before ``now`` [ns]."""
        self.columns.add_truth(self._truth.drain())
        self.columns.add_odometry(self._odometry.drain())
        self.columns.add_commands(self._commands.drain(), now, dt)
        self.columns.add_joints(self._joints.drain())
        if self._scans is not None:
            self.columns.add_scans(self._scans.drain())
        if self._control is not None:
            self.columns.add_control(self._control.drain())
        for plan in self._plans.drain():
            self.columns.add_plan(plan)
        for status in self._status.drain():
            self.columns.add_status(status)

    def collect_remaining(self, now: int) -> None:
        """Collect the messages that arrived after the last tick."""
        streams = (self._truth, self._odometry, self._commands, self._joints, self._plans, self._status)
        for stream in streams:
            stream.refresh()
        for optional in (self._scans, self._control):
            if optional is not None:
                optional.refresh()
        self.collect(now, 0.0)
