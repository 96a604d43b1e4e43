#!/usr/bin/env python
import math

import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
from std_srvs.srv import Empty


class Env():
    def __init__(self):
        self.x = 0.0
        self.pub_cmd_vel = rospy.Publisher('cmd_vel', Twist, queue_size=5)
        self.sub_odom = rospy.Subscriber('odom', Odometry, self.getOdometry)
        self.reset_proxy = rospy.ServiceProxy('gazebo/reset_world', Empty)
        self.unpause_proxy = rospy.ServiceProxy('gazebo/unpause_physics', Empty)
        self.pause_proxy = rospy.ServiceProxy('gazebo/pause_physics', Empty)

    def getOdometry(self, odom):
        self.x = odom.pose.pose.position.x

    def getState(self, scan):
        scan_range = []
        for i in range(len(scan.ranges)):
            if scan.ranges[i] == float('Inf') or math.isnan(scan.ranges[i]):
                scan_range.append(3.5)
            else:
                scan_range.append(scan.ranges[i])
        return scan_range, min(scan_range) < 0.13

    def step(self, action):
        vel_cmd = Twist()
        vel_cmd.linear.x = 0.15
        vel_cmd.angular.z = (2 - action) * 0.75
        self.pub_cmd_vel.publish(vel_cmd)
        data = None
        while data is None:
            try:
                data = rospy.wait_for_message('scan', LaserScan, timeout=5)
            except rospy.ROSException:
                pass
        return self.getState(data)

    def reset(self):
        rospy.wait_for_service('gazebo/reset_world')
        try:
            self.reset_proxy()
        except rospy.ServiceException:
            print("gazebo/reset_world service call failed")
        data = None
        while data is None:
            try:
                data = rospy.wait_for_message('scan', LaserScan, timeout=5)
            except rospy.ROSException:
                pass
        return self.getState(data)


if __name__ == '__main__':
    rospy.init_node('environment')
    env = Env()
    for episode in range(2):
        state, done = env.reset()
        for step in range(8):
            state, done = env.step(2)
        while env.x <= 0.1:
            state, done = env.step(2)
        print("episode %d: %d rays, drove %s, done %s" % (episode, len(state), env.x > 0.1, done))
    env.pub_cmd_vel.publish(Twist())
    env.pause_proxy()
    before = rospy.get_time()
    env.unpause_proxy()
    print("paused for %.1f" % (rospy.get_time() - before))
