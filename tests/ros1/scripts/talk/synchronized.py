#!/usr/bin/env python
import message_filters
import rospy
from sensor_msgs.msg import Imu, Range

pairs, cached = [], None


def callback(imu, dist):
    pairs.append((imu.angular_velocity.z, dist.range))
    if len(pairs) == 5:
        print("equal pairs %s" % all(a == b and a % 2 == 0 for a, b in pairs))
        print("cache holds %s" % (len(cache.getInterval(rospy.Time(0), rospy.Time.now() + rospy.Duration(1))) == 3))


rospy.init_node("synchronized")
imu_sub = message_filters.Subscriber("left/imu", Imu)
range_sub = message_filters.Subscriber("left/range", Range)
cache = message_filters.Cache(imu_sub, 3)
ts = message_filters.ApproximateTimeSynchronizer([imu_sub, range_sub], 10, 0.02)
ts.registerCallback(callback)
exact = message_filters.TimeSynchronizer([imu_sub, range_sub], 10)
exact.registerCallback(lambda a, b: print("never"))
rospy.spin()
