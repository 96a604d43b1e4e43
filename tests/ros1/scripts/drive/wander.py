#!/usr/bin/env python
import rospy
from geometry_msgs.msg import Twist
from sensor_msgs.msg import LaserScan


class Obstacle():
    def __init__(self):
        self.LIDAR_ERR = 0.05
        self.turns = 0
        self.nearest = 9.0
        self._cmd_pub = rospy.Publisher('cmd_vel', Twist, queue_size=1)
        self.obstacle()

    def get_scan(self):
        msg = rospy.wait_for_message("scan", LaserScan)
        self.scan_filter = []
        for i in range(360):
            if i <= 15 or i > 335:
                if msg.ranges[i] >= self.LIDAR_ERR:
                    self.scan_filter.append(msg.ranges[i])

    def obstacle(self):
        self.twist = Twist()
        began = rospy.get_time()
        while not rospy.is_shutdown() and rospy.get_time() - began < 12.0:
            self.get_scan()
            nearest = min(self.scan_filter)
            self.nearest = min(self.nearest, nearest)
            if nearest < 0.5:
                self.twist.linear.x = 0.0
                self.twist.angular.z = 0.5
                self._cmd_pub.publish(self.twist)
                self.turns += 1
                rospy.loginfo('distance of the obstacle : %f', nearest)
            else:
                self.twist.linear.x = 0.2
                self.twist.angular.z = 0.0
                self._cmd_pub.publish(self.twist)
        self._cmd_pub.publish(Twist())
        print("turned %s, kept %s" % (self.turns > 0, self.nearest > 0.3))


def main():
    rospy.init_node('turtlebot_scan')
    try:
        Obstacle()
    except rospy.ROSInterruptException:
        pass


if __name__ == '__main__':
    main()
