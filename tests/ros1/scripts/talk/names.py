#!/usr/bin/env python
import sys

import rospy
from std_msgs.msg import Int32

rospy.init_node("original")
print("name %s namespace %s" % (rospy.get_name(), rospy.get_namespace()))
print("%s %s %s" % (rospy.resolve_name("a"), rospy.resolve_name("/a"), rospy.resolve_name("~a")))
print("remapped %s" % rospy.resolve_name("before"))
pub = rospy.Publisher("inner/deep/number", Int32, queue_size=1, latch=True)
private = rospy.Publisher("~number", Int32, queue_size=1, latch=True)
moved = rospy.Publisher("before", Int32, queue_size=1, latch=True)
print(pub.name, private.name, moved.name)
private.publish(3)
moved.publish(4)
rospy.sleep(0.3)
print(rospy.wait_for_message("before", Int32, 60).data + rospy.wait_for_message("~number", Int32, 60).data)
print("private %r %r %r" % (rospy.get_param("~gain"), rospy.get_param("~flags"), rospy.get_param("~label")))
print("args %s" % rospy.myargv(sys.argv)[1:])
