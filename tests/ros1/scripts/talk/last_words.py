#!/usr/bin/env python
import rospy
from std_msgs.msg import String

rospy.init_node("last_words")
try:
    print(rospy.wait_for_message("last_words", String, timeout=300).data)
except rospy.ROSException as error:
    print("none: %s" % error)
try:
    rospy.wait_for_message("silence", String, timeout=0.3)
except rospy.ROSException as error:
    print(error)
