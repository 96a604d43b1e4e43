#!/usr/bin/env python
import actionlib
import rospy
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal
from trajectory_msgs.msg import JointTrajectoryPoint

ACTION = "arm_controller/follow_joint_trajectory"
feedbacks = []


def goal(position, seconds, joint="bear_link"):
    g = FollowJointTrajectoryGoal()
    g.trajectory.joint_names = [joint]
    g.trajectory.points = [JointTrajectoryPoint(positions=[position], time_from_start=rospy.Duration(seconds))]
    return g


rospy.init_node("move_arm")
client = actionlib.SimpleActionClient(ACTION, FollowJointTrajectoryAction)
print("server %s" % client.wait_for_server(rospy.Duration(10)))

status = client.send_goal_and_wait(goal(0.5, 1.0))
print("reached %d, code %d" % (status, client.get_result().error_code))

client.send_goal(goal(-0.5, 2.0), feedback_cb=feedbacks.append)
rospy.sleep(0.5)
client.cancel_goal()
client.wait_for_result()
print("cancelled %d, feedback %s" % (client.get_state(), len(feedbacks) >= 5))
print("joints %s" % feedbacks[0].joint_names)

print("rejected %d: %s" % (client.send_goal_and_wait(goal(0, 1, "elbow")), client.get_goal_status_text()))

client.send_goal(goal(0.2, 1.0))
rospy.sleep(0.3)
other = actionlib.SimpleActionClient(ACTION, FollowJointTrajectoryAction)
other.wait_for_server()
print("replaced %d by %d" % (other.send_goal_and_wait(goal(0.1, 0.5)), client.get_state()))
