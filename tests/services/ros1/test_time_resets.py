"""tf and actionlib when simulation time jumps back."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace

import pytest

from services.script.kernel import ScriptKernel
from tests.harness.ros1 import ros1_imports

S = 10**9


@pytest.fixture(scope="module")
def kernel() -> Iterator[ScriptKernel]:
    with ros1_imports(simulated=True) as made:
        import rospy

        made.clock.set(100 * S)
        rospy.init_node("resets", disable_signals=True)
        yield made


def test_a_buffer_forgets_what_moved(kernel: ScriptKernel) -> None:
    import rospy
    import tf2_ros
    from geometry_msgs.msg import TransformStamped

    def link(seconds: float, child: str = "base") -> TransformStamped:
        made = TransformStamped(child_frame_id=child)
        made.header.stamp, made.header.frame_id = rospy.Time(seconds), "odom"
        made.transform.rotation.w = 1.0
        return made

    kernel.clock.set(100 * S, epoch=1)
    buffer = tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(buffer)
    header = {"callerid": "/sim"}
    listener.static_callback(SimpleNamespace(_connection_header=header, transforms=[link(0, "map")]))
    listener.callback(SimpleNamespace(_connection_header=header, transforms=[link(99.5)]))
    assert buffer.lookup_transform("odom", "base", rospy.Time(0)).header.stamp == rospy.Time(99.5)
    kernel.clock.set(S, epoch=2)
    listener.callback(SimpleNamespace(_connection_header=header, transforms=[link(1)]))
    assert buffer.lookup_transform("odom", "base", rospy.Time(0)).header.stamp == rospy.Time(1)
    assert buffer.can_transform("odom", "map", rospy.Time(0))


def test_time_is_read_while_no_other_message_is_checked(kernel: ScriptKernel, monkeypatch: pytest.MonkeyPatch) -> None:
    """Else the thread of another topic could note a later time in between, which looked like a jump back."""
    import tf2_ros
    from rospy import rostime

    listener = tf2_ros.TransformListener(tf2_ros.Buffer())
    locked: list[bool] = []
    read = rostime.peek

    def peek() -> int:
        locked.append(listener.last_update_lock.locked())
        return read()

    monkeypatch.setattr(rostime, "peek", peek)
    listener.check_for_reset()
    assert locked == [True]


def test_goals_are_taken(kernel: ScriptKernel) -> None:
    import actionlib
    import rospy
    from actionlib_tutorials.msg import FibonacciAction, FibonacciGoal, FibonacciResult

    server = actionlib.SimpleActionServer(
        "again", FibonacciAction, lambda goal: server.set_succeeded(FibonacciResult([goal.order])), False
    )
    server.start()
    client = actionlib.SimpleActionClient("again", FibonacciAction)
    assert client.wait_for_server()
    for order, start in enumerate((50, 1)):
        kernel.clock.set(start * S, epoch=3 + order)
        client.send_goal(FibonacciGoal(order))
        assert client.wait_for_result()
        assert (client.get_goal_status_text(), client.get_result().sequence) == ("", (order,))
        client.cancel_goals_at_and_before_time(rospy.Time(start))
        cancelled = rospy.Time(start)
        assert kernel.wait_until(lambda at=cancelled: server.action_server.last_cancel == at, 60)
    server.action_server.stop()
