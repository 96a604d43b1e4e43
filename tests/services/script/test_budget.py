"""The budget within a lockstep tick of a control loop that never waits."""

from __future__ import annotations

from services.script.budget import BUDGET, CALL, GazeboCalls

GET, SET = "/gazebo/get_joint_properties", "/gazebo/apply_joint_effort"


def test_a_state_after_a_command_waits_for_the_next_tick() -> None:
    calls, me, other = GazeboCalls(), object(), object()
    assert [calls.cost(each, me, 10) for each in (GET, GET, SET)] == [CALL] * 3
    assert calls.cost(GET, other, 10) == CALL
    assert calls.cost(GET, me, 10) == BUDGET
    assert calls.cost(GET, me, 10) == CALL
    assert calls.cost(SET, me, 20) == CALL
    assert calls.cost(GET, me, 30) == CALL
    assert calls.cost("/gazebo/get_world_properties", me, 20) == CALL
