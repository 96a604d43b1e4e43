#!/usr/bin/env python
import rospy
from sensor_msgs.msg import Imu, Range

rospy.init_node("stamped_sources")
imu_pub = rospy.Publisher("left/imu", Imu, queue_size=5)
range_pub = rospy.Publisher("left/range", Range, queue_size=5)
rate = rospy.Rate(10)
start = rospy.Time.now()
i = 0
while not rospy.is_shutdown():
    imu, dist = Imu(), Range()
    imu.header.stamp = start + rospy.Duration(0.1 * i)
    dist.header.stamp = imu.header.stamp + rospy.Duration(0, 4000000)
    imu.angular_velocity.z = dist.range = float(i)
    imu_pub.publish(imu)
    if i % 2 == 0:
        range_pub.publish(dist)
    i += 1
    rate.sleep()
