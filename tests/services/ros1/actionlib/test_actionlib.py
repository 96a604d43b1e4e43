"""actionlib: goals, feedback, results and cancellation between a client and a server, over an in-memory network."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from tests.harness.ros1 import ros1_imports

PATIENCE_S = 60.0
"""Wall time limit of each wait; all waits end with an event."""


@pytest.fixture(scope="module")
def ros() -> Iterator[SimpleNamespace]:
    with ros1_imports() as kernel:
        import actionlib
        import rospy
        from actionlib_msgs.msg import GoalStatus
        from actionlib_tutorials.msg import FibonacciAction, FibonacciFeedback, FibonacciGoal, FibonacciResult

        rospy.init_node("actions", disable_signals=True)
        servers: list[Any] = []
        yield SimpleNamespace(
            servers=servers,
            kernel=kernel,
            rospy=rospy,
            actionlib=actionlib,
            Action=FibonacciAction,
            Goal=FibonacciGoal,
            Result=FibonacciResult,
            Feedback=FibonacciFeedback,
            Status=GoalStatus,
            long=rospy.Duration(PATIENCE_S),
        )
        for each in servers:
            each.stop()


def until(ros: SimpleNamespace, ready: Callable[[], Any]) -> None:
    """Wait until a condition holds that a thread of the kernel brings about."""
    assert ros.kernel.wait_until(lambda: bool(ready()), PATIENCE_S), "it never held"


def start(ros: SimpleNamespace, server: Any) -> None:
    server.start()
    ros.servers.append(getattr(server, "action_server", server))


def client(ros: SimpleNamespace, name: str) -> Any:
    made = ros.actionlib.SimpleActionClient(name, ros.Action)
    assert made.wait_for_server(ros.long)
    return made


def outcome(ros: SimpleNamespace, given: Any, goal: Any) -> tuple[str, str, tuple[int, ...]]:
    given.send_goal(goal)
    assert given.wait_for_result(ros.long)
    return ros.Status.to_string(given.get_state()), given.get_goal_status_text(), tuple(given.get_result().sequence)


def test_each_end_of_a_goal_reaches_the_client(ros: SimpleNamespace, capfd: pytest.CaptureFixture[str]) -> None:
    def execute(goal: Any) -> None:
        if goal.order == 1:
            server.publish_feedback(ros.Feedback([0, 1]))
            ros.kernel.wait_until(lambda: len(events) == 2, PATIENCE_S)
            server.set_succeeded(ros.Result([0, 1, 1]), "done well")
        elif goal.order == 2:
            server.set_succeeded(0)
        elif goal.order == 3:
            server.set_aborted(ros.Result([3]), "no")
        elif goal.order == 4:
            raise ValueError("bad")
        elif goal.order == 6:
            server.set_succeeded(ros.Result([6]))
            server.set_aborted()

    events: list[Any] = []
    server = ros.actionlib.SimpleActionServer("ends", ros.Action, execute, False)
    early = ros.actionlib.SimpleActionClient("ends", ros.Action)
    assert not early.wait_for_server(ros.rospy.Duration(0.01))
    assert (early.get_state(), early.get_result(), early.wait_for_result()) == (ros.Status.LOST, None, False)
    start(ros, server)
    given = client(ros, "ends")

    def noted(event: Any) -> None:
        events.append(event)
        ros.kernel.wake()

    given.send_goal(
        ros.Goal(1),
        lambda status, result: noted(("done", status, tuple(result.sequence))),
        lambda: noted("active"),
        lambda feedback: noted(tuple(feedback.sequence)),
    )
    assert given.wait_for_result(ros.long)
    assert sorted(events[:2], key=str) == [(0, 1), "active"]
    assert events[2:] == [("done", ros.Status.SUCCEEDED, (0, 1, 1))]
    assert given.get_goal_status_text() == "done well"
    for order, wanted in (
        (2, ("SUCCEEDED", "", ())),
        (3, ("ABORTED", "no", (3,))),
        (4, ("ABORTED", "Exception in execute callback: bad", ())),
        (5, ("ABORTED", "No terminal state was set.", ())),
        (6, ("SUCCEEDED", "", (6,))),
    ):
        assert outcome(ros, given, ros.Goal(order)) == wanted
    assert given.send_goal_and_wait(ros.Goal(2), ros.long) == ros.Status.SUCCEEDED
    said = capfd.readouterr().err
    assert "ValueError: bad" in said
    assert "a goal becomes aborted only when it is active or preempting" in said


def test_the_callback_of_a_goal_may_send_the_next_one(ros: SimpleNamespace) -> None:
    def execute(goal: Any) -> None:
        server.set_succeeded(ros.Result([goal.order]))

    seen: list[int] = []

    def done(status: int, result: Any) -> None:
        seen.append(result.sequence[0])
        if len(seen) < 3:
            given.send_goal(ros.Goal(len(seen) + 1), done_cb=done)
        ros.kernel.wake()

    server = ros.actionlib.SimpleActionServer("chain", ros.Action, execute, False)
    start(ros, server)
    given = client(ros, "chain")
    given.send_goal(ros.Goal(1), done_cb=done)
    until(ros, lambda: len(seen) == 3)
    assert given.wait_for_result(ros.long)
    assert (seen, tuple(given.get_result().sequence)) == ([1, 2, 3], (3,))


def test_goals_are_given_up_and_replaced(ros: SimpleNamespace) -> None:
    seen: list[tuple[int, bool]] = []

    def execute(goal: Any) -> None:
        if goal.order == 1:
            server.set_succeeded()
            return
        ros.kernel.wait_until(server.is_preempt_requested, PATIENCE_S)
        seen.append((goal.order, server.is_new_goal_available()))
        server.set_preempted(ros.Result([goal.order]), "gave up")

    server = ros.actionlib.SimpleActionServer("stops", ros.Action, execute, False)
    start(ros, server)
    first, second = client(ros, "stops"), client(ros, "stops")
    for order, stop in (
        (2, first.cancel_goal),
        (3, second.cancel_all_goals),
        (4, lambda: second.cancel_goals_at_and_before_time(ros.rospy.Time.now())),
        (5, lambda: second.send_goal(ros.Goal(1))),
    ):
        first.send_goal(ros.Goal(order))
        until(ros, lambda: first.get_state() == ros.Status.ACTIVE)
        assert not first.wait_for_result(ros.rospy.Duration(0.001))
        stop()
        assert first.wait_for_result(ros.long)
        found = ros.Status.to_string(first.get_state()), first.get_goal_status_text(), first.get_result().sequence
        assert found == ("PREEMPTED", "gave up", (order,))
    assert second.wait_for_result(ros.long)
    assert second.get_state() == ros.Status.SUCCEEDED
    assert seen == [(2, False), (3, False), (4, False), (5, True)]
    first.send_goal(ros.Goal(6))
    until(ros, lambda: first.get_state() == ros.Status.ACTIVE)
    first.stop_tracking_goal()
    assert (first.get_state(), first.wait_for_result()) == (ros.Status.LOST, False)
    second.cancel_all_goals()
    until(ros, lambda: len(seen) == 5 and not server.is_active())
    ended = first.send_goal_and_wait(ros.Goal(7), ros.rospy.Duration(0.02), ros.long)
    assert ended in (ros.Status.PREEMPTED, ros.Status.RECALLED), "a cancellation may arrive before its goal"


def test_a_server_may_poll_for_its_goals(ros: SimpleNamespace) -> None:
    log: list[Any] = []

    def preempt() -> None:
        log.append("preempt")
        server.set_preempted()

    server = ros.actionlib.SimpleActionServer("polls", ros.Action, auto_start=False)
    server.register_goal_callback(lambda: log.append(server.accept_new_goal().order))
    server.register_preempt_callback(preempt)
    start(ros, server)
    given = client(ros, "polls")
    given.send_goal(ros.Goal(1))
    until(ros, lambda: given.get_state() == ros.Status.ACTIVE)
    given.cancel_goal()
    assert given.wait_for_result(ros.long)
    assert (log, given.get_state()) == ([1, "preempt"], ros.Status.PREEMPTED)
    given.send_goal(ros.Goal(2))
    until(ros, server.is_active)
    given.send_goal(ros.Goal(3))
    until(ros, lambda: given.get_state() == ros.Status.ACTIVE)
    server.set_succeeded()
    assert given.wait_for_result(ros.long)
    assert (log[2:], given.get_state()) == ([2, "preempt", 3], ros.Status.SUCCEEDED)


def test_handles_follow_several_goals(ros: SimpleNamespace, capfd: pytest.CaptureFixture[str]) -> None:
    handles: list[Any] = []
    cancelled: list[int] = []

    def take(handle: Any) -> None:
        handles.append(handle)
        ros.kernel.wake()

    def give_up(handle: Any) -> None:
        cancelled.append(handle.get_goal().order)
        ros.kernel.wake()

    lib = ros.actionlib
    server = lib.ActionServer("many", ros.Action, take, give_up, auto_start=False)
    start(ros, server)
    given = lib.ActionClient("many", ros.Action)
    assert given.wait_for_server(ros.long)
    states: dict[int, list[str]] = {1: [], 2: [], 3: []}
    fed: list[tuple[int, ...]] = []

    def moved(handle: Any) -> None:
        states[handle.comm_state_machine.action_goal.goal.order].append(
            lib.CommState.to_string(handle.get_comm_state())
        )

    def feed(handle: Any, feedback: Any) -> None:
        fed.append(tuple(feedback.sequence))
        ros.kernel.wake()

    goals = [given.send_goal(ros.Goal(order), moved, feed) for order in (1, 2, 3)]
    until(ros, lambda: len(handles) == 3)
    handles[0].set_accepted("ok")
    handles[1].set_rejected(None, "no")
    goals[2].cancel()
    until(ros, lambda: cancelled == [3])
    handles[0].publish_feedback(ros.Feedback([5]))
    until(ros, lambda: fed == [(5,)])
    handles[0].set_succeeded(ros.Result([5]))
    handles[2].set_canceled(ros.Result([9]))
    until(ros, lambda: all(path[-1:] == ["DONE"] for path in states.values()))  # each has been told
    ends = [lib.TerminalState.to_string(goal.get_terminal_state()) for goal in goals]
    assert ends == ["SUCCEEDED", "REJECTED", "RECALLED"]
    assert [tuple(goal.get_result().sequence) for goal in goals] == [(5,), (), (9,)]
    assert goals[1].get_goal_status_text() == "no"
    assert [path[-2:] for path in states.values()] == [["WAITING_FOR_RESULT", "DONE"]] * 3
    assert "ACTIVE" in states[1]
    assert {"WAITING_FOR_CANCEL_ACK", "RECALLING"} <= set(states[3])
    assert (handles[0] == handles[1], handles[0] != handles[1], len({*handles})) == (False, True, 3)
    handles[1].set_succeeded()
    assert "goal /actions-" in capfd.readouterr().err


def test_the_topics_are_those_of_ros(ros: SimpleNamespace) -> None:
    from actionlib_msgs.msg import GoalID, GoalStatusArray
    from actionlib_tutorials.msg import FibonacciActionGoal, FibonacciActionResult

    taken: list[Any] = []

    def take(handle: Any) -> None:
        taken.append(handle)
        handle.set_accepted()
        handle.set_succeeded(ros.Result([8]))

    server = ros.actionlib.ActionServer("plain", ros.Action, take, auto_start=False)
    start(ros, server)
    results: list[Any] = []
    statuses: list[Any] = []

    def note(into: list[Any]) -> Callable[[Any], None]:
        def received(message: Any) -> None:
            into.append(message)
            ros.kernel.wake()

        return received

    ros.rospy.Subscriber("plain/result", FibonacciActionResult, note(results))
    ros.rospy.Subscriber("plain/status", GoalStatusArray, note(statuses))
    goal = ros.rospy.Publisher("plain/goal", FibonacciActionGoal, queue_size=1)
    cancel = ros.rospy.Publisher("plain/cancel", GoalID, queue_size=1)
    until(ros, lambda: statuses and goal.get_num_connections() and cancel.get_num_connections())
    goal.publish(FibonacciActionGoal(goal=ros.Goal(1)))  # without an id: the server makes one
    until(ros, lambda: results)
    assert results[0].status.goal_id.id.startswith("/actions-")
    assert (results[0].status.status, results[0].result.sequence) == (ros.Status.SUCCEEDED, (8,))
    cancel.publish(GoalID(id="later", stamp=ros.rospy.Time(0)))  # a cancellation may arrive before its goal
    until(ros, lambda: any(each.goal_id.id == "later" for each in statuses[-1].status_list))
    goal.publish(FibonacciActionGoal(goal_id=GoalID(id="later", stamp=ros.rospy.Time.now()), goal=ros.Goal(2)))
    until(ros, lambda: len(results) == 2)
    assert (results[1].status.status, len(taken)) == (ros.Status.RECALLED, 1)


def test_what_is_no_action_is_refused(ros: SimpleNamespace) -> None:
    for make in (
        lambda: ros.actionlib.SimpleActionClient("x", ros.Goal),
        lambda: ros.actionlib.SimpleActionServer("x", ros.Status, lambda goal: None, False),
    ):
        with pytest.raises(ros.actionlib.ActionException, match="Type is not an action spec"):
            make()
    names = ros.actionlib.SimpleGoalState.to_string, ros.Status.to_string
    assert [name(2) for name in names] == ["DONE", "PREEMPTED"]
    assert ros.Status.to_string(77) == "NO_SUCH_STATE_77"
