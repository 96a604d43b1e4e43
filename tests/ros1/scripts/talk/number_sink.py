#!/usr/bin/env python
import rospy
from std_msgs.msg import Int32


def callback(msg):
    assert msg.data % 2 == 0
    if msg.data >= 12:
        print("reached %d" % msg.data)
        rospy.signal_shutdown("enough")


rospy.init_node("number_sink")
rospy.Subscriber("doubled", Int32, callback)
rospy.spin()
