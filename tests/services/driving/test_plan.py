"""A plan as messages: the longest one fits its topic, and each change is published once."""

from __future__ import annotations

import pytest

from messages.base import encode
from messages.elea import GoalStatus
from messages.errors import BadInput
from messages.geometry import Pose, PoseStamped
from messages.nav import Path
from messages.se2 import ZERO_TWIST
from messages.std import Header, Time
from messages.topics import PLAN
from services.driving.plan import MAX_PUBLISHED, Goal, Plan, PlanReporter, Progress, path_message, plan_to_pose

HEADER = Header(frame_id="odom")


def test_the_longest_plan_fits_its_topic() -> None:
    plan = Plan.through([(-1234.5678, 2.0 / 3.0)] * 3, 10_000, 0.1)
    message = path_message(plan, Header(stamp=Time.of(2**60), frame_id="a_robot_of_a_long_name/odom"))
    assert len(plan.goals) == 30_000
    assert len(message.poses) == MAX_PUBLISHED
    assert len(encode(message)) <= PLAN.largest


def test_plan_and_status_are_published_when_they_change() -> None:
    plans, states = list[Path](), list[GoalStatus]()
    reporter = PlanReporter(plans.append, states.append)
    plan, driving = Plan.through([(1.0, 0.0), (2.0, 0.0)]), Progress("driving", ZERO_TWIST, 0, 2)
    for _ in range(3):
        reporter.report_plan(plan, HEADER)
        reporter.report_status(driving, HEADER)
    assert (len(plans), [each.state for each in states]) == (1, ["driving"])
    reporter.report_status(Progress("reached", ZERO_TWIST, 0, 2), HEADER)
    reporter.report_status(Progress("reached", ZERO_TWIST, 1, 2), HEADER)
    assert [(each.state, each.index) for each in states[1:]] == [("reached", 0), ("reached", 1)]
    reporter.reset()
    reporter.report_plan(plan, HEADER)
    reporter.report_status(Progress("reached", ZERO_TWIST, 1, 2), HEADER)
    assert (len(plans), len(states)) == (2, 4), "after a reset both are published again"


def test_a_goal_in_another_frame_is_refused() -> None:
    pose = Pose.planar(1.0, 2.0, 0.5)
    for frame in ("", "world", "a/odom"):
        plan = plan_to_pose(PoseStamped(header=Header(frame_id=frame), pose=pose), "a/odom")
        assert plan == Plan((Goal(1.0, 2.0, pytest.approx(0.5)),))
    with pytest.raises(BadInput, match="its frame 'map' is neither 'world' nor 'a/odom'"):
        plan_to_pose(PoseStamped(header=Header(frame_id="map"), pose=pose), "a/odom")
