#!/usr/bin/env python
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry


class Repeater:
    def __init__(self):
        rospy.init_node("repeat")
        self.twist = Twist()
        self.pub = rospy.Publisher("/tb3_1/cmd_vel", Twist, queue_size=1)
        rospy.Subscriber("/tb3_0/odom", Odometry, self.odom)
        rospy.wait_for_message("/tb3_0/odom", Odometry)

    def odom(self, msg):
        self.twist.linear.x = msg.twist.twist.linear.x
        self.twist.angular.z = msg.twist.twist.angular.z

    def loop(self):
        while not rospy.is_shutdown():
            self.pub.publish(self.twist)


if __name__ == "__main__":
    Repeater().loop()
