#!/usr/bin/env python
import rospy
from geometry_msgs.msg import Twits

rospy.init_node("unknown_message")
