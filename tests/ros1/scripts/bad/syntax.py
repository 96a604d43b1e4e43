#!/usr/bin/env python
import rospy

rospy.init_node("syntax")
if True
    print("never")
