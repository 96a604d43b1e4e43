"""A service that sends an arm trajectory goals of the action and publishes the outcome as checks."""

from __future__ import annotations

import hashlib

import msgspec

from messages.actionlib import GoalID
from messages.control import (
    FollowJointTrajectoryActionGoal,
    FollowJointTrajectoryActionResult,
    FollowJointTrajectoryGoal,
)
from messages.sensor import JointState
from messages.std import Duration
from messages.topics import JOINT_STATES, Quality, Topic
from messages.trajectory import JointTrajectory, JointTrajectoryPoint
from services.runtime import Context, main

ACTION = "arm_controller/follow_joint_trajectory"
GOAL = Topic(f"{ACTION}/goal", FollowJointTrajectoryActionGoal, 0, Quality.EVENT, "")
RESULT = Topic(f"{ACTION}/result", FollowJointTrajectoryActionResult, 0, Quality.EVENT, "")

JOINTS = "shoulder", "elbow"
WAYS = {"early": (0.5, 0.5), "first": (-0.8, 1.0), "second": (-0.5, 0.5), "third": (0.3, -1.0)}
"""Joint positions [rad] of the goals; each takes 1 s."""
STARTS = {5: "early", 20: "first", 85: "second", 160: "third"}
"""Ticks of 20 ms at which the goals are sent."""
LAST = 230
"""The tick at which the checks are published."""


def run(ctx: Context) -> None:
    """Send the goals at their ticks, then publish their outcome and a digest of all received messages."""
    results, states = ctx.stream(RESULT), ctx.stream(JOINT_STATES)
    ended: dict[str, int] = {}
    seen = hashlib.sha256()
    last = JointState()
    for number, _ in enumerate(ctx.ticks()):
        if (name := STARTS.get(number)) is not None:
            ctx.publish(GOAL, goal(name))
        for state in states.drain():
            seen.update(msgspec.json.encode(state))
            last = state
        for result in results.drain():
            seen.update(msgspec.json.encode(result))
            ended[result.status.goal_id.id] = result.status.status
        if number == LAST:
            for name in WAYS:
                ctx.check(f"{name}_state", ended.get(name), min=0)
            where = dict(zip(last.name, last.position, strict=True))
            for joint, wanted in zip(JOINTS, WAYS["third"], strict=True):
                ctx.check(joint, where.get(joint), min=wanted - 0.01, max=wanted + 0.01)
            ctx.check("digest", int(seen.hexdigest()[:8], 16), min=0)


def goal(name: str) -> FollowJointTrajectoryActionGoal:
    """Return the goal of this name."""
    end = JointTrajectoryPoint(
        positions=WAYS[name],
        velocities=(0.0, 0.0),
        accelerations=(0.0, 0.0),
        time_from_start=Duration.of(1_000_000_000),
    )
    way = JointTrajectory(joint_names=JOINTS, points=(end,))
    return FollowJointTrajectoryActionGoal(goal_id=GoalID(id=name), goal=FollowJointTrajectoryGoal(trajectory=way))


if __name__ == "__main__":
    main(run, name="client", about="Sends goals to an arm.", rate=50)
