#!/usr/bin/env python
import actionlib
import rospy
from control_msgs.msg import FollowJointTrajectoryAction
from move_base_msgs.msg import MoveBaseAction, MoveBaseGoal

rospy.init_node("patrol_client")
client = actionlib.SimpleActionClient("move_base", MoveBaseAction)
client.wait_for_server()
places = []


def moved(feedback):
    places.append(feedback.base_position.pose.position.x)


for x, y in ((0.6, 0.0), (0.6, 0.5)):
    goal = MoveBaseGoal()
    goal.target_pose.header.frame_id = "odom"
    goal.target_pose.header.stamp = rospy.Time.now()
    goal.target_pose.pose.position.x = x
    goal.target_pose.pose.position.y = y + rospy.get_param("~y0", 0)
    goal.target_pose.pose.orientation.w = 1.0
    client.send_goal(goal, feedback_cb=moved)
    if client.wait_for_result(rospy.Duration(200)):
        print("at %.1f %.1f: state %d" % (x, y, client.get_state()))
print("moved %s" % (len(places) > 5 and places[-1] > 0.4))
print(FollowJointTrajectoryAction._type)
