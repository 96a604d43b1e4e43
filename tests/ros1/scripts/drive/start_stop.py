#!/usr/bin/env python
import rospy
from geometry_msgs.msg import Twist

cmd_vel_pub = rospy.Publisher("cmd_vel", Twist, queue_size=1)
rospy.init_node("start_stop")

stop_twist = Twist()
go_twist = Twist()
go_twist.linear.x = 0.2

driving_forward = False
light_change_time = rospy.Time.now() + rospy.Duration(1)
rate = rospy.Rate(10)
changes = 0

while not rospy.is_shutdown():
    if light_change_time < rospy.Time.now():
        driving_forward = not driving_forward
        light_change_time = rospy.Time.now() + rospy.Duration(2)
        changes += 1
        if changes == 6:
            break
    if driving_forward:
        cmd_vel_pub.publish(go_twist)
    else:
        cmd_vel_pub.publish(stop_twist)
    rate.sleep()
print("changes %d" % changes)
