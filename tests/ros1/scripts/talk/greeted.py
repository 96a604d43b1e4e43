#!/usr/bin/env python
import rospy
from std_msgs.msg import String

words = []
rospy.init_node("greeted")
rospy.sleep(0.5)
sub = rospy.Subscriber("greetings", String, lambda m: words.append(m.data))
while not words:
    rospy.sleep(0.05)
rospy.sleep(0.5)
print("words %s" % words)
sub.unregister()
rospy.sleep(0.5)
