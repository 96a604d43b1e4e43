#!/usr/bin/env python
import rospy
from rospy_tutorials.msg import HeaderString

rospy.init_node("header_talker")
pub = rospy.Publisher("headered", HeaderString, queue_size=5)
rate = rospy.Rate(5)
n = 0
while not rospy.is_shutdown():
    msg = HeaderString()
    msg.header.stamp = rospy.Time.now()
    msg.header.frame_id = "desk"
    msg.data = "note %d" % n
    pub.publish(msg)
    n += 1
    try:
        rate.sleep()
    except rospy.ROSInterruptException:
        break
