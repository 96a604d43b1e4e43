#!/usr/bin/env python
from __future__ import print_function

import actionlib
import rospy
from actionlib_msgs.msg import GoalStatus
from actionlib_tutorials.msg import FibonacciAction, FibonacciGoal

feedbacks = []
events = []
late = []


def done(status, result):
    events.append("done %d %s" % (status, list(result.sequence)))


def active():
    events.append("active")


def feedback(fb):
    feedbacks.append(len(fb.sequence))


def running(fb):
    late.append(len(fb.sequence))


rospy.init_node("fibonacci_client")
client = actionlib.SimpleActionClient("fibonacci", FibonacciAction)
assert client.wait_for_server(rospy.Duration(60))

client.send_goal(FibonacciGoal(order=6))
print("in time:", client.wait_for_result(rospy.Duration.from_sec(60.0)))
print("state %d, result %s" % (client.get_state(), list(client.get_result().sequence)))

client.send_goal(FibonacciGoal(order=5), done_cb=done, active_cb=active, feedback_cb=feedback)
client.wait_for_result()
rospy.sleep(0.3)
print(events, feedbacks == [3, 4, 5, 6][: len(feedbacks)])
print("feedback", feedbacks)

client.send_goal(FibonacciGoal(order=200), feedback_cb=running)
print("in time:", client.wait_for_result(rospy.Duration(0.5)))
while not late:
    rospy.sleep(0.05)
print("begins with", late[0])
client.cancel_goal()
client.wait_for_result()
print("cancelled:", client.get_state() == GoalStatus.PREEMPTED)

del late[:]
client.send_goal(FibonacciGoal(order=300), feedback_cb=running)
while not late:
    rospy.sleep(0.05)
print("status", client.send_goal_and_wait(FibonacciGoal(order=3), rospy.Duration(60)))
