#!/usr/bin/env python
import rospy
from std_msgs.msg import String

heard = []


def callback(data):
    heard.append(int(data.data.split()[1]))
    rospy.loginfo("%s: I heard %s", rospy.get_caller_id(), data.data)
    if len(heard) == 5:
        steps = [b - a for a, b in zip(heard, heard[1:])]
        print("steps %s from %s" % (steps, data._connection_header["topic"]))


def listener():
    rospy.init_node("listener", anonymous=True)
    rospy.Subscriber("chatter", String, callback)
    rospy.spin()


if __name__ == "__main__":
    listener()
