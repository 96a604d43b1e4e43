#!/usr/bin/env python
import rospy
from std_msgs.msg import String

pub = rospy.Publisher("last_words", String, queue_size=10)


def first():
    print("first hook, down: %s" % rospy.is_shutdown())
    pub.publish("good bye")


def second():
    print("second hook")


rospy.init_node("hooks")
rospy.on_shutdown(first)
rospy.on_shutdown(second)
while pub.get_num_connections() == 0:
    rospy.sleep(0.05)
rospy.sleep(1.0)
rospy.signal_shutdown("done here")
print("down: %s" % rospy.is_shutdown())
