#!/usr/bin/env python

import rospy
from std_msgs.msg import Int32

rospy.init_node('number_source')
pub = rospy.Publisher('number', Int32)
rate = rospy.Rate(4)
count = 0
while not rospy.is_shutdown():
    pub.publish(count)
    count += 1
    rate.sleep()
