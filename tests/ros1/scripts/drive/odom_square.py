#!/usr/bin/env python3
import math
import os
import sys

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from tf.transformations import euler_from_quaternion


class OdomSquare:
    def __init__(self, log_name):
        rospy.init_node("odom_square", anonymous=True)
        self.pub = rospy.Publisher("/RosAria/cmd_vel", Twist, queue_size=10)
        self.sub = rospy.Subscriber("/RosAria/odom", Odometry, self.on_odom)
        self.x = self.y = self.yaw = 0.0
        self.from_x = self.from_y = self.goal_yaw = 0.0
        self.state, self.sides = "FORWARD", 0
        self.log = open(log_name, "w")
        self.log.write("time,state,x,y,yaw\n")

    def on_odom(self, msg):
        self.x = msg.pose.pose.position.x
        self.y = msg.pose.pose.position.y
        q = msg.pose.pose.orientation
        (_, _, self.yaw) = euler_from_quaternion([q.x, q.y, q.z, q.w])

    def wrap(self, angle):
        while angle > math.pi:
            angle -= 2 * math.pi
        while angle < -math.pi:
            angle += 2 * math.pi
        return angle

    def run(self):
        rate = rospy.Rate(10)
        cmd = Twist()
        while not rospy.is_shutdown() and self.sides < 4:
            now = rospy.get_time()
            cmd.linear.x = cmd.angular.z = 0.0
            if self.state == "FORWARD":
                if math.hypot(self.x - self.from_x, self.y - self.from_y) < 0.3 - 0.03:
                    cmd.linear.x = 0.3
                else:
                    self.state = "TURN"
                    self.goal_yaw = self.wrap(self.yaw + math.pi / 2)
            else:
                error = self.wrap(self.goal_yaw - self.yaw)
                if abs(error) > 0.05:
                    cmd.angular.z = 0.8 if error > 0 else -0.8
                else:
                    self.state = "FORWARD"
                    self.sides += 1
                    self.from_x, self.from_y = self.x, self.y
            self.pub.publish(cmd)
            self.log.write(f"{now:.3f},{self.state},{self.x:.4f},{self.y:.4f},{self.yaw:.4f}\n")
            rate.sleep()
        self.pub.publish(Twist())
        self.log.close()
        rospy.loginfo("Square completed!")
        lines = open(self.log.name).read().splitlines()
        print(f"sides {self.sides}, home within 0.5 m {math.hypot(self.x, self.y) < 0.5}, logged {len(lines) > 60}")
        os.remove(self.log.name)


if __name__ == "__main__":
    try:
        OdomSquare(rospy.myargv(sys.argv)[1]).run()
    except rospy.ROSInterruptException:
        pass
