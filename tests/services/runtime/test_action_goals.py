"""The states of action goals, as in actionlib's servers."""

from __future__ import annotations

from messages.actionlib import GoalID, Status
from messages.std import Time
from services.runtime.action_goals import FORGET_AFTER_NS, MAX_GOALS, Goals

S = 1_000_000_000


def received(goals: Goals, name: str = "", stamp: int = 0, now: int = S) -> str:
    goal = goals.receive(GoalID(id=name, stamp=Time.of(stamp)), "/arm", now)
    assert goal is not None
    return goal.id


def test_a_goal_is_pending_then_active_then_over() -> None:
    goals = Goals()
    one = received(goals, "one")
    assert goals.state(one) is Status.PENDING
    goals.accept(one)
    assert goals.state(one) is Status.ACTIVE
    assert goals.end(one, Status.SUCCEEDED, 2 * S, "done").status == 3
    assert [each.text for each in goals.list(2 * S + FORGET_AFTER_NS)] == ["done"]
    assert goals.list(2 * S + FORGET_AFTER_NS + 1) == ()


def test_a_goal_without_a_name_or_stamp_gets_them_and_none_counts_twice() -> None:
    goals = Goals()
    assert received(goals) == "/arm-1-1.000"
    assert goals.status("/arm-1-1.000").goal_id.stamp.ns == S
    assert received(goals) == "/arm-2-1.000"
    received(goals, "one")
    goals.end("one", Status.REJECTED, S, "")
    assert goals.receive(GoalID(id="one"), "/arm", S) is None
    assert goals.state("one") is Status.REJECTED


def test_a_cancellation_means_one_or_all_or_those_up_to_a_time() -> None:
    def three() -> Goals:
        goals = Goals()
        for number in (1, 2, 3):
            received(goals, str(number), number * S)
            goals.accept(str(number))
        goals.end("3", Status.SUCCEEDED, 3 * S, "")
        return goals

    assert three().cancel(GoalID(), 4 * S) == ["1", "2"], "what is over stays over"
    assert three().cancel(GoalID(id="2"), 4 * S) == ["2"]
    assert three().cancel(GoalID(stamp=Time.of(S)), 4 * S) == ["1"]
    assert three().cancel(GoalID(id="2", stamp=Time.of(S)), 4 * S) == ["1", "2"]
    assert three().cancel(GoalID(id="3"), 4 * S) == []


def test_a_goal_that_was_cancelled_before_it_came_is_recalled() -> None:
    goals = Goals()
    assert goals.cancel(GoalID(id="early"), S) == []
    assert goals.state("early") is Status.RECALLING
    received(goals, "early")
    assert goals.state("early") is Status.RECALLED
    goals.cancel(GoalID(stamp=Time.of(5 * S)), S)
    assert goals.state(received(goals, "old", 4 * S)) is Status.RECALLED
    assert goals.state(received(goals, "new", 6 * S)) is Status.PENDING


def test_the_list_stays_short() -> None:
    goals = Goals()
    received(goals, "kept")
    goals.accept("kept")
    for number in range(2 * MAX_GOALS):
        goals.cancel(GoalID(id=f"never {number}"), S)
        received(goals, str(number))
        goals.end(str(number), Status.REJECTED, S, "")
    assert len(goals.list(S)) <= MAX_GOALS
    assert goals.state("kept") is Status.ACTIVE


def test_a_reset_of_time_forgets_what_was_before() -> None:
    goals = Goals()
    goals.cancel(GoalID(stamp=Time.of(100 * S)), 100 * S)
    received(goals, "done", now=100 * S)
    assert goals.state("done") is Status.PENDING
    goals.end("done", Status.REJECTED, 100 * S, "")
    assert goals.state(received(goals, "new", stamp=2 * S, now=S)) is Status.PENDING
    assert [each.goal_id.id for each in goals.list(S)] == ["new"]
