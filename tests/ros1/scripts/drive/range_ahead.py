#!/usr/bin/env python

import rospy
from sensor_msgs.msg import LaserScan

seen = []

def scan_callback(msg):
    range_ahead = msg.ranges[len(msg.ranges)/2]
    tmp = [msg.ranges[0]]
    seen.append(min(msg.ranges[0:10] + msg.ranges[-10:]))
    if len(seen) == 3:
        print "range ahead: %d" % tmp[0], "of", len(msg.ranges)
        print "nearest ahead: %d" % seen[-1], type(msg.ranges).__name__

scan_sub = rospy.Subscriber('scan', LaserScan, scan_callback)
rospy.init_node('range_ahead')
rospy.spin()
