#!/usr/bin/env python
import rospy
from robot_we_do_not_have_msgs.msg import Status

rospy.init_node("unknown_package")
