#!/usr/bin/env python
import rospy
from std_msgs.msg import String

counts = {"first": 0, "second": 0}


def callback(msg, args):
    name, seen = args
    counts[name] += 1
    seen.append(msg.data)
    if name == "second" and counts[name] == 4:
        print("each callback got 4 and both saw the same: %s" % (a[-4:] == b))


a, b = [], []
rospy.init_node("user_data", anonymous=True)
rospy.Subscriber("chatter", String, callback, ("first", a))
rospy.Subscriber("chatter", String, callback, callback_args=("second", b))
rospy.spin()
