#!/usr/bin/env python
import rospy

rospy.init_node("chatty")
for i in range(3000):
    print("x" * 1000)
print("last")
rospy.spin()
