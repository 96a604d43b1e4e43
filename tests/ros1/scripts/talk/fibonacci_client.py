#!/usr/bin/env python
from __future__ import print_function

import actionlib
import rospy
from actionlib_msgs.msg import GoalStatus
from actionlib_tutorials.msg import FibonacciAction, FibonacciGoal

feedbacks = []
events = []


def done(status, result):
    events.append("done %d %s" % (status, list(result.sequence)))


def active():
    events.append("active")


def feedback(fb):
    feedbacks.append(len(fb.sequence))


rospy.init_node("fibonacci_client")
client = actionlib.SimpleActionClient("fibonacci", FibonacciAction)
assert client.wait_for_server(rospy.Duration(20))

client.send_goal(FibonacciGoal(order=6))
print("in time:", client.wait_for_result(rospy.Duration.from_sec(5.0)))
print("state %d, result %s" % (client.get_state(), list(client.get_result().sequence)))

client.send_goal(FibonacciGoal(order=5), done_cb=done, active_cb=active, feedback_cb=feedback)
client.wait_for_result()
rospy.sleep(0.3)
print(events, feedbacks[0], feedbacks == [3, 4, 5, 6][: len(feedbacks)])
print("feedback", feedbacks)

client.send_goal(FibonacciGoal(order=200))
print("in time:", client.wait_for_result(rospy.Duration(0.5)))
client.cancel_goal()
client.wait_for_result()
print("cancelled:", client.get_state() == GoalStatus.PREEMPTED)

client.send_goal(FibonacciGoal(order=300))
rospy.sleep(0.5)
print("status", client.send_goal_and_wait(FibonacciGoal(order=3), rospy.Duration(10)))
