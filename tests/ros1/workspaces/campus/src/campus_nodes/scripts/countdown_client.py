#!/usr/bin/env python
import actionlib
import rospy
from campus_interfaces.msg import CountdownAction, CountdownGoal

remaining = []


def feedback_cb(feedback):
    remaining.append(feedback.time_remaining.to_sec())


rospy.init_node("countdown_client")
client = actionlib.SimpleActionClient("countdown", CountdownAction)
client.wait_for_server()

goal = CountdownGoal()
goal.time_to_wait = rospy.Duration.from_sec(1.0)
client.send_goal(goal, feedback_cb=feedback_cb)
client.wait_for_result()
result = client.get_result()
print("state %d: %s" % (client.get_state(), client.get_goal_status_text()))
print("updates %d, took about a second: %s" % (result.updates_sent, abs(result.time_elapsed.to_sec() - 1.0) < 0.2))
print("falling %s" % all(a > b for a, b in zip(remaining, remaining[1:])))

goal.time_to_wait = rospy.Duration(500)
client.send_goal(goal)
client.wait_for_result()
print("state %d: %s" % (client.get_state(), client.get_goal_status_text()))

goal.time_to_wait = rospy.Duration(50)
del remaining[:]
client.send_goal(goal, feedback_cb=feedback_cb)
while not remaining:
    rospy.sleep(0.1)
client.cancel_goal()
client.wait_for_result()
print("state %d: %s" % (client.get_state(), client.get_goal_status_text()))
