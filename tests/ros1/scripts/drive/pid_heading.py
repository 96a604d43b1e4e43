#!/usr/bin/env python
import csv
import math
import os
import sys
import time

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from tf.transformations import euler_from_quaternion


class PID:
    def __init__(self, kp, ki, kd):
        self.kp, self.ki, self.kd = kp, ki, kd
        self.last_time = time.time()
        self.last_error = self.integral = 0.0

    def update(self, error):
        now = time.time()
        dt = now - self.last_time
        self.integral = max(-1.0, min(1.0, self.integral + error * dt))
        slope = (error - self.last_error) / dt if dt > 0 else 0.0
        self.last_time, self.last_error = now, error
        return self.kp * error + self.ki * self.integral + self.kd * slope


class Heading:
    def __init__(self, path):
        self.yaw = None
        self.pub = rospy.Publisher("cmd_vel", Twist, queue_size=10)
        rospy.Subscriber("odom", Odometry, self.odom)
        self.pid = PID(2.0, 0.2, 0.05)
        self.file = open(path, "w")
        self.writer = csv.writer(self.file)

    def odom(self, msg):
        o = msg.pose.pose.orientation
        self.yaw = euler_from_quaternion((o.x, o.y, o.z, o.w))[2]

    def run(self):
        while self.yaw is None:
            time.sleep(0.05)
        start = time.time()
        worst = 0.0
        while not rospy.is_shutdown() and time.time() - start < 8.0:
            wanted = 0.5 * math.sin(2 * math.pi * 0.25 * (time.time() - start))
            error = wanted - self.yaw
            t = Twist()
            t.angular.z = self.pid.update(error)
            self.pub.publish(t)
            self.writer.writerow(["%.3f" % (time.time() - start), "%.4f" % wanted, "%.4f" % self.yaw])
            if time.time() - start > 2.0:
                worst = max(worst, abs(error))
            time.sleep(0.02)
        self.pub.publish(Twist())
        self.file.close()
        rows = list(csv.reader(open(self.file.name)))
        print("tracked %s with rows %s" % (worst < 0.45, len(rows) > 100))
        print("rms %.4f" % math.sqrt(sum((float(a) - float(b)) ** 2 for _, a, b in rows) / len(rows)))
        os.remove(self.file.name)


if __name__ == "__main__":
    rospy.init_node("pid_heading")
    Heading(sys.argv[1]).run()
