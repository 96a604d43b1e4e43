#!/usr/bin/env python3
import math

import rospy
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, JointState
from tf.transformations import euler_from_quaternion


class PosePrinter:
    def __init__(self):
        self.node_name = "pose_printer"
        rospy.init_node(self.node_name, anonymous=True)
        self.counter = 0
        self.joints = None
        self.imus = 0
        self.startup = True
        self.sub = rospy.Subscriber("/odom", Odometry, self.callback)
        rospy.Subscriber("/imu", Imu, self.on_imu)
        rospy.Subscriber("/joint_states", JointState, self.on_joints)

    def on_imu(self, msg):
        self.imus += 1

    def on_joints(self, msg):
        self.joints = list(msg.name)

    def callback(self, msg):
        orientation = msg.pose.pose.orientation
        roll, pitch, yaw = euler_from_quaternion([orientation.x, orientation.y, orientation.z, orientation.w], "sxyz")
        if self.startup:
            self.startup = False
            self.x0 = msg.pose.pose.position.x
        if self.counter == 60:
            print(f"frames {msg.header.frame_id} {msg.child_frame_id}, yaw {math.degrees(yaw):.0f}")
            print(f"imu {self.imus > 20}, joints {self.joints}")
            print(msg.twist.twist.linear.y, len(msg.pose.covariance), type(msg.pose.covariance).__name__)
        self.counter += 1

    def main_loop(self):
        rospy.spin()


if __name__ == "__main__":
    subscriber_instance = PosePrinter()
    try:
        subscriber_instance.main_loop()
    except rospy.ROSInterruptException:
        pass
