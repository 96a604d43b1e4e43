#!/usr/bin/env python
import time

import actionlib
import rospy
from campus_interfaces.msg import CountdownAction, CountdownFeedback, CountdownResult


def do_countdown(goal):
    start = time.time()
    updates = 0
    if goal.time_to_wait.to_sec() > 60.0:
        server.set_aborted(CountdownResult(rospy.Duration(0), updates), "too long")
        return
    while (time.time() - start) < goal.time_to_wait.to_sec():
        if server.is_preempt_requested():
            server.set_preempted(CountdownResult(rospy.Duration.from_sec(time.time() - start), updates), "preempted")
            return
        feedback = CountdownFeedback()
        feedback.time_elapsed = rospy.Duration.from_sec(time.time() - start)
        feedback.time_remaining = goal.time_to_wait - feedback.time_elapsed
        server.publish_feedback(feedback)
        updates += 1
        time.sleep(0.25)
    server.set_succeeded(CountdownResult(rospy.Duration.from_sec(time.time() - start), updates), "done")


rospy.init_node("countdown_server")
server = actionlib.SimpleActionServer("countdown", CountdownAction, do_countdown, False)
server.start()
rospy.spin()
