#!/usr/bin/env python
import rospy
from geometry_msgs.msg import Twist

rospy.init_node("wrong_field")
pub = rospy.Publisher("cmd_vel", Twist, queue_size=1)
rospy.Subscriber("cmd_vel", Twist, lambda msg: None)
while pub.get_num_connections() == 0:
    rospy.sleep(0.1)
cmd = Twist()
cmd.linear.x = "fast"
pub.publish(cmd)
