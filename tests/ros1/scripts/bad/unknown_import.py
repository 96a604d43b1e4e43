#!/usr/bin/env python
import rospy
import moveit_commander

rospy.init_node("unknown_import")
