"""A plan as a message: every one that can be driven fits its topic."""

from __future__ import annotations

from messages.base import encode
from messages.std import Header, Time
from messages.topics import PLAN
from services.driving.plan import MAX_PUBLISHED, Plan, path_message


def test_the_longest_plan_fits_its_topic() -> None:
    plan = Plan.through([(-1234.5678, 2.0 / 3.0)] * 3, 10_000, 0.1)
    message = path_message(plan, Header(stamp=Time.of(2**60), frame_id="a_robot_of_a_long_name/odom"))
    assert len(plan.goals) == 30_000
    assert len(message.poses) == MAX_PUBLISHED
    assert len(encode(message)) <= PLAN.largest
