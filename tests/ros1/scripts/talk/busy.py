#!/usr/bin/env python
import rospy
from std_msgs.msg import String

got = False
text = ""


def callback(msg):
    global got, text
    text = msg.data
    got = True


rospy.init_node("busy")
rospy.Subscriber("chatter", String, callback)
while not got and not rospy.is_shutdown():
    continue
print("first: %s" % text.split()[0])
got = False
passes = 0
while not got:
    passes += 1
print("went round %s" % (passes > 10))
end = rospy.Time.now() + rospy.Duration(0.5)
while rospy.Time.now() < end:
    pass
print("waited")
