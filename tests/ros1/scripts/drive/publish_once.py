#!/usr/bin/env python
import rospy
from geometry_msgs.msg import Twist

rospy.init_node("publish_once")
pub = rospy.Publisher("cmd_vel", Twist, queue_size=1)
rospy.sleep(1)

move = Twist()
for leg in range(2):
    move.linear.x = 0.15
    move.angular.z = 0.0
    pub.publish(move)
    rospy.sleep(2)
    move.linear.x = 0.0
    move.angular.z = 0.785
    pub.publish(move)
    rospy.sleep(2)
move.angular.z = 0.0
pub.publish(move)
rospy.sleep(0.5)
print("legs done")
